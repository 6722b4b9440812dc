"""Input-output data read from the columns of a file or from arrays, at a fixed sample period."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fmus.kit.arrays import Array, Indices
from fmus.kit.errors import UserError, suggestion
from fmus.kit.units import convert
from orchestration.identify.black_box.data import InputOutputData, input_output_data
from orchestration.identify.black_box.outliers import find_outliers
from orchestration.records import Arrays, read_record
from orchestration.records.formats import read_table
from orchestration.records.sampling import UNEVEN, sample_period, true_runs
from orchestration.records.tables import Column, Table, numbers
from orchestration.records.times import find_time, holds_instants
from orchestration.reporting import option

# Outliers that are bad readings: so many, or that share of the samples, at most. More are a model
# that does not hold, or noise of another level.
_FEW = 10
_SHARE = 0.02
_LONGEST_GAP = 5  # samples of the output that are interpolated


@dataclass(frozen=True)
class Columns:
    """Input-output data with the units and repairs of the file that they are from.

    Attributes
    ----------
    path : Path
        The file, or the name of arrays in messages.
    data : InputOutputData
        In the units of the file.
    units : dict of str to str
        Units of inputs and output; ``"1"`` where the file has none.
    notes : tuple of str
        Repairs of the record, a line each.
    """

    path: Path
    data: InputOutputData
    units: dict[str, str]
    notes: tuple[str, ...]


def read_columns(
    data: Path | Arrays, output: str, inputs: Sequence[str] = (), step: float | None = None
) -> Columns:
    """Read the input-output data of a black-box model from a file or arrays.

    Parameters
    ----------
    data : Path, DataFrame or Mapping of str to array_like, shape (n,)
        CSV, Parquet, TDMS, MAT or LabVIEW text, or columns by name; the first column is the time,
        or counts samples if a step is given.
    output : str
        Column of the output.
    inputs : sequence of str, optional
        Columns of the inputs; default all but the first and the output.
    step : float, optional
        Sample period in s, of a file that has no time but counts its samples.

    Returns
    -------
    Columns

    Raises
    ------
    UserError
        If the file is refused, has no such column, its samples are not equally spaced, or it has a
        time and a step is given.
    """
    table = read_table(data)
    chosen = _input_columns(table, output, inputs, _non_inputs(table, output, inputs, step))
    used = (output, *chosen)
    units = {column.name: column.unit or "1" for column in table.columns if column.name in used}
    if step is None:
        record = read_record(data, units, required=list(units), inputs=chosen)
        period = sample_period(table.path, record.time, "a black-box model")
        values = record.signals
        notes = tuple(repair.message for repair in record.repairs)
    else:
        _check_count(table, units)
        period = step
        values = {c.name: numbers(table, c) for c in table.columns if c.name in units}
        notes = ()
    stacked = np.column_stack([values[name] for name in chosen])
    measured = values[output]
    missing = _short_gaps(measured)
    if missing.size:
        known = np.flatnonzero(np.isfinite(measured))
        measured = measured.copy()
        measured[missing] = np.interp(missing, known, measured[known])
        text = f"{output}, {_describe_samples(missing)} (the first is 0): missing; interpolated"
        notes = (*notes, text)
    sampled = input_output_data(stacked, measured, period, chosen, output)
    return Columns(table.path, sampled, units, notes)


def _short_gaps(values: Array) -> Indices:
    """Return the samples that are missing, in gaps that are short."""
    gaps = true_runs(np.isnan(values))
    short = [np.arange(*gap) for gap in gaps if gap[1] - gap[0] <= _LONGEST_GAP]
    return np.concatenate([np.empty(0, dtype=int), *short])


def without_outliers(columns: Columns) -> Columns:
    """Replace bad readings of the output by what is expected there, with a note.

    Where there are too many, they are no bad readings but what a linear model does not say: the
    output stays as it is, with a note.
    """
    data = columns.data
    bad, expected = find_outliers(data)
    if not bad.size:
        return columns
    samples = f"{data.output_name}, {_describe_samples(bad)} (the first is 0)"
    far = "far from what the inputs and the samples around say"
    if bad.size > max(_FEW, _SHARE * len(data)):
        note = (
            f"{data.output_name}: {bad.size} of {len(data)} samples are {far}: kept, as bad"
            " readings are few"
        )
        return replace(columns, notes=(*columns.notes, note))
    note = f"{samples}: {far}; left out as bad readings"
    return replace(columns, data=replace(data, output=expected), notes=(*columns.notes, note))


def _describe_samples(samples: Indices) -> str:
    """Return samples as text: ``sample 12, 40 to 43``."""
    runs = np.split(samples, np.flatnonzero(np.diff(samples) > 1) + 1)
    texts = [f"{run[0]} to {run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    return f"sample{'s' if samples.size > 1 else ''} {', '.join(texts)}"


def _non_inputs(table: Table, output: str, inputs: Sequence[str], step: float | None) -> list[str]:
    """Return the columns that are not inputs by default: the time, or a count, and dates."""
    first = table.columns[0]
    if step is not None:
        return [first.name]
    unused = [column for column in table.columns if column.name not in (output, *inputs)]
    try:
        time = find_time(table, (), unused)
    except UserError:
        raise UserError(
            f"{table.path}: no column is a time, and the first, {first.name!r}, is in"
            f" {first.unit or 'no unit'}; give the sample period, {option('step')}"
        ) from None
    return [time.name, *(column.name for column in unused if holds_instants(column))]


def _input_columns(
    table: Table, output: str, inputs: Sequence[str], others: Sequence[str]
) -> list[str]:
    """Return the names of the columns that are inputs; refuse names that no column has."""
    known = table.names()
    chosen = list(inputs) or [name for name in known if name not in (output, *others)]
    for name in (output, *chosen):
        if name not in known:
            raise UserError(
                f"{table.path}: no column {name!r}{suggestion(name, known, few=len(known))}"
            )
    if not chosen:
        raise UserError(
            f"{table.path}: no column is left for an input beside {output} and the first one"
        )
    return chosen


def _check_count(table: Table, used: Container[str]) -> None:
    """Refuse a step for a file that has a time, or whose first column does not count samples.

    A first column that is an input or the output is neither time nor count.
    """
    first = table.columns[0]
    if first.name in used:
        return
    if _is_time(first):
        raise UserError(
            f"{table.path}: the first column, {first.name!r}, is a time in {first.unit};"
            f" {option('step')} is for a file without"
        )
    count = numbers(table, first)
    # written as a negation, so that NaN, a gap, counts as a step that is off
    uneven = np.flatnonzero(~(np.abs(np.diff(count) - 1.0) <= UNEVEN))
    if uneven.size:
        one = count[uneven[0]]
        next_one = count[uneven[0] + 1]
        raise UserError(
            f"{table.path}: the first column, {first.name!r}, goes from {one:g} to {next_one:g};"
            f" {option('step')} is for a file whose first column counts samples by ones"
        )


def _is_time(column: Column) -> bool:
    """Return whether a column has a unit of time."""
    try:
        convert(1.0, column.unit or "1", "s")
    except UserError:
        return False
    return True
