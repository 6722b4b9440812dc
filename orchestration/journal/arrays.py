"""Arrays on disk, which have their whole size from the start."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from typing import Any, Literal

import numpy as np


def opened(path: Path, mode: Literal["r", "r+"], shape: tuple[int, ...], kind: str) -> Any:
    """Map an existing array of a shape and a type.

    Raises
    ------
    ValueError
        If it does not exist, was cut short, or is of another shape or type.
    """
    if not path.exists():
        raise ValueError(f"{path.name} is missing")
    array = np.lib.format.open_memmap(path, "r")  # r+ would fill a truncated file with zeros
    if array.shape != shape or array.dtype != np.dtype(kind):
        raise ValueError(f"{path.name} is of another shape")
    return np.lib.format.open_memmap(path, mode)


def reserve(path: Path) -> None:
    """Reserve room on the disk for all of a file.

    Raises
    ------
    OSError
        If there is no room.
    """
    size = path.stat().st_size
    if hasattr(os, "posix_fallocate"):
        with path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, size)
    elif shutil.disk_usage(path.parent).free < size:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
