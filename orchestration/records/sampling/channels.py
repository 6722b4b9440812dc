"""Channels of a record: repair of missing values, notices of poor sensors, steps of inputs."""

from collections.abc import Collection

import numpy as np

from fmus.kit.arrays import Array, Mask, Signals
from orchestration.records.record import list_rows, refuse
from orchestration.records.sampling.clock import Samples, true_runs
from orchestration.reporting import option

HOLE_SAMPLES = 5
"""Longest hole in an input that is interpolated, in samples."""
_SLOW_SAMPLES = 2
"""Least number of equal steps between the values of a channel that is slower than others."""
CLIPPED_SHARE = 0.01
CLIPPED_RUN = 5
"""Least share of samples, and length of a run, at one extreme of a clipped channel."""
_QUANTISED_MINIMUM_SAMPLES = 50
_QUANTISED_SAMPLES_PER_LEVEL = 4
_STEP_RATIO = 4.0
_STEP_SHARE = 0.01
"""A step of an input is larger than this many median changes, and than this share of its range."""


def mask_infinite(samples: Samples) -> None:
    """Turn infinite values into missing ones, in place.

    Parameters
    ----------
    samples : Samples
        Their values change.
    """
    for name, values in samples.values.items():
        infinite = np.isinf(values)
        if infinite.any():
            rows = samples.rows[infinite].tolist()
            message = f"{name}: {len(rows)} infinite values treated as missing ({list_rows(rows)})"
            samples.note("infinite", message, rows)
            samples.values[name] = np.where(infinite, np.nan, values)


def repair_holes(samples: Samples, inputs: Collection[str], required: Collection[str]) -> None:
    """Fill short holes of inputs, refuse long ones, and report missing outputs, in place.

    A simulation needs every input at every instant, so short holes are interpolated. Missing
    samples of an output stay NaN and do not enter the residual.

    Parameters
    ----------
    samples : Samples
        The samples, strictly increasing in time.
    inputs : collection of str
        Inputs of the model.
    required : collection of str
        Signals that must have values.

    Raises
    ------
    UserError
        If a hole of an input is too long or at an end of the record, or a required signal has no
        value at all.
    """
    for name in list(samples.values):
        values = samples.values[name]
        missing = np.isnan(values)
        if missing.all():
            if name in required or name in inputs:
                raise refuse(
                    samples.path,
                    f"the signal '{name}' is required, and its column has no values (all are NaN)",
                )
            del samples.values[name]
            samples.note("empty column", f"{name}: the column has no values; treated as absent")
        elif missing.any() and name in inputs:
            samples.values[name] = _fill_input(samples, name, values, missing)
        elif missing.any():
            rows = samples.rows[missing].tolist()
            message = (
                f"{name}: {len(rows)} missing values, left out of every comparison"
                f" ({list_rows(rows)})"
            )
            samples.note("masked", message, rows)
    if not samples.values:
        raise refuse(samples.path, "no column of a signal has any value")


def _fill_input(samples: Samples, name: str, values: Array, missing: Mask) -> Array:
    """Return an input with its short holes interpolated linearly in time; raise for others."""
    if _is_slow(missing):
        return _held_input(samples, name, values, missing)
    for first, end in true_runs(missing):
        rows = samples.rows[first:end]
        span = f"row {rows[0]}" if end - first == 1 else f"rows {rows[0]} to {rows[-1]}"
        if first == 0 or end == values.size:
            at_start = first == 0
            cut = ("begin", samples.time[end]) if at_start else ("end", samples.time[first - 1])
            raise refuse(
                samples.path,
                f"the input '{name}' has no value in {span}, at the"
                f" {'start' if at_start else 'end'} of the record, where nothing can be"
                f" interpolated; cut these rows off: {option(cut[0], f'{cut[1]:.9g}s')}",
            )
        if end - first > HOLE_SAMPLES:
            raise refuse(
                samples.path,
                f"the input '{name}' has no value in {span}: {end - first} samples (interpolated"
                f" are at most {HOLE_SAMPLES}); fill them, or split the record there",
            )
    missing_rows = samples.rows[missing].tolist()
    message = (
        f"{name}: {len(missing_rows)} missing values of this input interpolated"
        f" ({list_rows(missing_rows)})"
    )
    samples.note("filled hole", message, missing_rows)
    filled = values.copy()
    filled[missing] = np.interp(samples.time[missing], samples.time[~missing], values[~missing])
    return filled


