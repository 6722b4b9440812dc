"""Raw table of a file, as every reader returns it: columns with name, unit and cells."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.arrays import Array, Indices, Mask
from fmus.kit.errors import UserError
from orchestration.records.record import Repair, Repaired, list_rows, refuse
from orchestration.records.tables.header import plain_unit, read_header_cell

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
INFINITE_CELLS = {
    "1.#inf": np.inf,
    "-1.#inf": -np.inf,
    "∞": np.inf,
    "+∞": np.inf,
    "-∞": -np.inf,
    "\u2212∞": -np.inf,
}
_NO_VALUE_CELLS = frozenset(
    {
        *("-", "--", "---", "----", "-----", "*", "**", "***", "****", "*****", "?", "??", "???"),
        *("ol", "+ol", "-ol", "o.l", "o.l.", "o l", "over", "+over", "-over", "ovld", "ovl"),
        *("overload", "overrange", "over range", "over-range", "overflow", "ovrflw", "ovrng"),
        *("under", "underrange", "underflow", "range", "out of range", "saturated", "clipped"),
        *("error", "err", "fault", "invalid", "inval", "bad", "bad input", "no data", "nodata"),
        *("#####", "#value!", "#div/0!", "#num!", "#ref!", "#name?", "#null!", "#nv", "#wert!"),
        *("missing", "nil", "n.a.", "n.d.", "nc", "no sensor", "sensor break", "timeout"),
        *("nan(ind)", "-nan(ind)", "1.#io", "-1.#io", "#n/v", "undef", "undefined", "unknown"),
    }
)
"""Texts of instruments and spreadsheets where there is no value."""
_NO_NUMBERS = (9.9e37, 9.91e37, 9.96920997e36)
"""Numbers for overrange and no number of SCPI 1999 (7.2.1.4), and of a missing value in NetCDF."""
_MARKS = tuple(
    sign * mark for mark in (999.0, 999.25, 9999.0, 99999.0, 999999.0) for sign in (-1.0, 1.0)
)
"""Numbers that mark a missing value in a column that holds nothing else like them."""
_ALONE = 2.0
"""Least distance of such a mark from all other values, in ranges of these."""
_FEWEST = 8
"""Least number of other values."""
_TRUTH_CELLS = {"true": 1.0, "false": 0.0}  # in results of FMU tools
_HEADER_CELL = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?$", re.DOTALL)
# index of an element of an array, a part of its name: A[2,1]
INDEX = re.compile(r"(?<=\S)\[\d+(?:,\d+)*\]")
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|[+-]?inf(inity)?", re.IGNORECASE | re.ASCII
)

_FORTRAN = re.compile(r"(?<=[\d.])d(?=[+-]?\d)")  # exponent of double precision: 1.0D+00


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

    @classmethod
    def read(cls, title: str, cells: Sequence[str] | np.ndarray, stated: str = "") -> Column:
        """Return the column below a header cell, in its unit or the one stated elsewhere.

        Parameters
        ----------
        title : str
            See `read_header_cell`.
        cells : sequence of str or ndarray, shape (n,)
            An array may be of any type, see `as_numbers`.
        stated : str
            Unit that the file states beside the header; empty without one.

        Returns
        -------
        Column
            Instants are in seconds.
        """
        name, unit = read_header_cell(title)
        if not isinstance(cells, np.ndarray):
            return cls(name, unit or plain_unit(stated), cells, title)
        unit = "s" if cells.dtype.kind in "mM" else unit or plain_unit(stated)
        return cls(name, unit, as_numbers(cells), title)

    @property
    def is_time(self) -> bool:
        """True if it has the usual name of a time."""
        return self.name.casefold() in ("time", "t")


@dataclass
class Table(Repaired):
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

    @classmethod
    def of(cls, path: Path, columns: list[Column], nothing: str = "there are no rows") -> Table:
        """Return a table of columns whose rows are numbered from 1.

        Raises
        ------
        UserError
            If lengths differ from that of the time, or there are no rows: the message is `nothing`.
        """
        reference = next((column for column in columns if column.is_time), None)
        first = reference or next(iter(columns), None)
        if first is None or not len(first.cells):
            raise refuse(path, nothing)
        for column in columns:
            if len(column.cells) != len(first.cells):
                raise refuse(
                    path,
                    f"'{column.title or column.name}' has {len(column.cells)} values,"
                    f" '{first.title or first.name}' has {len(first.cells)}; columns of one record"
                    " have equal length",
                )
        return cls(path, columns, np.arange(1, len(first.cells) + 1))

    def names(self) -> list[str]:
        """Return the names of the columns in file order.

        Returns
        -------
        list of str
            Without units.
        """
        return [column.name for column in self.columns]

    def keep(self, mask: Mask) -> Table:
        """Return a table of the rows (n,) for which a mask is true."""
        chosen = np.flatnonzero(mask).tolist()
        columns = [
            replace(
                column,
                cells=column.cells[chosen]
                if isinstance(column.cells, np.ndarray)
                else [column.cells[k] for k in chosen],
            )
            for column in self.columns
        ]
        return replace(self, columns=columns, rows=self.rows[chosen])

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


def is_no_value(cell: str) -> bool:
    """Return whether an instrument or a spreadsheet writes a text where there is no value."""
    text = cell.strip().lower()
    return bool(text) and (text in MISSING_CELLS or text in _NO_VALUE_CELLS)


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
    if text in MISSING_CELLS or text in _NO_VALUE_CELLS:
        return float("nan")
    if text in INFINITE_CELLS:
        return INFINITE_CELLS[text]
    if text in _TRUTH_CELLS:
        return _TRUTH_CELLS[text]
    plain = _FORTRAN.sub("e", text.replace("\u2212", "-"))
    return float(plain) if _NUMBER.fullmatch(plain) else None


def numbers(table: Table, column: Column) -> Array:
    """Return the values of a column as numbers.

    What instruments write for no value is missing: texts such as ``OVERLOAD``, 9.91E37 of SCPI, and
    -9999 where a column holds nothing else like it.

    Parameters
    ----------
    table : Table
        Table of the column; a repair is added for such values.
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
        return _without_marks(table, column, np.array(column.cells, dtype=float))
    joined = "".join(column.cells)
    # float() would also accept 1_000 and digits of other scripts
    if joined.isascii() and "_" not in joined:
        try:
            values = np.array([float(cell) for cell in column.cells], dtype=float)
        except ValueError:
            pass
        else:
            return _without_marks(table, column, values)
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
    texts = [
        index
        for index in np.flatnonzero(np.isnan(values)).tolist()
        if column.cells[index].strip().lower() in _NO_VALUE_CELLS
    ]
    if texts:
        _report_no_values(table, column, f"'{column.cells[texts[0]].strip()}'", np.array(texts))
    return _without_marks(table, column, values)


