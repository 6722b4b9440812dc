"""Clock of a record: repair of missing, unordered and repeated times, restarts, and gaps."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit import UserError
from fmus.kit.arrays import Array, Indices, Mask
from orchestration.records.record import Repair, Repaired, list_rows, refuse, refuse_loss
from orchestration.reporting import option

LATE_RUN_ROWS = 5
"""Most consecutive late rows that are sorted; more mean a clock that was set back."""
RESTART_AFTER_ROWS = 20
"""Least rows before a jump back to the start of the clock that counts as a restart."""
GAP_FACTOR = 10.0
"""Least length of a gap, in median steps."""
JITTER = 0.55
"""Largest coefficient of variation of the steps of an even clock."""
RATE_SAMPLES = 16
"""Number of steps over which the jitter of a clock averages out."""
UNEVEN = 0.01
"""Largest deviation of a step where equal steps are needed, as a share of the sample period."""


@dataclass
class Samples(Repaired):
    """Time, values and row numbers of a record during its repair.

    Parameters
    ----------
    path : Path
        The file, for messages.
    time : ndarray, shape (n,)
        Seconds.
    values : dict of str to ndarray, shape (n,)
        Values by signal.
    rows : ndarray of int, shape (n,)
        Row number of every sample in the file.
    repairs : list of Repair
        Repairs so far.
    scales : dict of str to str
        See `Record.scales`.
    """

    path: Path
    time: Array
    values: dict[str, Array]
    rows: NDArray[np.int64]
    repairs: list[Repair]
    scales: dict[str, str] = field(default_factory=dict)

    def keep(self, selection: Mask | NDArray[np.int64]) -> None:
        """Keep a selection of the samples, in its order.

        Parameters
        ----------
        selection : ndarray of bool, shape (n,), or ndarray of int
            A mask, or indices.
        """
        self.time = self.time[selection]
        self.rows = self.rows[selection]
        self.values = {name: values[selection] for name, values in self.values.items()}


def keep_span(samples: Samples, begin: float | None, end: float | None) -> None:
    """Keep the samples between two times in s, in place; None for no limit.

    A limit that leaves nothing out is noted, as the clock may not begin at 0.

    Raises
    ------
    UserError
        If there are none.
    """
    if begin is None and end is None:
        return
    time = samples.time
    low = -np.inf if begin is None else begin
    high = np.inf if end is None else end
    inside = (time >= low) & (time <= high)
    if not inside.any():
        known = time[np.isfinite(time)]
        span = f"{known.min():g} s to {known.max():g} s" if known.size else "no time"
        raise refuse(samples.path, f"no row is between {low:g} s and {high:g} s: it has {span}")
    first, last = np.nanmin(time), np.nanmax(time)
    for name, limit in (("begin", low), ("end", high)):
        if np.isfinite(limit) and not first <= limit <= last:
            stated = option(name, f"{limit:g}s")
            samples.note("span", f"{stated} leaves nothing out of {first:g} s to {last:g} s")
    samples.keep(inside)


def repair_clock(samples: Samples, discard: float = 1.0, jumps: bool = False) -> None:
    """Make the time strictly increasing, in place.

    Parameters
    ----------
    samples : Samples
        The samples as the file has them.
    discard : float
        Largest share of the rows that may be dropped, in percent.
    jumps : bool
        True if values jump between rows of equal time; else these are averaged.

    Raises
    ------
    UserError
        If the clock restarts or is set back, too many rows have no time, or fewer than two samples
        remain.
    """
    _drop_missing_time(samples, discard)
    _require_two(samples)
    _sort_late_rows(samples)
    if jumps:
        _keep_ends_of_jumps(samples)
    else:
        _average_duplicates(samples)
    _require_two(samples)
    _notice_gaps(samples)


def _require_two(samples: Samples) -> None:
    """Raise if a record has fewer than two instants."""
    if samples.time.size < 2:
        content = (
            f"only one instant ({list_rows(samples.rows.tolist())})"
            if samples.time.size
            else "no row with a valid time"
        )
        raise refuse(samples.path, f"{content}; a record needs at least two different times")


def _drop_missing_time(samples: Samples, discard: float) -> None:
    """Drop the rows whose time is missing or infinite, in place; raise if they are too many."""
    invalid = ~np.isfinite(samples.time)
    if not invalid.any():
        return
    if not invalid.all():
        rows = samples.rows[invalid].tolist()
        refuse_loss(samples.path, "rows have no valid time", rows, invalid.size, discard)
        message = f"{len(rows)} rows without a valid time dropped ({list_rows(rows)})"
        samples.note("missing time", message, rows)
    samples.keep(~invalid)


def _sort_late_rows(samples: Samples) -> None:
    """Sort a few late rows, in place; raise if the clock restarts or is set back.

    A run of late rows is sorted if it is short, or if it fits between two neighbouring samples (a
    packet that arrived late). Any other run overlaps earlier rows, so that sorting would mix
    samples of different times.
    """
    time = samples.time
    before = np.maximum.accumulate(time)
    late = np.zeros(time.size, dtype=bool)
    late[1:] = time[1:] < before[:-1]
    if not late.any():
        return
    if (np.diff(time) < 0.0).all() and time.size > 2:
        raise refuse(
            samples.path,
            f"the rows are in reverse order: the first is at {time[0]:g} s, the last at"
            f" {time[-1]:g} s; turn them around (in Python [::-1] of a DataFrame or of each array)",
        )
    runs = true_runs(late)
    for first, end in runs:
        jump = (
            f"row {samples.rows[first - 1]} is at {time[first - 1]:g} s, row {samples.rows[first]}"
            f" at {time[first]:g} s"
        )
        if _is_back_at_start(time, first):
            raise refuse(
                samples.path,
                f"the clock restarts: {jump}; split the file before row {samples.rows[first]} "
                "and use each part as a record",
            )
        if end - first > LATE_RUN_ROWS and not _fit_between_neighbours(time, first, end):
            raise refuse(
                samples.path,
                f"the clock jumps back: {jump}, and {end - first} rows follow before it catches up"
                f" (sorted are at most {LATE_RUN_ROWS}); split the file before row"
                f" {samples.rows[first]}, or correct the time",
            )
    rows = samples.rows[late].tolist()
    if len(rows) > max(LATE_RUN_ROWS, 0.01 * time.size) and len(runs) > LATE_RUN_ROWS:
        raise refuse(
            samples.path,
            f"{len(rows)} of {time.size} rows are out of order ({list_rows(rows)}); sorted are at"
            " most 1 %: the times do not order this record",
        )
    late_by = float((before - time).max())
    message = f"{len(rows)} rows out of order by up to {late_by:.4g} s sorted ({list_rows(rows)})"
    samples.note("order", message, rows)
    samples.keep(np.argsort(time, kind="stable"))


def true_runs(mask: Mask) -> list[tuple[int, int]]:
    """Find the runs of True in a mask.

    Parameters
    ----------
    mask : ndarray of bool, shape (n,)

    Returns
    -------
    list of tuple of int
        Index of the first element of each run, and index past its last one.
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return [(int(first), int(end)) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def _is_back_at_start(time: Array, row: int) -> bool:
    """Return whether the time at a late row is back in the first 5 % of the record so far."""
    return row >= RESTART_AFTER_ROWS and bool(
        time[row] - time[0] <= 0.05 * (time[:row].max() - time[0])
    )


def restarts(time: Array) -> list[int]:
    """Find the restarts of a clock.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds; NaN where missing.

    Returns
    -------
    list of int
        Index of the first sample after each restart.
    """
    known = np.flatnonzero(np.isfinite(time))
    clock = time[known]
    first = 0
    result = []
    for k in (np.flatnonzero(np.diff(clock) < 0.0) + 1).tolist():
        # else the clock soon catches up, and it was a short run of late rows
        stays_back = clock[k : k + LATE_RUN_ROWS + 1].max() < clock[k - 1]
        if stays_back and _is_back_at_start(clock[first:], k - first):
            first = k
            result.append(int(known[k]))
    return result


def _fit_between_neighbours(time: Array, first: int, end: int) -> bool:
    """Return whether late rows are in order and fit between two neighbouring earlier samples."""
    run = time[first:end]
    inside = (time[:first] >= run.min()) & (time[:first] <= run.max())
    return bool(np.all(np.diff(run) >= 0) and not inside.any())


def _keep_ends_of_jumps(samples: Samples) -> None:
    """Keep the last row of each time, in place: its values apply after the jump."""
    last = np.concatenate((np.diff(samples.time) > 0, [True]))
    if last.all():
        return
    dropped = samples.rows[~last].tolist()
    message = (
        f"{len(dropped)} rows have the time of the row after them, with which their values jump"
        f" ({list_rows(dropped)})"
    )
    samples.keep(last)
    samples.note("duplicates", message, dropped)


def _average_duplicates(samples: Samples) -> None:
    """Replace the rows of each time by their mean, in place.

    The mean is the least-squares estimate of a quantity measured repeatedly at one instant. Missing
    cells do not enter it.
    """
    time = samples.time
    first = np.concatenate(([True], np.diff(time) > 0))
    if first.all():
        return
    group = np.cumsum(first) - 1
    repeated = samples.rows[~first].tolist()
    spreads = {
        name: spread
        for name, values in samples.values.items()
        if (spread := _largest_deviation(values, values[first][group]))
    }
    means = {name: _group_means(values, first) for name, values in samples.values.items()}
    instants = int((np.bincount(group) > 1).sum())
    treatment = "identical values"
    if spreads:
        listed = ", ".join(f"{name} by up to {spread:.4g}" for name, spread in spreads.items())
        treatment = f"their values averaged, which differ: {listed}"
    message = (
        f"{len(repeated)} rows repeat the time of an earlier row ({instants} instants,"
        f" {treatment}): {time.size} rows became {int(first.sum())} ({list_rows(repeated)})"
    )
    samples.keep(first)
    samples.values = means
    samples.note("duplicates", message, repeated)


def _largest_deviation(values: Array, others: Array) -> float:
    """Return the largest difference of values (n,) from others; zero where one is missing."""
    deviations = np.abs(values - others)
    return float(deviations[np.isfinite(deviations)].max(initial=0.0))


def _group_means(values: Array, first: Mask) -> Array:
    """Return the mean of each group of neighbouring samples without NaN; NaN for an empty one.

    Parameters
    ----------
    values : ndarray, shape (n,)
    first : ndarray of bool, shape (n,)
        True where a group begins.
    """
    group = np.cumsum(first) - 1
    # relative to the first value, so that equal values keep their bits
    reference = np.where(np.isnan(values[first]), 0.0, values[first])
    valid = ~np.isnan(values)
    count = np.bincount(group[valid], minlength=len(reference))
    deviations = (values - reference[group])[valid]
    total = np.bincount(group[valid], weights=deviations, minlength=len(reference))
    with np.errstate(invalid="ignore", divide="ignore"):  # 0 / 0 is NaN, a missing value
        return reference + total / count


def evenly_sampled(time: Array) -> bool:
    """Return whether steps of a record are equal enough for an autoregression over samples.

    Jitter of the clock is tolerated, a change of its rate is not. Over r mean steps a pole p of
    noise becomes p^r. Whitening with p then adds the variance of p^r - p, about (p ln p)^2 var(r),
    to the variance 1 - p^2 of the innovations: at most 5 % of it, at p = 0.45 and a standard
    deviation `JITTER` of r. The rate, averaged over `RATE_SAMPLES` steps, must stay within a factor
    of two.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds, increasing.

    Returns
    -------
    bool
    """
    steps = np.diff(time)
    low, high = np.quantile(steps, [0.05, 0.95])
    if 0.5 * high <= low:  # steps within a factor of two: no jitter to speak of
        return True
    if len(steps) < 2 * RATE_SAMPLES:
        return False
    periods = np.diff(time[::RATE_SAMPLES]) / RATE_SAMPLES
    slowest, fastest = np.quantile(periods, [0.05, 0.95])
    # steps beyond the quantiles are gaps, not jitter of the clock
    inner = np.clip(steps, *np.quantile(steps, [0.01, 0.99]))
    return bool(0.5 * fastest <= slowest and np.std(inner) <= JITTER * np.mean(inner))


def sample_period(path: Path, time: Array, purpose: str) -> float:
    """Return the sample period of an evenly sampled record.

    Parameters
    ----------
    path : Path
        The file, for the message.
    time : ndarray, shape (n,)
        Seconds, increasing.
    purpose : str
        Name of the method that needs equal steps, for the message.

    Returns
    -------
    float
        Seconds.

    Raises
    ------
    UserError
        If a step deviates from the median by more than `UNEVEN` of it.
    """
    steps = np.diff(time)
    period = float(np.median(steps))
    worst = int(np.argmax(np.abs(steps - period)))
    if abs(steps[worst] - period) > UNEVEN * period:
        raise UserError(
            f"{path}: samples are {period:g} s apart, but {steps[worst]:g} s after {time[worst]:g}"
            f" s: {purpose} needs equal steps; cut out an even stretch, or resample"
        )
    return float((time[-1] - time[0]) / (len(time) - 1))


def gaps(time: Array) -> Indices:
    """Find gaps in the time of a record.

    A step is a gap if it exceeds ten times the median step of the record and of the 11 steps around
    it, so that logarithmic sampling is uneven but has no gaps.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds, increasing.

    Returns
    -------
    ndarray of int
        Index of the last sample before each gap.
    """
    steps = np.diff(time)
    if not steps.size:
        return np.zeros(0, dtype=np.intp)
    suspects = np.flatnonzero(steps > GAP_FACTOR * np.median(steps))
    return np.array(
        [i for i in suspects if steps[i] > GAP_FACTOR * np.median(steps[max(0, i - 5) : i + 6])],
        dtype=np.intp,
    )


def _notice_gaps(samples: Samples) -> None:
    """Add notices of gaps and uneven sampling, which matter to tests for whiteness."""
    steps = np.diff(samples.time)
    median = float(np.median(steps))
    before = gaps(samples.time)
    if before.size:
        rows = samples.rows[before + 1].tolist()
        longest = before[int(np.argmax(steps[before]))]
        limit = f"longer than {GAP_FACTOR:g} × the median step of {median:.4g} s"
        where = f"{steps[longest]:.4g} s before row {samples.rows[longest + 1]}"
        one = f"a gap of {where}, {limit}"
        several = f"gaps {limit} before {list_rows(rows)}, the longest {where}"
        message = (
            f"{one if before.size == 1 else several}; a simulation holds the inputs constant over"
            " a gap and is wrong after it if they changed; a diagnosis restarts after it"
        )
        samples.note("gap", message, rows)
    if not evenly_sampled(samples.time):
        low, high = np.quantile(steps, [0.05, 0.95])
        message = f"uneven sampling: 90 % of the steps lie between {low:.4g} s and {high:.4g} s"
        samples.note("uneven sampling", message)
