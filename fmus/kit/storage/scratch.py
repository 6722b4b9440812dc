"""Temporary folders that are removed with their process, or by the next one if it was killed.

Each folder ``ppy-...`` has a file ``ppy-....lock``, which is locked while the folder is in use. The
file is made before the folder and removed after it, so that a folder in use never seems abandoned.
A process id could not replace it, because ids are reused.
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

_PREFIX = "ppy-"
_LOCK = ".lock"
# errors that concern a folder or its file system, not a single file
NO_ROOM = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EROFS)
_PROBE = bytes(2**20)
# in place of a descriptor if the file system has no locks; nothing is swept there
_NO_LOCK = -1
_ours: dict[Path, int] = {}  # descriptors of locks, by the folders of this process


def make(kind: str) -> Path:
    """Make a temporary folder, which :func:`remove` or the end of the process removes.

    Parameters
    ----------
    kind : str
        Purpose of the folder, which is part of its name.

    Returns
    -------
    Path
        Empty folder that only this user can access.

    Raises
    ------
    UserError
        If it cannot be made.
    """
    try:
        place = tempfile.gettempdir()
    except FileNotFoundError as error:  # none of several candidates
        raise UserError(
            f"no folder for temporary files can be written ({error.strerror}); make room in one of"
            " them, or name another in TMPDIR"
        ) from error
    _sweep(place)
    try:
        while True:
            folder = Path(place).absolute() / f"{_PREFIX}{kind}-{uuid.uuid4().hex[:12]}"
            descriptor = _lock_for(folder)
            if descriptor is None:
                continue  # another process swept the lock file before it was locked
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
    """Remove a folder with its contents if this process made it."""
    path = Path(folder)
    if path in _ours:
        _remove(path, _ours.pop(path))


@contextlib.contextmanager
def folder(kind: str) -> Iterator[Path]:
    """Make a folder that is removed at the end of the context; see `make`."""
    path = make(kind)
    try:
        yield path
    finally:
        remove(path)


@contextlib.contextmanager
def written(folder: str | Path) -> Iterator[None]:
    """Replace errors of writing into a folder by a UserError that proposes a remedy.

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
    """Raise an error if a folder cannot be written, which other programs do not report clearly.

    Raises
    ------
    UserError
        With a remedy.
    """
    probe = Path(folder) / "probe"
    with written(folder):
        try:
            probe.write_bytes(_PROBE)
        finally:
            with contextlib.suppress(OSError):
                probe.unlink()


def no_room(place: Path, error: OSError) -> UserError:
    """Return the error, with a remedy, for a folder that cannot be written."""
    return UserError(
        f"{place}: temporary files cannot be written there ({error.strerror or error}); "
        "make room, or name another folder in TMPDIR"
    )


@functools.cache
def _sweep(place: str) -> None:
    """Remove the temporary folders of this user whose processes have ended; once in a process."""
    for path in Path(place).absolute().glob(f"{_PREFIX}*{_LOCK}"):
        with contextlib.suppress(OSError):
            folder = path.with_suffix("")
            if not _is_ours(path, stat.S_ISREG):
                continue
            if not folder.exists() or _is_ours(folder, stat.S_ISDIR):
                descriptor = lock.take(path)
                if descriptor is not None:
                    _remove(folder, descriptor)


def _is_ours(path: Path, is_kind: Callable[[int], bool]) -> bool:
    """Return whether a path itself, not the target of a link, is of a type and of this user."""
    about = path.lstat()
    return is_kind(about.st_mode) and (sys.platform == "win32" or about.st_uid == os.geteuid())


def _remove(folder: Path, descriptor: int) -> None:
    """Remove a folder and then its lock file."""
    shutil.rmtree(folder, ignore_errors=True)
    if descriptor == _NO_LOCK:
        return
    if folder.exists():  # Windows keeps a loaded library; the next process removes it
        os.close(descriptor)
    else:
        lock.release(_lock_of(folder), descriptor)


def _lock_for(folder: Path) -> int | None:
    """Lock the lock file of a folder before it is made; return None if another process has it."""
    path = _lock_of(folder)
    try:
        return lock.take(path)
    except OSError:
        with contextlib.suppress(OSError):
            path.unlink()
        return _NO_LOCK


def _lock_of(folder: Path) -> Path:
    """Return the path of the lock of a folder."""
    return folder.with_name(f"{folder.name}{_LOCK}")


@atexit.register
def _remove_all() -> None:
    """Remove all folders of this process."""
    for folder in list(_ours):
        remove(folder)


if hasattr(os, "register_at_fork"):  # a child process must not remove folders of its parent
    os.register_at_fork(after_in_child=_ours.clear)
