"""HDF5 files, among them those of MATLAB 7.3 and NetCDF 4."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit.extras import optional
from orchestration.records.formats.text import choose_table
from orchestration.records.record import damaged, refuse
from orchestration.records.source import AS_IT_STANDS, Reading
from orchestration.records.tables import Column, Table, as_numbers

_UNITS = ("units", "unit", "Units", "Unit", "unit_string")
_FILLS = ("_FillValue", "missing_value")
_STEPS = ("dt", "Ts", "sample_period")


def read_hdf5(path: Path, content: bytes, reading: Reading = AS_IT_STANDS) -> Table:
    """Read a group of an HDF5 file; a `Reader`.

    One column per vector of the group, or per field of a table; units come from the attribute
    ``units`` or ``unit``, scales, offsets and missing values from those of the CF conventions. Of
    several groups with vectors, or lengths of them, the user names one. A damaged file is refused;
    without h5py any file is.
    """
    with optional():
        import h5py
    tables: dict[str, dict[str, Column]] = {}
    with damaged(path, "HDF5"), h5py.File(io.BytesIO(content), "r") as file:
        file.visititems(lambda name, item: _collect(tables, name, item))
    if not tables:
        raise refuse(path, "the HDF5 file holds no vectors")
    names = list(tables)
    chosen = tables[names[choose_table(path, names, reading.table)]]
    return Table.of(path, list(chosen.values()))


def _collect(tables: dict[str, dict[str, Column]], name: str, item: Any) -> None:
    """Add the columns of a dataset to the table of its group and length."""
    if not hasattr(item, "shape") or name.startswith("#"):
        return
    folder, _, own = name.rpartition("/")
    if item.dtype.names:
        values = item[...].ravel()
        fields = {field: values[field] for field in item.dtype.names if values[field].ndim == 1}
        tables[name] = {n: _column(n, v, {}) for n, v in fields.items()}
        return
    count = int(np.prod(item.shape, dtype=np.int64))
    if item.shape and count > 1 and count == max(item.shape) and item.dtype.kind in "biufSO":
        same = [k for k, t in tables.items() if k.partition(" of ")[0] == (folder or "/")]
        column = _column(own, np.asarray(item[...]).ravel(), dict(item.attrs))
        for key in same:
            if len(next(iter(tables[key].values())).cells) == count:
                tables[key][own] = column
                return
        key = (folder or "/") if not same else f"{folder or '/'} of {count} rows"
        tables[key] = {own: column}


def _column(name: str, values: np.ndarray, attributes: Mapping[str, Any]) -> Column:
    """Return a column with the unit, scale, offset and missing values of its attributes."""
    stated = next((_word(attributes[key]) for key in _UNITS if key in attributes), "")
    if values.dtype.kind in "SO":
        texts = [v.decode(errors="replace") if isinstance(v, bytes) else str(v) for v in values]
        return Column.read(name, texts, stated)
    numbers = np.asarray(as_numbers(values), dtype=float)
    for key in _FILLS:
        if key in attributes:
            fill = float(np.ravel(attributes[key])[0])
            numbers = np.where(numbers == fill, np.nan, numbers)
    scale = float(np.ravel(attributes.get("scale_factor", 1.0))[0])
    offset = float(np.ravel(attributes.get("add_offset", 0.0))[0])
    if (scale, offset) != (1.0, 0.0):
        numbers = scale * numbers + offset
    return Column.read(name, numbers, stated)


def _word(value: Any) -> str:
    """Return an attribute as text."""
    first = np.ravel(value)[0] if np.size(value) else ""
    return first.decode(errors="replace") if isinstance(first, bytes) else str(first)
