"""Arrays on disk, which have their whole size from the start."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from typing import Any, Literal

import numpy as np


def opened(path: Path, mode: Literal["r", "r+"], shape: tuple[int, ...], kind: str) -> Any:
    """Map an array from an existing file into memory.

    Parameters
    ----------
    path : Path
        File of numpy (.npy).
    mode : {"r", "r+"}
        Read only, or read and write.
    shape : tuple of int
        Expected shape.
    kind : str
        Expected type, such as ``f8``.

    Raises
    ------
    ValueError
        If the file does not exist, was cut short, or has another shape or type.
    """
    if not path.exists():
        raise ValueError(f"{path.name} is missing")
    array = np.lib.format.open_memmap(path, "r")  # r+ would fill a truncated file with zeros
    if array.shape != shape or array.dtype != np.dtype(kind):
        raise ValueError(f"{path.name} is of another shape")
    return np.lib.format.open_memmap(path, mode)


def reserve(path: Path) -> None:
    """Reserve space on the disk for a sparse file, so that no later write fails for lack of it.

    Raises
    ------
    OSError
        If there is not enough space.
    """
    size = path.stat().st_size
    if hasattr(os, "posix_fallocate"):
        with path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, size)
    elif shutil.disk_usage(path.parent).free < size:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