def _is_slow(missing: Mask) -> bool:
    """Return whether a channel begins with a value, and has one in every k-th row, k the same."""
    steps = np.diff(np.flatnonzero(~missing))
    return (
        not missing[0]
        and steps.size >= _SLOW_SAMPLES
        and bool((steps == steps[0]).all())
        and steps[0] > HOLE_SAMPLES + 1
        and missing.size - int(np.flatnonzero(~missing)[-1]) <= steps[0]
    )


def _held_input(samples: Samples, name: str, values: Array, missing: Mask) -> Array:
    """Return an input that is slower than others, held between its samples."""
    measured = np.flatnonzero(~missing)
    every = int(measured[1] - measured[0])
    message = f"{name}: a value every {every} rows, held between them ({measured.size} values)"
    samples.note("held", message, samples.rows[missing].tolist())
    return values[np.maximum.accumulate(np.where(missing, 0, np.arange(values.size)))]


def notice_channels(samples: Samples, units: dict[str, str], inputs: Collection[str] = ()) -> None:
    """Note channels that are constant, quantised or clipped, in place.

    Parameters
    ----------
    samples : Samples
        The repaired samples.
    units : dict of str to str
        Unit of every signal.
    inputs : collection of str
        Inputs of the model, which may have few levels and stay at their extremes by design.
    """
    for name, values in samples.values.items():
        valid = values[~np.isnan(values)]
        levels = np.unique(valid)
        unit = units[name]
        if levels.size == 1:
            message = (
                f"{name}: constant at {levels[0]:.6g} {unit} throughout (a dead channel, or kept"
                " constant)"
            )
            samples.note("constant", message)
            continue
        if name in inputs:
            continue
        _notice_quantised(samples, name, levels, valid.size, unit)
        _notice_clipped(samples, name, values, levels, unit)


def _notice_quantised(samples: Samples, name: str, levels: Array, count: int, unit: str) -> None:
    """Add a notice if a channel has few distinct values, with its least step."""
    if count < _QUANTISED_MINIMUM_SAMPLES or levels.size * _QUANTISED_SAMPLES_PER_LEVEL > count:
        return
    steps = np.diff(levels)
    # unit conversion can split one level into several that differ by a rounding error
    steps = steps[steps > 1e-9 * (levels[-1] - levels[0])]
    if not steps.size:  # the range overflowed
        return
    # rounding of decimals scatters the steps, so the mean of the smallest group is more accurate
    # than the minimum
    least = float(steps[steps < 1.5 * steps.min()].mean())
    message = (
        f"{name}: quantised, {steps.size + 1} distinct values in {count} samples, least step"
        f" {least:.4g} {unit}".removesuffix(" 1")
    )
    samples.note("quantised", message)


def _notice_clipped(samples: Samples, name: str, values: Array, levels: Array, unit: str) -> None:
    """Add a notice if a channel stays at exactly its greatest or least value."""
    for word, level in (("maximum", levels[-1]), ("minimum", levels[0])):
        at_level = values == level
        share = float(at_level.mean())
        if share < CLIPPED_SHARE:
            continue
        first, end = max(true_runs(at_level), key=lambda run: run[1] - run[0])
        length = end - first
        if length >= CLIPPED_RUN:
            message = (
                f"{name}: clipped (or constant) at its {word} {level:.6g} {unit}: {100 * share:.1f}"
                f" % of the samples, up to {length} in a row from row {samples.rows[first]}"
            )
            samples.note("clipped", message, samples.rows[at_level].tolist())


def input_steps(inputs: Signals, count: int) -> Mask:
    """Find steps of inputs: changes above 1 % of the range and four times the median change.

    Parameters
    ----------
    inputs : Mapping of str to ndarray, shape (n,)
    count : int
        Number of samples, n, for the result without inputs.

    Returns
    -------
    ndarray of bool, shape (n,)
        True at the first sample after a step of any input.
    """
    steps = [_steps(u) for u in inputs.values() if np.ptp(u) > 0.0]
    return np.any(steps, axis=0) if steps else np.zeros(count, dtype=bool)


def _steps(values: Array) -> Mask:
    """Return a mask of the steps of an input, see `input_steps`."""
    change = np.abs(np.diff(values, prepend=values[:1]))
    least = max(_STEP_SHARE * float(np.ptp(values)), _STEP_RATIO * float(np.median(change)))
    return change > least