class Words(dict[str, float]):
    """Numbers that stand for texts, each of which gets the next one when it is first met."""

    def __missing__(self, text: str) -> float:
        self[text] = float(len(self))
        return self[text]

    def texts(self, numbers: Array) -> NDArray[np.str_]:
        """Return the texts (n,) that numbers (n,) stand for."""
        return np.array([*self], dtype=str)[numbers.astype(int)]


def read_words(table: Table, column: Column, known: dict[str, float]) -> Array:
    """Return the numbers (n,) that the cells of a column stand for.

    Parameters
    ----------
    table, column
        See `numbers`.
    known : dict of str to float
        Numbers by word, such as those of the items of an enumeration. Cells that are no word of it
        must be one of its numbers, unless it is one of `Words`.

    Raises
    ------
    UserError
        If a cell is neither.
    """
    texts = [str(cell).strip() for cell in column.cells]
    if isinstance(known, Words):
        return np.array([known[text] for text in texts])
    strange = {text for text in {*texts} - {*known} if parse_cell(text) is None}
    if strange:
        raise _no_item(table, column, [text in strange for text in texts].index(True), known)
    cells = [repr(known[text]) if text in known else text for text in texts]
    values = numbers(table, replace(column, cells=cells))
    is_item = np.isin(values, [*known.values()])
    if not np.all(is_item | np.isnan(values)):
        raise _no_item(table, column, int(np.argmin(is_item | np.isnan(values))), known)
    return values


