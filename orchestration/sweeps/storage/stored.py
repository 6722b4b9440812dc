"""A swept dataset as a Zarr store: written in parts, and opened without reading it, however large it is."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from importlib.util import find_spec
from pathlib import Path

import xarray

from fmus.kit.errors import UserError

ENDING = ".zarr"
_CHUNK = "8MiB"
_OF_ZARR = re.compile(r"\.zgroup|\.zattrs|\.zmetadata|\.zarray|\d+(\.\d+)*")


def check(path: Path) -> None:
    """Refuse, before any work is done, what cannot be written.

    Raises
    ------
    UserError
        If zarr is not installed, or there is anything else than a whole store of a sweep: it will not be overwritten.
    """
    if not all(
        map(find_spec, ("zarr", "dask"))
    ):  # they are imported after the sweep, and leave much to be cleared up
        raise UserError(
            f"--out {path}: writing Zarr needs zarr and dask: pip install 'ppy-rig[zarr]'"
        )
    if path.is_symlink():
        raise UserError(f"--out {path}: is a link; name the folder that it leads to")
    if path.exists():
        _check_ours(path)


def _check_ours(path: Path) -> None:
    """Refuse what is no store of a sweep, or has something else in it: it is removed as a whole when it is replaced."""
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
            known = (
                (here / name / ".zarray").is_file() if name in folders else _OF_ZARR.fullmatch(name)
            )
            if not known or (here / name).is_symlink():
                strange = (here / name).relative_to(path)
                raise UserError(
                    f"--out {path}: holds {strange}, which is not of a store; move it elsewhere"
                )


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

    cases = [dim for dim in data.dims if dim == "case" or dim in str(data.attrs["over"]).split(" ")]
    try:
        check(path)  # it may have changed during the sweep
        # beside it, so that replacing it is one step, and of a name that nothing else has
        scratch = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error
    new, old = scratch / "new", scratch / "old"
    try:
        # one chunk after the other: several threads would have as many in memory
        with dask.config.set({"array.chunk-size": _CHUNK, "scheduler": "synchronous"}):
            # format 2 has a place in its specification for texts of one length, which format 3 has not yet
            data.chunk(
                {**dict.fromkeys(cases, "auto"), **({"time": -1} if "time" in data.dims else {})}
            ).to_zarr(new, mode="w-", zarr_format=2)
        if path.exists():
            path.rename(old)
        try:
            new.rename(path)
        except OSError:
            if old.exists():
                old.rename(path)
            raise
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        lost = old.exists() and not path.exists()  # it could not be put back either
        shutil.rmtree(new if lost else scratch, ignore_errors=True)
