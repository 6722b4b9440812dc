"""Temporary folders that go with their process; of one that was killed, the next process removes them.

Beside each folder ``ppy-...`` is a file ``ppy-....lock``, locked for as long as the folder is in use. It is there
before the folder and goes after it, so that there is no moment at which a folder in use could be taken for one that is
not. The number of a process would not do: it is given again.
"""

from __future__ import annotations

import atexit
import contextlib
import errno
import functools
import os
import shutil
import stat
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

from fmus.kit.errors import UserError
from fmus.kit.storage import lock

_PREFIX, _LOCK = "ppy-", ".lock"
NO_ROOM = (
    errno.ENOSPC,
    errno.EFBIG,
    getattr(errno, "EDQUOT", errno.ENOSPC),
    errno.EROFS,
)  # errors about a place
_PROBE = bytes(2**20)
_NONE = (
    -1
)  # in place of a descriptor, where a file system has no locks: nothing is swept there either
_ours: dict[Path, int] = {}  # folders of this process, and the descriptors of their locks


def make(kind: str) -> Path:
    """Make a folder, to be given to :func:`remove`, at the latest when the process ends.

    Parameters
    ----------
    kind : str
        What it is for, in its name.

    Returns
    -------
    Path
        Empty, for this user alone, in the folder for temporary files.

    Raises
    ------
    UserError
        If it cannot be made.
    """
    try:
        place = tempfile.gettempdir()
    except FileNotFoundError as error:  # it has tried several
        told = f"no folder for temporary files can be written ({error.strerror})"
        raise UserError(f"{told}; make room in one of them, or name another in TMPDIR") from error
    _sweep(place)
    try:
        while True:
            folder = Path(place).absolute() / f"{_PREFIX}{kind}-{uuid.uuid4().hex[:12]}"
            descriptor = _locked(folder)
            if descriptor is None:
                continue  # another process took it for left behind, between the file and its lock
            _ours[folder] = descriptor
            try:
                folder.mkdir(mode=0o700)
            except BaseException:
                remove(folder)
                raise
            return folder
    except OSError as error:
        raise no_room(Path(place), error) from error


def remove(folder: str | Path) -> None:
    """Remove a folder that this process made, with all that is in it; others stay."""
    path = Path(folder)
    if path in _ours:
        _remove(path, _ours.pop(path))


@contextlib.contextmanager
def folder(kind: str) -> Iterator[Path]:
    """Have a folder while the context lasts; see `make`."""
    made = make(kind)
    try:
        yield made
    finally:
        remove(made)


@contextlib.contextmanager
def written(folder: str | Path) -> Iterator[None]:
    """Tell in one line that something in a folder could not be written.

    Raises
    ------
    UserError
        In place of an OSError.
    """
    try:
        yield
    except OSError as error:
        raise no_room(Path(folder).parent, error) from error


def check_room(folder: str | Path) -> None:
    """Refuse a folder that takes no more, of which programs of others say what they like.

    Raises
    ------
    UserError
    """
    probe = Path(folder) / "probe"
    with written(folder):
        try:
            probe.write_bytes(_PROBE)
        finally:
            with contextlib.suppress(OSError):
                probe.unlink()


def no_room(place: Path, error: OSError) -> UserError:
    """Say what to do about a folder for temporary files."""
    return UserError(
        f"{place}: temporary files cannot be written there ({error.strerror or error}); "
        "make room, or name another folder in TMPDIR"
    )


@functools.cache
def _sweep(place: str) -> None:
    """Remove what processes that are gone left in a folder."""
    for path in Path(place).absolute().glob(f"{_PREFIX}*{_LOCK}"):
        with contextlib.suppress(OSError):
            folder = path.with_suffix("")
            if _is_ours(path, stat.S_ISREG) and (
                not folder.exists() or _is_ours(folder, stat.S_ISDIR)
            ):
                descriptor = lock.take(path)
                if descriptor is not None:
                    _remove(folder, descriptor)


def _is_ours(path: Path, is_kind: Callable[[int], bool]) -> bool:
    about = path.lstat()
    return is_kind(about.st_mode) and (sys.platform == "win32" or about.st_uid == os.geteuid())


def _remove(folder: Path, descriptor: int) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    if descriptor == _NONE:
        return
    if folder.exists():  # Windows keeps what is loaded; the next process removes it
        os.close(descriptor)
    else:
        lock.release(_lock_of(folder), descriptor)


def _locked(folder: Path) -> int | None:
    """Lock the file beside a folder that is still to be made; None if another process was faster."""
    path = _lock_of(folder)
    try:
        return lock.take(path)
    except OSError:
        with contextlib.suppress(OSError):
            path.unlink()
        return _NONE


def _lock_of(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}{_LOCK}")


@atexit.register
def _remove_all() -> None:
    for folder in list(_ours):
        remove(folder)


if hasattr(os, "register_at_fork"):  # a copy of this process does not remove what this one has
    os.register_at_fork(after_in_child=_ours.clear)
