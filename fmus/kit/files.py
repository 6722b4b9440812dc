"""Atomic writing of files and folders, and tests for their existence that never raise."""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

from fmus.kit.errors import UserError
from fmus.kit.interrupt import uninterrupted


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
