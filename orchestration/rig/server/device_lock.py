"""Lock of a device: of all servers of all users on a machine, one has it.

The front has it, not the process that has the device open at the moment: when a device's process
fails, the guard opens the device in its place. The operating system holds the lock, which therefore
ends with the front, however that ends.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime
from pathlib import Path

from filelock import FileLock, Timeout

from fmus.kit import UserError
from orchestration.rig.server.latch_file import digest

# for the locks of devices (Filesystem Hierarchy Standard 3.0, 3.15); not every system has it
_LOCKS = Path("/run/lock")


@contextmanager
def locked(devices: Sequence[str]) -> Iterator[None]:
    """Lock devices for this process while the context lasts.

    Parameters
    ----------
    devices : sequence of str

    Raises
    ------
    UserError
        If another process has locked one of them, which the text names.
    """
    with ExitStack() as stack:
        for device in sorted(set(devices)):
            stack.enter_context(_locked(device))
        yield


@contextmanager
def _locked(device: str) -> Iterator[None]:
    """Lock one device while the context lasts."""
    path = _folder() / f"ppy-rig-{digest(device)}.lock"
    owner = path.with_suffix(".owner")  # Windows lets nobody read a file that is locked
    lock = FileLock(path, timeout=0, mode=0o666)
    try:
        lock.acquire()
    except Timeout as error:
        raise UserError(
            f"{device} is served already, by {_read_owner(owner) or 'another process'}; end that"
            " first"
        ) from error
    except OSError as error:
        raise UserError(
            f"{device} cannot be locked: {path}: {error.strerror or error}; it may be of a server"
            " that another user has started"
        ) from error
    try:
        with suppress(OSError):  # for that message alone
            owner.write_text(_describe_owner(), encoding="utf-8")
        yield
    finally:
        with suppress(OSError):
            owner.unlink()
        lock.release()


def _folder() -> Path:
    """Return the folder that all users of this machine share."""
    if sys.platform == "win32":
        return Path(os.environ.get("PROGRAMDATA", r"C:\ProgramData"))
    return _LOCKS if os.access(_LOCKS, os.W_OK) else Path("/tmp")


def _describe_owner() -> str:
    """Return this process and the present time in words."""
    return f"process {os.getpid()} since {datetime.now().isoformat(' ', 'seconds')}"


def _read_owner(path: Path) -> str:
    """Return the contents of a file; empty if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return ""
