"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import uuid
from collections.abc import Callable
from pathlib import Path

from fmus.kit.errors import UserError


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
    """Write a file whole or not at all into a folder that is there; it is on the disk when this returns.

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
    # beside the target, so that replacing it is one step; of its own name, so that two writers do not mix
    temporary = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        with open(temporary, "xb", opener=functools.partial(os.open, mode=mode)) as file:
            file.write(contents)
            file.flush()
            os.fsync(
                file.fileno()
            )  # else a file may have its name, and after a power failure nothing in it
        temporary.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    _sync(path.parent)


def _sync(folder: Path) -> None:
    """Have the names in a folder on the disk, where the platform can; what they name is there already."""
    if sys.platform == "win32":
        return
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def is_file(path: Path) -> bool:
    """Whether there is a file; a name that no file can have, such as a far too long one, is none either."""
    return _is(path.is_file)


def is_folder(path: Path) -> bool:
    """Whether there is a folder; likewise."""
    return _is(path.is_dir)


def _is(question: Callable[[], bool]) -> bool:
    try:
        return question()
    except (OSError, ValueError):
        return False
