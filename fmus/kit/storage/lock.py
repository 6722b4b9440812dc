"""A lock on a file that goes with the process that holds it, however that ends: the operating system keeps it."""

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
        Whoever locks it may remove it, but only while it is locked.

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
            if _is(
                descriptor, path
            ):  # whoever had it before may have removed it since it was opened
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def release(path: Path, descriptor: int) -> None:
    """Remove a file that :func:`take` locked, and let go of it."""
    if sys.platform != "win32":  # while it is locked: nobody can have taken it again
        with contextlib.suppress(OSError):
            path.unlink()
    os.close(descriptor)
    if (
        sys.platform == "win32"
    ):  # where what is open stays; if another has opened it, it is the other's
        with contextlib.suppress(OSError):
            path.unlink()


def _is(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    except FileNotFoundError:
        return False


def _locked(descriptor: int) -> bool:
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
