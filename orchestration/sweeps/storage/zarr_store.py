"""Zarr store of a swept dataset, which may be larger than memory: it is written in parts."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import xarray

from fmus.kit import UserError, files
from fmus.kit.extras import require

_CHUNK = "8MiB"
_OF_ZARR = re.compile(r"\.zgroup|\.zattrs|\.zmetadata|\.zarray|\d+(\.\d+)*")


def check(path: Path) -> None:
    """Refuse a place where no store can be written, before any work is done.

    Raises
    ------
    UserError
        If zarr is not installed, or there is anything else than a store of a sweep, which would be
        overwritten.
    """
    # they are imported after the sweep, when a failure leaves much to be cleared up
    require("zarr", "dask")
    if path.is_symlink():
        raise UserError(f"--out {path}: is a link; name the folder that it leads to")
    if path.exists():
        _check_ours(path)


def _check_ours(path: Path) -> None:
    """Refuse a folder that is no store of a sweep, or that has anything else in it.

    A store is removed as a whole when it is replaced.
    """
    if not (path / ".zgroup").is_file():
        raise UserError(f"--out {path}: is there and is no Zarr store; it will not be overwritten")
    try:
        about = json.loads((path / ".zattrs").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        about = None
    if not isinstance(about, dict) or not {"design", "over"} <= {*about}:
        raise UserError(
            f"--out {path}: is a Zarr store, but not of a sweep; it will not be overwritten"
        )
    for place, folders, names in os.walk(path):
        here = Path(place)
        for name in (*names, *folders):
            if not _is_of_store(here / name):
                strange = (here / name).relative_to(path)
                raise UserError(
                    f"--out {path}: holds {strange}, which is not of a store; move it elsewhere"
                )


def _is_of_store(path: Path) -> bool:
    """Return True if a path in a store is an array of it, or a file of the Zarr format."""
    if path.is_symlink():
        return False
    if path.is_dir():
        return (path / ".zarray").is_file()
    return _OF_ZARR.fullmatch(path.name) is not None


def write(data: xarray.Dataset, path: Path) -> None:
    """Write a dataset whole or not at all, in chunks of cases with their whole traces.

    Parameters
    ----------
    data : xarray.Dataset
        May be larger than memory.
    path : Path
        A folder; a store that is there is replaced.

    Raises
    ------
    UserError
        If it cannot be written.
    """
    import dask

    parameters = str(data.attrs["over"]).split(" ")
    chunks: dict[Hashable, Any] = {
        dim: "auto" for dim in data.dims if dim == "case" or dim in parameters
    }
    if "time" in data.dims:
        chunks["time"] = -1
    check(path)  # it may have changed during the sweep
    # one chunk after the other: several threads would have as many in memory
    in_turn = dask.config.set({"array.chunk-size": _CHUNK, "scheduler": "synchronous"})
    with files.replacing(path) as new, in_turn:
        # format 2 has a place in its specification for texts of one length, which format 3 has
        # not yet
        data.chunk(chunks).to_zarr(new, mode="w-", zarr_format=2)
