"""The folder of a journal: one process works in it, and only files of the journal are removed."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from fmus.kit import UserError

ABOUT = "work.json"
DONE = "done.npy"
NUMBERS = "numbers.npy"
TRACES = "traces.npy"
FAILURES = "failures.jsonl"
REMARKS = "remarks.jsonl"
_LOCK = "lock"
_KNOWN = (ABOUT, DONE, NUMBERS, TRACES, FAILURES, REMARKS, _LOCK)


@contextlib.contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Make a folder if it does not exist, and lock it for this process while the context lasts.

    The lock is one of the operating system, which releases it when the process ends, however it
    ends.

    Raises
    ------
    UserError
        If another process has locked the folder, or it cannot be written.
    """
    path = folder.absolute() / _LOCK
    lock = FileLock(path, timeout=0)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except FileExistsError as error:
        raise UserError(f"{folder}: is no folder") from error
    except Timeout as error:
        raise UserError(
            f"{folder}: another process works on it ({_owner(path) or 'just begun'}); wait for it"
        ) from error
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror or error})") from error
    had_journal = (folder / ABOUT).exists()
    with contextlib.suppress(OSError):  # only the message of a second process needs it
        path.write_text(f"{os.getpid()}\n", encoding="ascii")
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # Windows removes it when it is released
            path.unlink()
        lock.release()
        # `_remove` leaves a folder with the lock in it, which is empty only now
        if had_journal:
            with contextlib.suppress(OSError):
                path.parent.rmdir()


def _owner(path: Path) -> str:
    """Return the text in a lock's file, the number of the process; empty if it cannot be read."""
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return ""


def check(folder: Path) -> None:
    """Refuse a folder that contains anything but a journal, since a journal is removed in the end.

    Raises
    ------
    UserError
        If there is such a file or folder, naming the first, or the folder cannot be read.
    """
    try:
        strange = next((path for path in _contents(folder) if not _is_of_journal(path)), None)
    except OSError as error:
        raise UserError(f"{folder}: cannot be read ({error.strerror})") from error
    if strange is not None:
        raise UserError(
            f"{folder}: holds {strange.name}, which is no part of a journal, and what is done goes"
            " there: move that elsewhere"
        )


@contextlib.contextmanager
def removed_after(folder: Path | None) -> Iterator[None]:
    """Lock the folder of a journal while the context lasts; remove it if the context succeeds.

    Parameters
    ----------
    folder : Path or None
        None if there is no journal: nothing is done.

    Raises
    ------
    UserError
        See `locked_folder`.
    """
    if folder is None:
        yield
        return
    with locked_folder(folder):
        yield
        _remove(folder)


def _remove(folder: Path) -> None:
    """Remove the files of a journal and nothing else, and the folder if it is empty then."""
    with contextlib.suppress(OSError):
        for path in _contents(folder):
            if _is_of_journal(path):
                with contextlib.suppress(OSError):  # Windows keeps the lock until it is released
                    path.unlink()
        folder.rmdir()


def _contents(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []


def _is_of_journal(path: Path) -> bool:
    """Return whether a path is a file of a journal, or one that was not written to its end."""
    is_part = path.name.endswith(".part") and any(
        path.name.startswith(f"{known}.") for known in _KNOWN
    )
    return (path.name in _KNOWN or is_part) and path.is_file() and not path.is_symlink()
