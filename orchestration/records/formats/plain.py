"""Rows of nothing but numbers, read by pyarrow in one call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.records.formats.layout import SPACE


class NotPlain(UserError):
    """Rows that are more than numbers, or no pyarrow to read them: they are split into cells."""


def read_plain(parts: Sequence[bytes | memoryview], delimiter: str, width: int) -> list[Array]:
    """Return the columns of rows of numbers, rounded as :class:`float` rounds them.

    Parameters
    ----------
    parts : sequence of bytes or memoryview
        Lines, one part below the other.
    delimiter : str
        One character.
    width : int
        Number of columns.

    Returns
    -------
    list of ndarray, shape (n,)
        NaN where a cell is empty.

    Raises
    ------
    NotPlain
        If a row is empty or of another width, or a cell is anything but a finite number with a
        decimal point; or without pyarrow.
    """
    try:
        import pyarrow
        from pyarrow import csv
    except ModuleNotFoundError as error:
        raise NotPlain(str(error)) from error
    types = {str(k): pyarrow.float64() for k in range(width)}
    form = (
        csv.ReadOptions(column_names=list(types)),
        csv.ParseOptions(delimiter=delimiter, quote_char=False, ignore_empty_lines=False),
        csv.ConvertOptions(column_types=types, null_values=[""]),
    )
    try:
        tables = [csv.read_csv(pyarrow.BufferReader(part), *form) for part in parts if part]
        table = pyarrow.concat_tables(tables)
    except pyarrow.ArrowException as error:
        raise NotPlain(str(error)) from error
    columns = [column.to_numpy() for column in table.columns]
    empty = [column.null_count for column in table.columns]
    finite = [np.count_nonzero(np.isfinite(values)) for values in columns]
    if any(a + b < table.num_rows for a, b in zip(empty, finite, strict=True)):
        raise NotPlain("a number that is not finite")
    # spaces that follow each other are one delimiter
    if any(empty) and (delimiter == SPACE or np.isnan(columns).all(axis=0).any()):
        raise NotPlain("an empty row, or spaces that follow each other")
    return columns
