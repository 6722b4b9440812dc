"""File locks of the operating system, which are released at the end of their process."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

NO_LINK = getattr(os, "O_NOFOLLOW", 0)


def take(path: Path) -> int | None:
    """Lock a file, making it if it does not exist.

    Parameters
    ----------
    path : Path
        The file. It may be removed only by the process that has locked it.

    Returns
    -------
    int or None
        Descriptor for :func:`release`; None if another process, or this one, has locked the file.

    Raises
    ------
    OSError
        If the file cannot be made, or the file system has no locks.
    """
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | NO_LINK, 0o644)
        try:
            if not _try_lock(descriptor):
                os.close(descriptor)
                return None
            # the previous owner may have removed the file after it was opened here
            if _is_open(descriptor, path):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def release(path: Path, descriptor: int) -> None:
    """Remove a file that :func:`take` locked, and release the lock."""
    if sys.platform == "win32":
        os.close(descriptor)  # an open file cannot be removed; another process may lock it now
        with contextlib.suppress(OSError):
            path.unlink()
    else:
        with contextlib.suppress(OSError):
            path.unlink()  # before the lock is released, so that no other process has locked it
        os.close(descriptor)


def _is_open(descriptor: int, path: Path) -> bool:
    """Return whether a descriptor is that of the file at a path."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    except FileNotFoundError:
        return False


def _try_lock(descriptor: int) -> bool:
    """Lock an open file; return False if another descriptor has the lock."""
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