def _no_item(table: Table, column: Column, index: int, known: Mapping[str, float]) -> UserError:
    """Return the error of a cell that is no item of an enumeration."""
    items = ", ".join(f"{name} ({number:g})" for name, number in known.items())
    return refuse(
        table.path,
        f"row {table.rows[index]}, column '{column.name}': '{str(column.cells[index]).strip()}' is"
        f" none of {items}",
    )


def _without_marks(table: Table, column: Column, values: Array) -> Array:
    """Return values (n,) with NaN for numbers that mark a missing one."""
    finite = np.isfinite(values)
    known = values if finite.all() else values[finite]
    if not known.size:
        return values
    extremes = {float(known.min()), float(known.max())}
    for number in _NO_NUMBERS:
        if any(np.isclose(abs(x), number, rtol=1e-6, atol=0.0) for x in extremes):
            found = np.isclose(np.abs(values), number, rtol=1e-6, atol=0.0)
            values = _masked(table, column, values, found)
    for mark in extremes.intersection(_MARKS):
        others = known[known != mark]
        levels = np.unique(others).size
        if others.size < _FEWEST or levels < (1 if mark < 0.0 else 3):  # a pulse may be 999 high
            continue
        low = float(others.min())
        high = float(others.max())
        if max(low - mark, mark - high) > _ALONE * (high - low):
            values = _masked(table, column, values, values == mark)
    return values


def _masked(table: Table, column: Column, values: Array, found: Mask) -> Array:
    """Return values (n,) with NaN where they mark a missing one, and add that to the repairs."""
    indices = np.flatnonzero(found)
    if not indices.size:
        return values
    _report_no_values(table, column, f"{values[indices[0]]:g}", indices)
    return np.where(found, np.nan, values)


def _report_no_values(table: Table, column: Column, mark: str, indices: Indices) -> None:
    """Add a repair for cells that hold no value, once for each column."""
    rows = table.rows[indices].tolist()
    message = (
        f"column '{column.name}': {mark} is no measurement: {len(rows)} values treated as missing"
        f" ({list_rows(rows)})"
    )
    repair = Repair("no value", message, tuple(rows))
    if repair not in table.repairs:
        table.repairs.append(repair)


def as_numbers(values: np.ndarray | np.ma.MaskedArray[Any, Any]) -> np.ndarray | list[str]:
    """Return an array of any type as floats, or as text cells if it has no numbers.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Numbers, booleans, instants or objects; masked values are missing.

    Returns
    -------
    ndarray or list of str
        Instants become seconds since the first one, and objects become text, which is parsed when
        the column is used.
    """
    if isinstance(values, np.ma.MaskedArray):
        fill = {"M": np.datetime64("NaT"), "m": np.timedelta64("NaT"), "O": None}
        kind = values.dtype.kind
        whole: Any = values if kind in fill else values.astype(float)
        values = whole.filled(fill.get(kind, np.nan))
    if values.dtype.kind == "M":
        known = values[~np.isnat(values)]
        first = known[0] if known.size else np.datetime64("NaT")
        return (values - first) / np.timedelta64(1, "s")
    if values.dtype.kind == "m":
        return values / np.timedelta64(1, "s")
    if values.dtype.kind in "biuf":
        return values.astype(float, copy=False)
    return ["" if value is None else str(value) for value in values]
