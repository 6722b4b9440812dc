"""Reading of records: columns are matched to signals, converted, repaired and checked."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from fmus.kit import units
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from orchestration.records.elements import split_arrays
from orchestration.records.mapping import Match, match_columns, split_at_names
from orchestration.records.record import Record, refuse
from orchestration.records.runs import divide_at_restarts, divide_by_label, run_labels
from orchestration.records.sampling import (
    Samples,
    keep_span,
    mask_infinite,
    notice_channels,
    repair_clock,
    repair_holes,
)
from orchestration.records.selection import open_table
from orchestration.records.source import Readable, Reading, Source
from orchestration.records.tables import (
    Table,
    numbers,
    read_words,
    split_header_cell,
    unit_in_name,
)
from orchestration.records.times import (
    FORMS,
    TIME,
    find_time,
    holds_instants,
    is_form,
    require_resolution,
    require_unit,
    seconds,
    without_rounding,
)
from orchestration.reporting import option

_NONE: Mapping[str, Any] = MappingProxyType({})


def read_record(
    path: Readable,
    signals: Mapping[str, str],
    *,
    mapping: Mapping[str, str] | None = None,
    required: Collection[str] = (),
    inputs: Collection[str] = (),
    others: Mapping[str, str] = _NONE,
    words: Mapping[str, dict[str, float]] = _NONE,
    jumps: bool = False,
) -> Record:
    """Read a measured record.

    Parameters
    ----------
    path : str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        CSV, Parquet, LabVIEW TDMS or text, or MATLAB file, recognised by its content; or the
        columns themselves, see `orchestration.records.frames.table_of`.
    signals : mapping of str to str
        The model's signals and the SI unit of each, as pint understands it: ``{"current": "A"}``;
        an empty unit is that of the column.
    mapping : mapping of str to str, optional
        Signal by file column, with a unit that replaces the one in the file if given:
        ``{"strain": "displacement[m]"}``. The signal ``time`` names the time column.
    required : collection of str
        Signals that must be in the file.
    inputs : collection of str
        Inputs of the model: their short holes are interpolated and long ones refused. Holes in
        other signals stay NaN.
    others : mapping of str to str
        Further signals, with their units, for columns of exactly their names.
    words : mapping of str to dict of str to float
        By signal, numbers for cells that are words; `Words` has one for any text.
    jumps : bool
        True if rows of equal time are a jump, as in prescribed inputs: the last one is used. False
        if they are repeated measurements: their mean is used.

    Returns
    -------
    Record
        In the units of `signals`, with strictly increasing time.

    Raises
    ------
    UserError
        If the file cannot be used; the message has file, row and reason.
    """
    source = Source.of(path)
    table = _checked_table(source, signals, required, inputs, words)
    signals = {**signals, **_named_in(table, others, mapping or {})}
    samples = _unrepaired_samples(table, signals, mapping or {}, required, source.reading, words)
    return _repaired_record(samples, signals, required, inputs, source.reading, jumps=jumps)


def read_columns(path: Readable, names: Collection[str], inputs: Collection[str] = ()) -> Record:
    """Read columns of a file without a model, by their names and in their units.

    Parameters
    ----------
    path : str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        See :func:`read_record`.
    names : collection of str
        Names of the columns.
    inputs : collection of str
        Inputs among them, see :func:`read_record`.

    Returns
    -------
    Record

    Raises
    ------
    UserError
        If the file cannot be used, or has no such column.
    """
    source = Source.of(path)
    table = open_table(source)
    units = {column.name: column.unit or "1" for column in table.columns if column.name in names}
    for name in names:
        if name not in units:
            known = table.names()
            raise UserError(
                f"{table.path}: no column {name!r}{suggestion(name, known, few=len(known))}"
            )
    samples = _unrepaired_samples(table, units, {}, names, source.reading)
    return _repaired_record(samples, units, names, inputs, source.reading)


def read_samples(path: Readable) -> Record:
    """Read all columns of numbers as they stand in a file: nothing is sorted, filled or left out.

    Parameters
    ----------
    path : str, Path, DataFrame or Mapping of str to array_like, shape (n,)
        See :func:`read_record`.

    Returns
    -------
    Record
        In the units of the file, which are empty where it states none. Columns with words are noted
        and left out.

    Raises
    ------
    UserError
        If the file cannot be read or has no time.
    """
    source = Source.of(path)
    table = open_table(source)
    clock = find_time(table, (), table.columns)
    time = time_in_seconds(table, Match(clock, TIME, None))
    values = {}
    for column in table.columns:
        if column is clock:
            continue
        try:
            values[column.name] = numbers(table, column)
        except UserError as error:
            table.note("words", f"left out: {str(error).removeprefix(f'{table.path}: ')}")
    stated = {column.name: column.unit or "" for column in table.columns}
    without = [name for name in values if not stated[name]]
    if without:
        table.note("no unit", f"no unit is stated for {', '.join(without)}")
    return Record(time, values, stated, table.path, table.repairs)


def read_runs(
    path: Readable,
    signals: Mapping[str, str],
    *,
    mapping: Mapping[str, str] | None = None,
    inputs: Collection[str] = (),
    column: str | None = None,
    others: Mapping[str, str] = _NONE,
    words: Mapping[str, dict[str, float]] = _NONE,
) -> list[Record]:
    """Read a file of one or several runs, each of which becomes a record.

    Parameters
    ----------
    path, signals, mapping, inputs, others, words
        See :func:`read_record`.
    column : str, optional
        Column with the label of the run. Without it a run begins where the clock restarts.

    Returns
    -------
    list of Record
        In the order of the file, with their labels; a single run has none.

    Raises
    ------
    UserError
        If the file or a run in it cannot be used.
    """
    source = Source.of(path)
    table = _checked_table(source, signals, (), inputs, words)
    signals = {**signals, **_named_in(table, others, mapping or {})}
    labels = None
    if column is not None:
        labels = run_labels(table, column, mapping or {})
        table.columns = [c for c in table.columns if c.name != column]
    samples = _unrepaired_samples(table, signals, mapping or {}, (), source.reading, words)
    runs = divide_at_restarts(samples) if labels is None else divide_by_label(samples, labels)
    return [
        _repaired_record(run, signals, (), inputs, source.reading, label) for label, run in runs
    ]


def _checked_table(
    source: Source,
    signals: Mapping[str, str],
    required: Collection[str],
    inputs: Collection[str],
    words: Collection[str],
) -> Table:
    """Return the table of a file; raise if `required` or `inputs` are not signals of the model."""
    for name in (*required, *inputs):
        if name not in signals:
            raise UserError(f"'{name}' is not a signal of the model; it has: {', '.join(signals)}")
    reading = replace(source.reading, texts=source.reading.texts or bool(words))
    return split_arrays(open_table(replace(source, reading=reading)), signals)


def _named_in(
    table: Table, signals: Mapping[str, str], mapping: Mapping[str, str]
) -> dict[str, str]:
    """Return those signals that a column has the name of, or that a column is mapped to."""
    named = {name for column in table.columns for name in (column.name, column.title)}
    targets = [split_at_names(table, signals, *entry)[1] for entry in mapping.items()]
    named |= {*targets, *(split_header_cell(target)[0] for target in targets)}
    return {name: signals[name] for name in named if name in signals}


def _unrepaired_samples(
    table: Table,
    signals: Mapping[str, str],
    mapping: Mapping[str, str],
    required: Collection[str],
    reading: Reading,
    words: Mapping[str, dict[str, float]] = _NONE,
) -> Samples:
    """Return the samples of the matched signals in the units of the model, before any repair."""
    matches = match_columns(table, signals, mapping, required)
    clock, *others = matches
    time = time_in_seconds(table, clock, reading.discard)
    values = {}
    for match in others:
        in_words = words.get(match.signal)
        values[match.signal] = (
            _column_in_unit(table, match, signals[match.signal])
            if in_words is None
            else read_words(table, match.column, in_words)
        )
    scales = {m.signal: m.unit or m.column.unit for m in others if signals[m.signal] == "K"}
    stated = {name: unit for name, unit in scales.items() if unit}
    return Samples(table.path, time, values, table.rows, table.repairs, stated)


def time_in_seconds(table: Table, match: Match, discard: float = 0.0) -> np.ndarray:
    """Return the time in seconds; dates and times of day are counted from the first row.

    Stamps may be coarser than the rows if their rows may be averaged, at most `discard` percent.
    """
    column = match.column
    if not holds_instants(column):
        if match.unit is None and column.unit in (None, "s"):
            require_unit(table, column, numbers(table, column))
        time = _column_in_unit(table, match, "s")
        return without_rounding(table, column, numbers(table, column), time)
    if match.unit is not None and not is_form(match.unit):
        raise refuse(
            table.path,
            f"column '{column.name}' has dates or times of day, not numbers in"
            f" {match.unit}: {option('mapping', {column.name: 'time'})} reads them"
            f" (allowed in brackets: {', '.join(FORMS)}, a zone such as Europe/Berlin)",
        )
    time = seconds(table, column, match.unit or "")
    require_resolution(table, column, time, discard)
    return time


def _repaired_record(
    samples: Samples,
    signals: Mapping[str, str],
    required: Collection[str],
    inputs: Collection[str],
    reading: Reading,
    label: str = "",
    *,
    jumps: bool = False,
) -> Record:
    """Repair the samples of one run, and return its record with a list of the repairs."""
    # differences of values near the largest double overflow, which is no reason for a traceback
    with np.errstate(over="ignore", invalid="ignore"):
        keep_span(samples, reading.begin, reading.end)
        mask_infinite(samples)
        repair_clock(samples, reading.discard, jumps)
        repair_holes(samples, inputs, required)
        signal_units = {name: signals[name] or "1" for name in samples.values}
        notice_channels(samples, signal_units, inputs)
    return Record(
        samples.time,
        samples.values,
        signal_units,
        samples.path,
        samples.repairs,
        label,
        samples.scales,
    )


def _column_in_unit(table: Table, match: Match, unit: str) -> np.ndarray:
    """Return the values of a column in a unit; without a unit in the file this one is assumed."""
    column = match.column
    stated = match.unit or column.unit
    if not unit:
        if stated not in (None, "1"):
            message = (
                f"column '{column.name}' is taken in {stated}, as the model declares no unit of"
                f" {match.signal}"
            )
            table.note("unit assumed", message)
        return numbers(table, column)
    if stated is None:
        _refuse_other_unit_in_name(table, match, unit)
        stated = unit
        message = (
            f"column '{column.name}' states no unit: taken as {unit}, the unit of {match.signal}"
        )
        table.note("unit assumed", message)
    elif match.unit is not None and column.unit is not None and match.unit != column.unit:
        message = (
            f"column '{column.name}' [{column.unit}] read as {match.signal} in {match.unit}, as"
            " stated"
        )
        table.note("unit replaced", message)
    return _convert(table.path, column.name, numbers(table, column), stated, unit, match.signal)


def _refuse_other_unit_in_name(table: Table, match: Match, unit: str) -> None:
    """Raise if a name without a unit ends in another unit of the same quantity, such as I_mA."""
    name = match.column.name
    guess = unit_in_name(name)
    try:
        is_other = bool(guess) and units.convert(1.0, guess, unit) != 1.0
    except UserError:
        return
    if is_other:
        likely, plain = (option("mapping", {name: f"{match.signal}[{u}]"}) for u in (guess, unit))
        raise refuse(
            table.path,
            f"column '{name}' states no unit, and its name ends in {guess}: {likely} or {plain}",
        )


def _convert(
    path: Path, column: str, values: Array, unit: str, expected: str, signal: str
) -> Array:
    """Convert the values of a column from the unit in the file to that of the model.

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
    if unit == expected:  # of an FMU, which may be in a unit that nobody else knows
        return values
    try:
        units.check(unit)
        if expected.startswith("delta_"):
            unit = units.difference_unit(unit)
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
