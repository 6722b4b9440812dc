"""Files and folders written whole or not at all, and questions to the file system.

The questions never raise.
"""

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
    """Write a file whole or not at all, making its folder.

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
    """Write a file whole or not at all into an existing folder.

    The file is on the disk when this returns.

    Parameters
    ----------
    path : Path
        A link is replaced, not followed.
    contents : bytes
    mode : int
        Of the file, less the umask.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    # beside the target, so that replacing it is one step; with a name of its own, so that two
    # writers do not mix
    temporary = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        with open(temporary, "xb", opener=functools.partial(os.open, mode=mode)) as file:
            file.write(contents)
            file.flush()
            # else a file may have its name, and after a power failure no contents
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    _sync(path.parent)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write a folder whole or not at all, making the one that it is in.

    What is there stays until the end of this context, and for good if an exception ends it.

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
        If it cannot be written; in the place of an OSError in this context, too.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # beside it, so that replacing it is one step, and of a name that nothing else has
        scratch = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        new = scratch / "new"
        old = scratch / "old"
        try:
            yield new
            with uninterrupted():
                _exchange(path, new, old)
        finally:
            lost = old.exists() and not path.exists()  # it could not be put back either
            shutil.rmtree(new if lost else scratch, ignore_errors=True)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error
    _sync(path.parent)


def _exchange(path: Path, new: Path, old: Path) -> None:
    """Move a folder away, if there is one, and a new one to its place."""
    if path.exists():
        path.rename(old)
    try:
        new.rename(path)
    except OSError:
        if old.exists():
            old.rename(path)
        raise


def _sync(folder: Path) -> None:
    """Put the names of files in a folder on the disk, where the platform can."""
    if sys.platform == "win32":
        return
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def is_file(path: Path) -> bool:
    """Return whether there is a file; a name that no file can have, such as a long one, is none."""
    return _is(path.is_file)


def is_folder(path: Path) -> bool:
    """Return whether there is a folder, likewise."""
    return _is(path.is_dir)


def _is(question: Callable[[], bool]) -> bool:
    """Return the answer of the file system; False for a name that it does not accept."""
    try:
        return question()
    except (OSError, ValueError):
        return False
