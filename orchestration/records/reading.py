"""From a file to a record: read, match, convert, repair, notice."""

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from fmus.kit import units
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from orchestration.records.elements import split_arrays
from orchestration.records.formats import read_table
from orchestration.records.frames import Arrays, table_of
from orchestration.records.mapping import TIME, Match, match_columns
from orchestration.records.record import Record, Repair, refuse
from orchestration.records.runs import divided_at_restarts, divided_by, run_marks
from orchestration.records.sampling import (
    Samples,
    mask_infinite,
    notice_channels,
    repair_clock,
    repair_holes,
)
from orchestration.records.tables import Table, numbers
from orchestration.records.times import FORMS, holds_instants, seconds
from orchestration.reporting import option


def read_record(
    path: str | Path | Arrays,
    signals: Mapping[str, str],
    *,
    mapping: Mapping[str, str] | None = None,
    required: Collection[str] = (),
    inputs: Collection[str] = (),
    jumps: bool = False,
) -> Record:
    """Read a measured record.

    Parameters
    ----------
    path : str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        CSV, Parquet, LabVIEW TDMS or text, or MATLAB file; its content decides which. Or the
        columns themselves, see `orchestration.records.frames.table_of`.
    signals : mapping of str to str
        The model's signals and the SI unit of each, as pint understands it: ``{"current": "A"}``.
    mapping : mapping of str to str, optional
        File column to signal, with the unit the column shall be read in if not the file's:
        ``{"strain": "displacement[m]"}``. The target ``time`` names the time column.
    required : collection of str
        Signals that must be there.
    inputs : collection of str
        Which signals drive the model: their short holes are interpolated and long ones refused. A
        hole in any other signal stays NaN.
    jumps : bool
        Whether rows of one time are a jump, as in prescribed inputs, of which the last counts; the
        mean is taken of values that were measured at one time.

    Returns
    -------
    Record
        In the units of `signals`, with strictly increasing time.

    Raises
    ------
    UserError
        If the file cannot be used: file, row, reason.
    """
    samples = _samples(_table(path, signals, required, inputs), signals, mapping or {}, required)
    return _record(samples, signals, required, inputs, jumps=jumps)


def read_columns(
    path: str | Path | Arrays, names: Collection[str], inputs: Collection[str] = ()
) -> Record:
    """Read columns under their own names and in their own units, where no model has any.

    Parameters
    ----------
    path : str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        See :func:`read_record`.
    names : collection of str
        Columns.
    inputs : collection of str
        Which of them drive, see :func:`read_record`.

    Raises
    ------
    UserError
        If the file cannot be used, or has no such column.
    """
    table = _read(path)
    units = {column.name: column.unit or "1" for column in table.columns if column.name in names}
    for name in names:
        if name not in units:
            known = table.names()
            raise UserError(
                f"{table.path}: no column {name!r}{suggestion(name, known, few=len(known))}"
            )
    return _record(_samples(table, units, {}, names), units, names, inputs)


def read_runs(
    path: str | Path | Arrays,
    signals: Mapping[str, str],
    *,
    mapping: Mapping[str, str] | None = None,
    required: Collection[str] = (),
    inputs: Collection[str] = (),
    column: str | None = None,
) -> list[Record]:
    """Read a file that may hold several runs, each a record of its own.

    Parameters
    ----------
    path, signals, mapping, required, inputs
        See :func:`read_record`.
    column : str, optional
        The column that tells the runs apart. Without it a new one begins where the clock restarts.

    Returns
    -------
    list of Record
        In the order of the file, with their labels; one without a label where there is one run.

    Raises
    ------
    UserError
        If the file or a run in it cannot be used.
    """
    table = _table(path, signals, required, inputs)
    marks = None
    if column is not None:
        marks = run_marks(table, column, mapping or {})
        table.columns = [c for c in table.columns if c.name != column]
    samples = _samples(table, signals, mapping or {}, required)
    parts = divided_at_restarts(samples) if marks is None else divided_by(samples, marks)
    return [_record(part, signals, required, inputs, label) for label, part in parts]


