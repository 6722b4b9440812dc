"""Raw table of a file, as every reader returns it: columns with name, unit and cells."""

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
_TRUTH_CELLS = {"true": 1.0, "false": 0.0}  # in results of FMU tools
_HEADER_CELL = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?$", re.DOTALL)
# index of an element of an array, a part of its name: A[2,1]
INDEX = re.compile(r"(?<=\S)\[\d+(?:,\d+)*\]")
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?", re.IGNORECASE | re.ASCII
)


@dataclass
class Column:
    """One column of a file, before any conversion.

    Parameters
    ----------
    name : str
        Name without the unit.
    unit : str or None
        Unit in the file; None without one.
    cells : sequence of str or ndarray, shape (n,)
        Text becomes numbers only when the column is used, so that text in an unused column does no
        harm.
    title : str
        The whole header cell.
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
        Row number of every sample, for messages.
    repairs : list of Repair
        Repairs so far.
    """

    path: Path
    columns: list[Column]
    rows: NDArray[np.int64]
    repairs: list[Repair] = field(default_factory=list)

    def names(self) -> list[str]:
        """Return the names of the columns in file order.

        Returns
        -------
        list of str
            Without units.
        """
        return [column.name for column in self.columns]

    def map_name(self, column: Column) -> str:
        """Return the name of a column for ``--map``: its header cell if its name is not unique."""
        return column.name if self.names().count(column.name) == 1 else column.title


Reader = Callable[[Path, bytes], Table]
"""Function of path and content of a file that returns its table.

It raises a `UserError` with file, row and reason for a file that cannot be used. Repairs are listed
in the table.
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
    assert match is not None  # the pattern matches any text
    return match["name"].strip(), (match["unit"] or "").strip() or None


def parse_cell(cell: str) -> float | None:
    """Return the number in a text cell.

    Parameters
    ----------
    cell : str
        The cell's text.

    Returns
    -------
    float or None
        NaN for a missing value; None for other text.
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
    """Return the values of a column as numbers.

    Parameters
    ----------
    table : Table
        Table of the column, for the message.
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
    # float() would also accept 1_000 and digits of other scripts
    if joined.isascii() and "_" not in joined:
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
    """Return an array of any type as floats, or as text cells if it has no numbers.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Numbers, booleans, instants or objects.

    Returns
    -------
    ndarray or list of str
        Instants become seconds since the first one, and objects become text, which is parsed when
        the column is used.
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
