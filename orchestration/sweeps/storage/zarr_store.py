"""Zarr store of the dataset of a sweep, which is written in parts as it may exceed the memory."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import xarray

from fmus.kit import UserError, files, quoting
from fmus.kit.extras import require

_CHUNK = "8MiB"
_ZARR_FILE = re.compile(r"\.zgroup|\.zattrs|\.zmetadata|\.zarray|\d+(\.\d+)*")


def check(path: Path) -> None:
    """Raise if no store can be written to a path, before the sweep is run.

    Raises
    ------
    UserError
        If zarr is not installed, or the path has anything other than a store of a sweep.
    """
    # they are imported only after the sweep, which would be lost without them
    require("zarr", "dask")
    if path.is_symlink():
        raise UserError(f"--out {path}: is a link; name the folder that it leads to")
    if path.exists():
        _check_ours(path)


def _check_ours(path: Path) -> None:
    """Raise if a folder is not a store of a sweep, or has other contents.

    A store is replaced as a whole, with all contents of its folder.
    """
    if not (path / ".zgroup").is_file():
        raise UserError(f"--out {path}: is not a store of a sweep; it will not be overwritten")
    try:
        attributes = json.loads((path / ".zattrs").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        attributes = None
    if not isinstance(attributes, dict) or not {"design", "over"} <= {*attributes}:
        raise UserError(
            f"--out {path}: is a Zarr store, but not of a sweep; it will not be overwritten"
        )
    for folder, subfolders, names in os.walk(path):
        for name in (*names, *subfolders):
            content = Path(folder) / name
            if not _is_of_store(content):
                other = content.relative_to(path)
                raise UserError(
                    f"--out {path}: holds {other}, which is not of a store; move it elsewhere"
                )


def _is_of_store(path: Path) -> bool:
    """Return whether a path in a store is an array or a file of the Zarr format."""
    if path.is_symlink():
        return False
    if path.is_dir():
        return (path / ".zarray").is_file()
    return _ZARR_FILE.fullmatch(path.name) is not None


def write(data: xarray.Dataset, path: Path) -> None:
    """Write a dataset, whole or not at all, in chunks of cases with their whole traces.

    Parameters
    ----------
    data : xarray.Dataset
        It may exceed the memory.
    path : Path
        A folder; an existing store is replaced.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    import dask

    parameters = quoting.words(str(data.attrs["over"]))
    chunks: dict[Hashable, Any] = {
        dim: "auto" for dim in data.dims if dim == "case" or dim in parameters
    }
    if "time" in data.dims:
        chunks["time"] = -1
    check(path)  # it may have changed during the sweep
    # one thread, as each has a chunk in memory
    serial = dask.config.set({"array.chunk-size": _CHUNK, "scheduler": "synchronous"})
    with files.replacing(path) as new, serial:
        # format 2 specifies texts of fixed length, format 3 does not yet
        data.chunk(chunks).to_zarr(new, mode="w-", zarr_format=2)