def _table(
    path: str | Path | Arrays,
    signals: Mapping[str, str],
    required: Collection[str],
    inputs: Collection[str],
) -> Table:
    for name in (*required, *inputs):
        if name not in signals:
            raise UserError(f"'{name}' is not a signal of the model; it has: {', '.join(signals)}")
    return split_arrays(_read(path), signals)


def _read(path: str | Path | Arrays) -> Table:
    return read_table(Path(path)) if isinstance(path, str | Path) else table_of(path)


def _samples(
    table: Table, signals: Mapping[str, str], mapping: Mapping[str, str], required: Collection[str]
) -> Samples:
    """Read the columns of the signals, as the file has them, in the model's units."""
    matches = match_columns(table, signals, mapping, required)
    values = {
        match.signal: time_in_seconds(table, match)
        if match.signal == TIME
        else _column_in_unit(table, match, signals[match.signal])
        for match in matches
    }
    return Samples(table.path, values.pop(TIME), values, table.rows, table.repairs)


def time_in_seconds(table: Table, match: Match) -> np.ndarray:
    """Give the time in seconds; dates and times of day count from the first row."""
    if not holds_instants(match.column):
        return _column_in_unit(table, match, "s")
    if match.unit is not None and match.unit not in FORMS:
        raise refuse(
            table.path,
            f"column '{match.column.name}' has dates or times of day, and no number in"
            f" {match.unit}: {option('mapping', {match.column.name: 'time'})} reads them; in"
            f" brackets only their form can stand, {', '.join(FORMS)}",
        )
    return seconds(table, match.column, match.unit or "")


def _record(
    samples: Samples,
    signals: Mapping[str, str],
    required: Collection[str],
    inputs: Collection[str],
    label: str = "",
    *,
    jumps: bool = False,
) -> Record:
    """Repair what can be repaired of one run, and refuse or notice what cannot."""
    # absurd values near the largest double overflow in differences; they are the file's, and no
    # reason for a traceback
    with np.errstate(over="ignore", invalid="ignore"):
        mask_infinite(samples)
        repair_clock(samples, jumps)
        repair_holes(samples, inputs, required)
        declared = {name: signals[name] for name in samples.values}
        notice_channels(samples, declared, inputs)
    return Record(samples.time, samples.values, declared, samples.path, samples.repairs, label)


def _column_in_unit(table: Table, match: Match, unit: str) -> np.ndarray:
    """Give a column's values in the model's unit."""
    column = match.column
    stated = match.unit or column.unit
    if stated is None:
        stated = unit
        message = (
            f"column '{column.name}' states no unit: taken as {unit}, the unit of {match.signal}"
        )
        table.repairs.append(Repair("unit assumed", message))
    elif match.unit is not None and column.unit is not None and match.unit != column.unit:
        message = (
            f"column '{column.name}' [{column.unit}] read as {match.signal} in {match.unit}, as"
            " asked"
        )
        table.repairs.append(Repair("unit replaced", message))
    return _convert(table.path, column.name, numbers(table, column), stated, unit, match.signal)


def _convert(
    path: Path, column: str, values: Array, unit: str, expected: str, signal: str
) -> Array:
    """Convert a column's values from the file's unit to the model's.

    Parameters
    ----------
    path : Path
        The file, for the message.
    column : str
        Column name in the file, for the message.
    values : ndarray, shape (n,)
        In `unit`.
    unit, expected : str
        Unit in the file, and unit of the result.
    signal : str
        The model's name of the signal, for the hint.

    Returns
    -------
    ndarray, shape (n,)
        In the unit `expected`.

    Raises
    ------
    UserError
        If the unit is not known or of another dimension.
    """
    try:
        units.check(unit)
    except UserError as error:
        raise refuse(
            path,
            f"column '{column}': {error}; if it is in {expected}:"
            f" {option('mapping', {column: f'{signal}[{expected}]'})}",
        ) from error
    if not units.measure_alike(unit, expected):
        raise refuse(
            path,
            f"column '{column}' is in {unit}, but {signal} is in {expected}, "
            f"and {unit} cannot be converted to {expected}; "
            "to read the numbers as another unit:"
            f" {option('mapping', {column: f'{signal}[{expected}]'})}",
        )
    return np.asarray(units.convert(values, unit, expected), dtype=float)
