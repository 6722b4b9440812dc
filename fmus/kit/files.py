"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import uuid
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
    # beside the target, so that replacing it is one step; of its own name, so that two writers do not mix
    temporary = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_bytes(contents)
        temporary.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise UserError(f"cannot write {path}: {error.strerror}") from error


def write_once(path: Path, contents: bytes) -> None:
    """Write a file whose name identifies its contents; if another process was faster, all is well.

    Parameters
    ----------
    path : Path
    contents : bytes

    Raises
    ------
    UserError
        If it cannot be written and is not there.
    """
    try:
        write(path, contents)
    except UserError:
        if not path.exists():  # Windows refuses to replace a library that somebody has loaded
            raise
