"""File locks of the operating system, which end with the process that holds them."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

NO_LINK = getattr(os, "O_NOFOLLOW", 0)


def take(path: Path) -> int | None:
    """Lock a file, which is made if it is not there.

    Parameters
    ----------
    path : Path
        The process that locks it may remove it, but only while it is locked.

    Returns
    -------
    int or None
        A descriptor for :func:`release`; None if it is locked, by another process or by this one.

    Raises
    ------
    OSError
        If it cannot be made, or the file system has no locks.
    """
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | NO_LINK, 0o644)
        try:
            if not _locked(descriptor):
                os.close(descriptor)
                return None
            # the process that had it before may have removed it since it was opened
            if _is_open(descriptor, path):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def release(path: Path, descriptor: int) -> None:
    """Remove a file that :func:`take` locked, and release it."""
    if sys.platform == "win32":
        os.close(descriptor)  # an open file cannot be removed; another process may take it now
        with contextlib.suppress(OSError):
            path.unlink()
    else:
        with contextlib.suppress(OSError):
            path.unlink()  # while it is locked: nobody can have taken it again
        os.close(descriptor)


def _is_open(descriptor: int, path: Path) -> bool:
    """Return whether a descriptor is of the file that has this path now."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    except FileNotFoundError:
        return False


def _locked(descriptor: int) -> bool:
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
