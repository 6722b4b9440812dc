"""Atomic writing of files and folders, and tests for their existence that never raise."""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from fmus.kit.errors import UserError
from fmus.kit.interrupt import uninterrupted

_kept: dict[str, bytes] | None = None  # contents by absolute path


@contextlib.contextmanager
def kept() -> Iterator[dict[str, bytes]]:
    """Keep the contents of files that :func:`contents` reads while the context lasts.

    Yields
    ------
    dict of str to bytes
        Contents by absolute path.
    """
    global _kept
    found = _kept = {}
    try:
        yield found
    finally:
        keep(None)


def keep(found: Mapping[str, bytes] | None) -> None:
    """Let :func:`contents` return contents that were read before, and keep what it reads.

    Parameters
    ----------
    found : Mapping of str to bytes or None
        Contents by absolute path; None to read files anew each time, as at the beginning.
    """
    global _kept
    _kept = None if found is None else dict(found)


def contents(path: Path) -> bytes:
    """Return the contents of a file: those that are kept, if there are any.

    Parameters
    ----------
    path : Path

    Raises
    ------
    OSError
        If it cannot be read.
    """
    if _kept is None:
        return path.read_bytes()
    key = str(path.absolute())
    if key not in _kept:
        _kept[key] = path.read_bytes()
    return _kept[key]


def write(path: Path, contents: bytes) -> None:
    """Write a file atomically, making its folder.

    Parameters
    ----------
    path : Path
    contents : bytes

    Raises
    ------
    UserError
        If the folder or the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        put(path, contents)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from error


def put(path: Path, contents: bytes, mode: int = 0o666) -> None:
    """Write a file atomically into an existing folder.

    The file is on the disk when this returns.

    Parameters
    ----------
    path : Path
        A link is replaced, not followed.
    contents : bytes
    mode : int
        Permissions of the file, less the umask.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    # in the same folder, because a rename is atomic only within a file system; with a unique name,
    # so that two writers do not mix
    temporary = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        with open(temporary, "xb", opener=functools.partial(os.open, mode=mode)) as file:
            file.write(contents)
            file.flush()
            # otherwise the file may be empty after a power failure
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    _sync(path.parent)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Replace a folder atomically at the end of a context, making its parent.

    The old folder stays if an exception ends the context.

    Parameters
    ----------
    path : Path
        A link is replaced, not followed.

    Yields
    ------
    Path
        The new folder, to be made and written in this context.

    Raises
    ------
    UserError
        If it cannot be written, or in place of an OSError in this context.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # in the same folder, because a rename is atomic only within a file system
        scratch = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        new = scratch / "new"
        old = scratch / "old"
        try:
            yield new
            with uninterrupted():
                _exchange(path, new, old)
        finally:
            is_only_copy = old.exists() and not path.exists()  # it could not be moved back
            shutil.rmtree(new if is_only_copy else scratch, ignore_errors=True)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error
    _sync(path.parent)


def _exchange(path: Path, new: Path, old: Path) -> None:
    """Move the folder at a path, if any, to `old`, and a new folder to the path."""
    if path.exists():
        path.rename(old)
    try:
        new.rename(path)
    except OSError:
        if old.exists():
            old.rename(path)
        raise


def _sync(folder: Path) -> None:
    """Write the directory entries of a folder to the disk, if the platform can."""
    if sys.platform == "win32":
        return
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def is_file(path: Path) -> bool:
    """Return whether a path is a file; False for a name that no file can have."""
    return _answer(path.is_file)


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder; False for a name that no folder can have."""
    return _answer(path.is_dir)


def _answer(question: Callable[[], bool]) -> bool:
    """Return the answer of the file system; False if it rejects the name."""
    try:
        return question()
    except (OSError, ValueError):
        return False
