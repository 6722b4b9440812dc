"""Tables in Python: a DataFrame, or arrays by name."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from fmus.kit import UserError
from orchestration.records.record import refuse
from orchestration.records.tables import Column, Table
from orchestration.records.times import TIME

_numbers = count(1)


@runtime_checkable
class Frame(Protocol):
    """A DataFrame of pandas."""

    columns: Any
    index: Any


Arrays = Frame | Mapping[str, Any]
"""A DataFrame, or arrays of shape (n,) by name: ``name [unit]`` or ``name``."""


def table_of(data: Arrays) -> Table:
    """Return a table with the columns of a DataFrame or with arrays.

    Parameters
    ----------
    data : DataFrame or Mapping of str to array_like, shape (n,)
        Names are ``name [unit]``, or have any other form of a file's header. The index of a
        DataFrame becomes a column if it has dates or durations, or a name of its own.

    Returns
    -------
    Table
        Its path is a name for messages, ``data_1`` and so on.

    Raises
    ------
    UserError
        If columns have no names or more than one dimension, lengths differ, or there are no rows.
    """
    if not isinstance(data, Frame | Mapping):
        raise UserError(
            f"record: {_kind(data)} has no names of columns; give them, as in"
            " {'time': time, 'current [A]': current}, or a DataFrame"
        )
    path = Path(f"data_{next(_numbers)}")
    arrays = _frame_columns(data) if isinstance(data, Frame) else data
    columns = []
    for title, values in arrays.items():
        array = _as_array(values)
        if array.ndim != 1:
            raise refuse(path, f"column '{title}' has shape {array.shape} (allowed: (n,))")
        columns.append(Column.read(str(title), array))
    return Table.of(path, columns)


def _kind(data: object) -> str:
    """Return a type for messages, of an array with its shape."""
    shape = getattr(data, "shape", None)
    return type(data).__name__ if shape is None else f"an array of shape {shape}"


def _frame_columns(frame: Any) -> dict[str, Any]:
    """Return the columns of a DataFrame by name, with its index if that may be the time."""
    names = [str(name) for name in frame.columns]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise UserError(f"DataFrame: several columns are called '{repeated}'; rename them")
    columns = {name: frame.iloc[:, k] for k, name in enumerate(names)}
    index = frame.index
    kind = getattr(index.dtype, "kind", "O")
    if kind in "mM" or (index.name is not None and str(index.name) not in columns):
        name = str(index.name) if index.name is not None else TIME
        return {name: index.to_series(), **columns}
    return columns


def _as_array(values: Any) -> np.ndarray:
    """Return an array_like or a column of a DataFrame, with instants in UTC and NaN if missing."""
    dtype = getattr(values, "dtype", None)
    if getattr(dtype, "tz", None) is not None:
        return values.dt.tz_convert(None).to_numpy()
    is_extension = dtype is not None and not isinstance(dtype, np.dtype)  # such as pandas.Int64
    if is_extension and getattr(dtype, "kind", "O") in "biuf":
        return values.to_numpy(dtype=float, na_value=np.nan)
    return values if isinstance(values, np.ma.MaskedArray) else np.asarray(values)
