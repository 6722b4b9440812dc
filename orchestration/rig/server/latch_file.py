"""File that keeps the latch of a device over a restart of its server, and over a loss of power.

While a server uses the device, its file says so. If the next server finds this entry, the last one
did not end in order, and the state of the device is unknown. So it is if the file is gone: an empty
one of its name without ``.json`` tells this from a device that was never used.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime
from hashlib import sha256
from pathlib import Path
from queue import Empty, Full, Queue
from secrets import token_hex
from threading import Thread
from typing import NamedTuple

import platformdirs

from fmus.kit import UserError, files

_LOOK = 0.5  # s between two looks whether the files are there
_LONGEST_END = 2.0  # s that the disk gets for the last write at the end of a server


class LatchRecord(NamedTuple):
    """A closed latch as it is stored.

    Attributes
    ----------
    name : str
    reason : str
    alarm : str
        Empty if there is none.
    since : str
        Wall time.
    """

    name: str
    reason: str
    alarm: str
    since: str


class LatchKeeper:
    """Keeper that stores nothing, for a rig without a device.

    Attributes
    ----------
    held : LatchRecord or None
        The latch that was closed when the server started.
    """

    held: LatchRecord | None = None

    def keep(self, record: LatchRecord | None) -> None:
        """Store a closed latch; None for an open one."""

    def end(self) -> None:
        """Note that the server ended in order, with the latch as it is."""


class LatchFiles(LatchKeeper):
    """Keeper of the latch of a server's devices, in one file each.

    A thread writes: a stop does not wait for a disk. Until the latch is written the
    file says that the server is not at its end, which latches the next one as well.

    Parameters
    ----------
    paths : sequence of Path
    tell : callable
        Called with a line if the disk fails.

    Raises
    ------
    UserError
        If a file cannot be read or written.
    """

    def __init__(self, paths: Sequence[Path], tell: Callable[[str], None]) -> None:
        self._paths = paths
        self._tell = tell
        self.held = next(filter(None, map(_read, paths)), None)
        try:
            self._write(self.held, serving=True)
        except OSError as error:
            raise UserError(
                f"the latch cannot be kept in {paths[0].parent}: {error.strerror}; choose another"
                " folder with --state"
            ) from error
        self._newest: Queue[LatchRecord | None] = Queue(1)
        self._kept = self.held
        self._ending = False
        self._trouble: str | None = ""  # as it was told
        self._writer = Thread(target=self._write_newest, daemon=True, name="latch")
        self._writer.start()

    def keep(self, record: LatchRecord | None) -> None:
        """Have the thread store a closed latch, or None for an open one, in place of an older."""
        self._kept = record
        while True:
            try:
                self._newest.put_nowait(record)
                return
            except Full:
                with suppress(Empty):  # the thread may have taken it by now
                    self._newest.get_nowait()

    def _write_newest(self) -> None:
        """Write every record that is newest when the one before has been written, until the end.

        A file that somebody has deleted is written again.
        """
        record = self._kept
        while True:
            is_there = all(map(os.path.exists, self._paths))
            with suppress(Empty):
                record = self._newest.get(timeout=_LOOK)
                is_there = False
            if self._ending:
                return
            if not is_there:
                self._try_to_write(record, serving=True)

    def _try_to_write(self, record: LatchRecord | None, serving: bool) -> None:
        try:
            self._write(record, serving)
            self._trouble = ""
        except OSError as error:
            if error.strerror != self._trouble:
                self._trouble = error.strerror
                self._tell(
                    f"THE LATCH IS NOT KEPT in {self._paths[0].parent}: {error.strerror}; the next"
                    " server of this device is latched in any case"
                )

    def _write(self, record: LatchRecord | None, serving: bool) -> None:
        server = f"process {os.getpid()}" if serving else ""
        fields = None if record is None else record._asdict()
        text = json.dumps({"server": server, "latch": fields}, indent=1)
        for path in self._paths:
            path.parent.mkdir(parents=True, exist_ok=True)  # somebody may have deleted it since
            files.put(path, text.encode(), mode=0o600)
            path.with_suffix("").touch(0o600)

    def end(self) -> None:
        """Note that the server ended in order, with the latch as it is."""
        self._ending = True
        self.keep(self._kept)  # wakes the thread, which ends without writing it
        self._writer.join(_LONGEST_END)
        if not self._writer.is_alive():
            self._try_to_write(self._kept, serving=False)


def _read(path: Path) -> LatchRecord | None:
    """Return the closed latch in a file; None if it is open.

    A file that is damaged or deleted, or of a server that did not end in order, is a new latch.

    Raises
    ------
    UserError
        If the file cannot be read.
    """
    now = datetime.now().isoformat(" ", "seconds")
    try:
        if path.exists() and not path.is_file():
            raise ValueError("a pipe, say, which would be waited for")
        fields = json.loads(path.read_text(encoding="utf-8"))
        latch = fields["latch"]
        record = None if latch is None else LatchRecord(**latch)
        server = fields["server"]
        if record is not None and not (isinstance(record.name, str) and record.name):
            raise ValueError("without a name it could not be acknowledged")
    except FileNotFoundError:
        if not path.with_suffix("").exists():
            return None
        return LatchRecord(token_hex(8), f"{path} was deleted, so nobody knows", "", now)
    except OSError as error:
        raise UserError(f"the latch cannot be read: {path}: {error.strerror}") from error
    except (ValueError, TypeError, KeyError):
        return LatchRecord(token_hex(8), f"{path} is damaged, so nobody knows", "", now)
    if record is None and server:
        reason = f"the server before this one ({server}) did not end in order"
        return LatchRecord(token_hex(8), reason, "", now)
    return record


def make_latch_keeper(
    devices: Sequence[str], folder: Path | None, tell: Callable[[str], None]
) -> LatchKeeper:
    """Make the keeper of the latch of devices, in whose files a server has them from now on.

    Parameters
    ----------
    devices : sequence of str
        Empty for a rig that is not real, whose latch is not stored.
    folder : Path or None
        Folder of the files, made if it does not exist; None is the user's folder for the state of
        programs.
    tell : callable
        Called with a line if the disk fails later.

    Returns
    -------
    LatchKeeper

    Raises
    ------
    UserError
        If the folder or a file in it cannot be used.
    """
    if not devices:
        return LatchKeeper()
    place = folder or Path(platformdirs.user_state_dir("ppy-rig", appauthor=False))
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--state {place}: {error.strerror}") from error
    return LatchFiles([place / f"{digest(device)}.json" for device in devices], tell)


def digest(device: str) -> str:
    """Return a name for the files of a device, of letters and digits."""
    return sha256(device.encode()).hexdigest()[:16]
