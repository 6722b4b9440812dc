"""The time column: repaired (missing, unordered, repeated), refused (a restart), gaps reported."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit import UserError
from fmus.kit.arrays import Array, Indices, Mask
from orchestration.records.record import Repair, list_rows, refuse

LATE_RUN_ROWS = 5
"""A run of at most this many late rows is sorted in; a longer one is a clock that was set back."""
RESTART_AFTER_ROWS = 20
"""A jump back to the start after this many rows is a restart, however few rows follow."""
GAP_FACTOR = 10.0
"""A step longer than this many median steps is a gap."""
JITTER = 0.55
"""Standard deviation of steps over their mean, up to which a clock is even."""
RATE_SAMPLES = 16
"""Steps over which jitter of a clock averages out."""
UNEVEN = 0.01
"""Share of a sample period by which samples may be off it where equal steps are needed."""


@dataclass
class Samples:
    """Time, values and row numbers while they are being repaired.

    Parameters
    ----------
    path : Path
        The file, for messages.
    time : ndarray, shape (n,)
        Seconds.
    values : dict of str to ndarray, shape (n,)
        Signals.
    rows : ndarray of int, shape (n,)
        Row number of every sample in the file.
    repairs : list of Repair
        What was done so far.
    """

    path: Path
    time: Array
    values: dict[str, Array]
    rows: NDArray[np.int64]
    repairs: list[Repair]

    def keep(self, selection: Mask | NDArray[np.int64]) -> None:
        """Keep (and order) the chosen samples.

        Parameters
        ----------
        selection : ndarray
            A mask, or indices.
        """
        self.time = self.time[selection]
        self.rows = self.rows[selection]
        self.values = {name: values[selection] for name, values in self.values.items()}


def repair_clock(samples: Samples, jumps: bool = False) -> None:
    """Make the time strictly increasing, in place.

    Parameters
    ----------
    samples : Samples
        The samples as the file has them.
    jumps : bool
        Whether values jump between rows of one time, whose mean is taken otherwise.

    Raises
    ------
    UserError
        If the clock restarts or is set back, or fewer than two samples remain.
    """
    _drop_missing_time(samples)
    _require_two(samples)
    _sort_late_rows(samples)
    if jumps:
        _keep_ends_of_jumps(samples)
    else:
        _average_duplicates(samples)
    _require_two(samples)
    _notice_gaps(samples)


def _require_two(samples: Samples) -> None:
    """Refuse a record of fewer than two instants."""
    if samples.time.size < 2:
        count = samples.time.size
        what = (
            f"only one instant ({list_rows(samples.rows.tolist())})"
            if count
            else "no row with a valid time"
        )
        raise refuse(samples.path, f"{what}; a record needs at least two different times")


def _drop_missing_time(samples: Samples) -> None:
    """Drop the rows whose time is missing or infinite, in place."""
    bad = ~np.isfinite(samples.time)
    if bad.any():
        rows = samples.rows[bad].tolist()
        message = f"{len(rows)} rows without a valid time dropped ({list_rows(rows)})"
        samples.repairs.append(Repair("missing time", message, tuple(rows)))
        samples.keep(~bad)


def _sort_late_rows(samples: Samples) -> None:
    """Sort in the few rows that come late, in place; refuse a clock that restarts or is set back.

    A run of late rows is sorted if it is short, or if it fits between two neighbouring samples (a
    packet that arrived late). Any other run overlaps what was measured before it: sorting would
    shuffle two different times together.
    """
    time = samples.time
    before = np.maximum.accumulate(time)
    late = np.zeros(time.size, dtype=bool)
    late[1:] = time[1:] < before[:-1]
    if not late.any():
        return
    edges = np.flatnonzero(np.diff(np.concatenate(([False], late, [False])).astype(int)))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        jump = (
            f"row {samples.rows[first - 1]} is at {time[first - 1]:g} s, row {samples.rows[first]}"
            f" at {time[first]:g} s"
        )
        if _restarts(time, first):
            raise refuse(
                samples.path,
                f"the clock restarts: {jump}; split the file before row {samples.rows[first]} "
                "and use each part as a record",
            )
        if end - first > LATE_RUN_ROWS and not _fills_a_hole(time, first, end):
            raise refuse(
                samples.path,
                f"the clock jumps back: {jump}, and {end - first} rows follow before it catches up"
                f" (sorted are at most {LATE_RUN_ROWS}); split the file before row"
                f" {samples.rows[first]}, or correct the time",
            )
    rows = samples.rows[late].tolist()
    if len(rows) > max(LATE_RUN_ROWS, 0.01 * time.size) and len(edges) // 2 > LATE_RUN_ROWS:
        raise refuse(
            samples.path,
            f"{len(rows)} of {time.size} rows are out of order ({list_rows(rows)}); sorted are at"
            " most 1 %: the times do not order this record",
        )
    samples.repairs.append(
        Repair("order", f"{len(rows)} rows out of order sorted ({list_rows(rows)})", tuple(rows))
    )
    samples.keep(np.argsort(time, kind="stable"))


def _restarts(time: Array, row: int) -> bool:
    """Tell whether a row that comes late is back where the clock began."""
    return row >= RESTART_AFTER_ROWS and bool(
        time[row] - time[0] <= 0.05 * (time[:row].max() - time[0])
    )


def restarts(time: Array) -> list[int]:
    """Find where a clock restarts.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds; NaN where there is none.

    Returns
    -------
    list of int
        First sample of every run but the first.
    """
    at = np.flatnonzero(np.isfinite(time))
    clock, first, found = time[at], 0, []
    for k in np.flatnonzero(np.diff(clock) < 0.0) + 1:
        stays = (
            clock[k : k + LATE_RUN_ROWS + 1].max() < clock[k - 1]
        )  # else these are a few late rows
        if stays and _restarts(clock[first:], int(k) - first):
            first = int(k)
            found.append(int(at[k]))
    return found


def _fills_a_hole(time: Array, first: int, end: int) -> bool:
    """Tell whether late rows fit, in order, between two neighbouring earlier samples."""
    run = time[first:end]
    inside = (time[:first] >= run.min()) & (time[:first] <= run.max())
    return bool(np.all(np.diff(run) >= 0) and not inside.any())


def _keep_ends_of_jumps(samples: Samples) -> None:
    """Keep the last of the rows of one time, in place: the values that are held from there."""
    last = np.concatenate((np.diff(samples.time) > 0, [True]))
    if last.all():
        return
    passed = samples.rows[~last].tolist()
    message = (
        f"{len(passed)} rows have the time of the row after them, with which their values jump"
        f" ({list_rows(passed)})"
    )
    samples.keep(last)
    samples.repairs.append(Repair("duplicates", message, tuple(passed)))


def _average_duplicates(samples: Samples) -> None:
    """Replace the rows of one time by their mean, in place.

    The mean is the least-squares estimate of a quantity measured repeatedly at one instant; an
    ordered integrator can use only one value there. Missing cells do not enter the mean.
    """
    time = samples.time
    first = np.concatenate(([True], np.diff(time) > 0))
    if first.all():
        return
    group = np.cumsum(first) - 1
    repeated = samples.rows[~first].tolist()
    alike = True
    means = {}
    for name, values in samples.values.items():
        valid = ~np.isnan(values)
        count = np.bincount(group[valid], minlength=group[-1] + 1)
        reference = values[first][group]
        alike = alike and bool(np.all((values == reference) | (~valid & np.isnan(reference))))
        # taken around the group's first value, so that equal values give exactly that value
        finite_reference = np.where(np.isnan(reference), 0.0, reference)
        total = np.bincount(
            group[valid], weights=(values - finite_reference)[valid], minlength=group[-1] + 1
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            means[name] = finite_reference[first] + total / count
    instants = int((np.bincount(group) > 1).sum())
    what = "identical values" if alike else "their values averaged"
    message = (
        f"{len(repeated)} rows repeat the time of an earlier row ({instants} instants, {what}): "
        f"{time.size} rows became {int(first.sum())} ({list_rows(repeated)})"
    )
    samples.keep(first)
    samples.values = means
    samples.repairs.append(Repair("duplicates", message, tuple(repeated)))


def evenly_sampled(time: Array) -> bool:
    """Return whether steps of a record are equal enough for an autoregression over samples.

    That bears a clock that jitters, but none that changes its rate. A pole p of noise becomes p^r
    over r steps. Whitened by p all the same, its innovations are larger by the variance of p^r - p,
    about (p ln p)^2 var(r), beside 1 - p^2: with `JITTER` at worst, at p = 0.45, by 5 %. The rate,
    averaged over `RATE_SAMPLES` steps, must stay within a factor of two.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds, increasing.
    """
    steps = np.diff(time)
    low, high = np.quantile(steps, [0.05, 0.95])
    if 0.5 * high <= low:
        return True
    if len(steps) < 2 * RATE_SAMPLES:
        return False
    periods = np.diff(time[::RATE_SAMPLES]) / RATE_SAMPLES
    slowest, fastest = np.quantile(periods, [0.05, 0.95])
    # gaps, which are none of the clock's doing, are beyond the quantiles
    inner = np.clip(steps, *np.quantile(steps, [0.01, 0.99]))
    return bool(0.5 * fastest <= slowest and np.std(inner) <= JITTER * np.mean(inner))


def sample_period(path: Path, time: Array, purpose: str) -> float:
    """Return the sample period of a clock that keeps one; refuse one that does not.

    Parameters
    ----------
    path : Path
        The file, for the message.
    time : ndarray, shape (n,)
        Seconds, increasing.
    purpose : str
        What needs equal steps, for the message.

    Returns
    -------
    float
        Seconds.

    Raises
    ------
    UserError
        If a step is off the median by more than `UNEVEN`.
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
    """Find samples after which a clock leaves a gap.

    A step is a gap if it exceeds ten times the median step of the record and of its surroundings,
    so that a record with logarithmic sampling is called uneven and not full of gaps.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds, increasing.
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
    """Note gaps and uneven sampling, in place; both matter to tests for whiteness."""
    steps = np.diff(samples.time)
    median = float(np.median(steps))
    found = gaps(samples.time)
    if found.size:
        rows = samples.rows[found + 1].tolist()
        longest = found[int(np.argmax(steps[found]))]
        message = (
            f"{len(found)} gaps longer than {GAP_FACTOR:g} × the median step of {median:.4g} s, the"
            f" longest {steps[longest]:.4g} s before row {samples.rows[longest + 1]} (before"
            f" {list_rows(rows)}); a simulation holds the inputs through a gap, and what follows it"
            " is right only if they did not change; a diagnosis begins anew after it"
        )
        samples.repairs.append(Repair("gap", message, tuple(rows)))
    if not evenly_sampled(samples.time):
        low, high = np.quantile(steps, [0.05, 0.95])
        message = f"uneven sampling: 90 % of the steps lie between {low:.4g} s and {high:.4g} s"
        samples.repairs.append(Repair("uneven sampling", message))
