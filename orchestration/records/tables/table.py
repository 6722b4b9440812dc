"""The raw table every reader yields: named columns as the file has them, flaws and all."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit.arrays import Array
from orchestration.records.record import Repair, refuse

MISSING_CELLS = frozenset(
    {
        "",
        "nan",
        "+nan",
        "-nan",
        "na",
        "n/a",
        "#n/a",
        "null",
        "none",
        "1.#qnan",
        "-1.#qnan",
        "1.#ind",
        "-1.#ind",
    }
)
INFINITE_CELLS = {"1.#inf": np.inf, "-1.#inf": -np.inf}
_TRUTH_CELLS = {"true": 1.0, "false": 0.0}  # as tools for FMUs write them
_HEADER_CELL = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?$", re.DOTALL)
# of an element of an array, which belongs to its name: A[2,1]
INDEX = re.compile(r"(?<=\S)\[\d+(?:,\d+)*\]")
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?", re.IGNORECASE | re.ASCII
)


@dataclass
class Column:
    """One column as the file has it.

    Parameters
    ----------
    name : str
        Name without the unit.
    unit : str or None
        Unit in the file, None where the file gives none.
    cells : sequence of str or ndarray, shape (n,)
        Text cells are turned into numbers only when the column is used, so text in an unused column
        does no harm.
    title : str
        The whole header cell as the file has it.
    """

    name: str
    unit: str | None
    cells: Sequence[str] | Array
    title: str = ""


@dataclass
class Table:
    """All columns of a file.

    Parameters
    ----------
    path : Path
        The file.
    columns : list of Column
        In file order.
    rows : ndarray of int, shape (n,)
        The row number of every sample, as a message names it.
    repairs : list of Repair
        What reading the file already had to repair.
    """

    path: Path
    columns: list[Column]
    rows: NDArray[np.int64]
    repairs: list[Repair] = field(default_factory=list)

    def names(self) -> list[str]:
        """Give the column names in file order.

        Returns
        -------
        list of str
            Without units.
        """
        return [column.name for column in self.columns]

    def map_name(self, column: Column) -> str:
        """Return what ``--map`` calls a column: its name, or its whole header if names repeat."""
        return column.name if self.names().count(column.name) == 1 else column.title


Reader = Callable[[Path, bytes], Table]
"""Reads a file of one form: takes its path and its content, and returns its raw columns.

A file that cannot be used is refused with a `UserError`: file, row, reason. What could be repaired
is in the table.
"""


def split_header_cell(cell: str) -> tuple[str, str | None]:
    """Split a header cell ``name [unit]``.

    Parameters
    ----------
    cell : str
        The cell's text.

    Returns
    -------
    tuple of (str, str or None)
        Name, and unit or None where there is none.
    """
    match = _HEADER_CELL.match(cell.strip())
    if match is None:  # the pattern matches any text; this only satisfies the type checker
        return cell.strip(), None
    return match["name"].strip(), (match["unit"] or "").strip() or None


def parse_cell(cell: str) -> float | None:
    """Turn one text cell into a number.

    Parameters
    ----------
    cell : str
        The cell's text.

    Returns
    -------
    float or None
        NaN for a missing value, None for text that is no number.
    """
    text = cell.strip().lower()
    if text in MISSING_CELLS:
        return float("nan")
    if text in INFINITE_CELLS:
        return INFINITE_CELLS[text]
    if text in _TRUTH_CELLS:
        return _TRUTH_CELLS[text]
    return float(text) if _NUMBER.fullmatch(text) else None


def numbers(table: Table, column: Column) -> Array:
    """Give a column's values as numbers.

    Parameters
    ----------
    table : Table
        The table the column is from, for the message.
    column : Column
        The column.

    Returns
    -------
    ndarray, shape (n,)
        In the unit of the file; NaN where missing.

    Raises
    ------
    UserError
        If a cell is neither a number nor empty.
    """
    if isinstance(column.cells, np.ndarray):
        return np.array(column.cells, dtype=float)
    joined = "".join(column.cells)
    if (
        joined.isascii() and "_" not in joined
    ):  # float() would take 1_000 and non-Latin digits for numbers
        try:
            return np.array([float(cell) for cell in column.cells], dtype=float)
        except ValueError:
            pass
    values = np.empty(len(column.cells))
    for index, cell in enumerate(column.cells):
        value = parse_cell(cell)
        if value is None:
            raise refuse(
                table.path,
                f"row {table.rows[index]}, column '{column.name}': '{cell.strip()}' is not a number"
                " (allowed: a number, or an empty cell for a missing value)",
            )
        values[index] = value
    return values


def as_numbers(values: np.ndarray) -> np.ndarray | list[str]:
    """Turn an array of any type into floats, or into text cells if it holds no numbers.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Numbers, booleans, instants or objects.

    Returns
    -------
    ndarray or list of str
        Instants become seconds since the first one; objects become text, to be judged only if the
        column is used.
    """
    if values.dtype.kind == "M":
        known = values[~np.isnat(values)]
        first = known[0] if known.size else np.datetime64("NaT")
        return np.asarray((values - first) / np.timedelta64(1, "s"), dtype=float)
    if values.dtype.kind == "m":
        return np.asarray(values / np.timedelta64(1, "s"), dtype=float)
    if values.dtype.kind in "biuf":
        return values.astype(float)
    return ["" if value is None else str(value) for value in values]
