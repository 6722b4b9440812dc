"""One process at a time in a folder, even if the one before it was killed there."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from fmus.kit.errors import UserError

NAME = "lock"
_ours: set[Path] = (
    set()
)  # that this process holds: its number may be that of one that was killed, as in a container


@contextlib.contextmanager
def held(folder: Path) -> Iterator[None]:
    """Have a folder for this process alone while the context lasts; it is made if it is not there.

    Raises
    ------
    UserError
        If another process has it, or it cannot be written.
    """
    path = folder.absolute() / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _take(path)
    except FileExistsError as error:
        if not folder.is_dir():
            raise UserError(f"{folder}: is no folder") from error
        raise UserError(
            f"{folder}: another process works on it ({_owner(path) or 'just begun'}); wait for it, or remove "
            f"{path.name} in it if there is none"
        ) from error
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror or error})") from error
    _ours.add(path)
    try:
        yield
    finally:
        _ours.discard(path)
        path.unlink(missing_ok=True)


def _take(path: Path) -> None:
    """Make the file, in place of one of a process that is gone; FileExistsError if there is one of another."""
    owner = _owner(path)
    if owner is not None and path not in _ours and (owner == os.getpid() or not _runs(owner)):
        path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
    try:
        os.write(descriptor, f"{os.getpid()}\n".encode())
    except OSError:
        path.unlink(missing_ok=True)
        raise
    finally:
        os.close(descriptor)


def _owner(path: Path) -> int | None:
    try:
        return int(path.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


def _runs(process: int) -> bool:
    if sys.platform == "win32":  # where signal 0 is no question, but Ctrl-C
        import ctypes

        kernel = ctypes.windll.kernel32
        handle = kernel.OpenProcess(0x00100000, False, process)  # SYNCHRONIZE
        if not handle:
            return bool(kernel.GetLastError() == 5)  # it is there, and of somebody else
        ended = kernel.WaitForSingleObject(handle, 0) == 0
        kernel.CloseHandle(handle)
        return not ended
    try:
        os.kill(process, 0)
    except PermissionError:
        return True
    except (ProcessLookupError, OverflowError):
        return False
    return True
