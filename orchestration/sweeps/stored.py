"""A swept dataset as a Zarr store: written in parts, and opened without reading it, however large it is."""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path

import xarray

from fmus.kit.errors import UserError

ENDING = ".zarr"
_CHUNK = "8MiB"


def check(path: Path) -> None:
    """Refuse, before any work is done, what cannot be written.

    Raises
    ------
    UserError
        If zarr is not installed, or there is a folder that is no store: it will not be overwritten.
    """
    if not all(map(find_spec, ("zarr", "dask"))):  # they are imported after the sweep, and leave much to be cleared up
        raise UserError(f"--out {path}: writing Zarr needs zarr and dask: pip install 'ppy-rig[zarr]'")
    if path.exists() and not any((path / name).exists() for name in (".zgroup", "zarr.json")):
        raise UserError(f"--out {path}: is there and is no Zarr store; it will not be overwritten")


def write(data: xarray.Dataset, path: Path) -> None:
    """Write a dataset whole or not at all, in chunks of cases with their whole courses.

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

    new = path.with_name(f"{path.name}.new")
    cases = [dim for dim in data.dims if dim == "case" or dim in str(data.attrs["over"]).split(" ")]
    try:
        shutil.rmtree(new, ignore_errors=True)  # of a process that ended
        # one chunk after the other: several threads would have as many in memory
        with dask.config.set({"array.chunk-size": _CHUNK, "scheduler": "synchronous"}):
            # format 2 has a place in its specification for texts of one length, which format 3 has not yet
            data.chunk({**dict.fromkeys(cases, "auto"), **({"time": -1} if "time" in data.dims else {})}).to_zarr(
                new, mode="w-", zarr_format=2
            )
        if path.exists():
            shutil.rmtree(path)
        new.rename(path)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(new, ignore_errors=True)
