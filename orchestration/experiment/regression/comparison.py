"""Comparison of the signals of two records by a tube around the reference.

The tube is that of csv-compare by rectangles: all points less than half a width away in time and
half a height away in value from the reference, which is straight between its samples. Every sample
of the result must be in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fmus.kit import UserError, units
from fmus.kit.arrays import Array, Indices
from orchestration.experiment.regression.tolerances import EXACT, Tolerance, Tolerances
from orchestration.records import Record

_NOTHING = np.empty(0)
_ROUNDING = 1e-9  # of the duration, by which ends may be apart


class Deviation(NamedTuple):
    """How a signal of a result deviates from the reference.

    Attributes
    ----------
    signal : str
    unit : str
        That of the reference.
    time : ndarray, shape (n,)
        Samples of the result, s.
    values : ndarray, shape (n,)
    reference : ndarray, shape (n,)
        The reference at these times; NaN where it has no value.
    lower, upper : ndarray, shape (n,)
        The tube at these times; NaN where there is none.
    excess : ndarray, shape (n,)
        How far a value is outside of the tube; 0 inside, and where there is none.
    fault : str
        Why nothing can be compared; empty if something can.
    """

    signal: str
    unit: str = "1"
    time: Array = _NOTHING
    values: Array = _NOTHING
    reference: Array = _NOTHING
    lower: Array = _NOTHING
    upper: Array = _NOTHING
    excess: Array = _NOTHING
    fault: str = ""

    @property
    def worst(self) -> int:
        """Sample that is farthest outside; of none, the one farthest from the reference."""
        if self.is_outside:
            return int(np.argmax(self.excess))
        return int(np.argmax(np.nan_to_num(np.abs(self.values - self.reference))))

    @property
    def is_outside(self) -> bool:
        """True if a sample is outside of the tube."""
        return bool((self.excess > 0.0).any())

    @property
    def largest(self) -> float:
        """Difference from the reference at the worst sample; infinite if there is no number."""
        if self.fault:
            return np.inf
        difference = abs(float(self.values[self.worst] - self.reference[self.worst]))
        return difference if np.isfinite(difference) else np.inf

    @property
    def message(self) -> str:
        """Why the result is refused, with the worst place; empty if it is not."""
        if self.fault or not self.is_outside:
            return self.fault
        k = self.worst
        count = int((self.excess > 0.0).sum())
        place = f"at {self.time[k]:.6g} s: {self._shown(self.values[k])}"
        exact = self.lower[k] == self.upper[k]
        allowed = (
            f"is {self._shown(self.reference[k])} in the reference"
            if exact
            else f"allowed {self._shown(self.lower[k])} to {self._shown(self.upper[k])}"
        )
        return (
            f"differs by up to {self.largest:.3g} {self.unit} {place}, {allowed};"
            f" {count} of {self.time.size} samples are outside"
        ).replace(" 1 at", " at")

    def _shown(self, value: float) -> str:
        return f"{value:.10g} {self.unit}".removesuffix(" 1")


@dataclass(frozen=True)
class Regression:
    """A result compared with a reference.

    Attributes
    ----------
    result, reference : str
        Names of the files.
    deviations : list of Deviation
        Of each signal of the reference.
    new : list of str
        Signals that only the result has, which are not compared.
    """

    result: str
    reference: str
    deviations: list[Deviation]
    new: list[str]

    @property
    def refused(self) -> list[Deviation]:
        """The deviations that the tolerances do not allow."""
        return [one for one in self.deviations if one.message]


def compare(result: Record, reference: Record, tolerances: Tolerances) -> Regression:
    """Compare a result with a reference.

    Signals without a tolerance must be the same to the last bit, at the same times.

    Parameters
    ----------
    result, reference : Record
        In any units; see `orchestration.records.read_samples`.
    tolerances : Tolerances

    Returns
    -------
    Regression

    Raises
    ------
    UserError
        If no signal is in both, a time goes back, there are no samples, or a tolerance is of
        another quantity or of no signal.
    """
    for record in (result, reference):
        _check_time(record)
    tolerances.check_names(reference.signals, reference.source)
    if not result.signals.keys() & reference.signals.keys():
        raise UserError(
            f"nothing to compare: {result.source} has {', '.join(result.signals) or 'no signals'},"
            f" {reference.source} has {', '.join(reference.signals) or 'no signals'}"
        )
    return Regression(
        str(result.source),
        str(reference.source),
        [_deviation(name, result, reference, tolerances.of(name)) for name in reference.signals],
        [name for name in result.signals if name not in reference.signals],
    )


def _check_time(record: Record) -> None:
    if not record.time.size:
        raise UserError(f"{record.source}: there are no samples")
    back = np.flatnonzero(~(np.diff(record.time, prepend=record.time[0]) >= 0.0))
    if back.size:
        at = record.time[back[0]]
        raise UserError(f"{record.source}: time goes back, or is missing, at {at:g} s")


@np.errstate(invalid="ignore", over="ignore")
def _deviation(name: str, result: Record, reference: Record, tolerance: Tolerance) -> Deviation:
    """Return how a signal of a result deviates from the reference."""
    if name not in result.signals:
        return Deviation(name, fault=f"is missing in {result.source}")
    unit = reference.units[name]
    expected = reference.signals[name]
    try:
        values = units.convert(result.signals[name], result.units[name], unit)
    except UserError as error:
        return Deviation(name, fault=f"cannot be compared: {error}")
    slack = tolerance.time + _ROUNDING * np.ptp(reference.time)
    if result.time[0] > reference.time[0] + slack:
        return Deviation(name, fault=_misses("begins", result.time[0], reference.time[0]))
    if result.time[-1] < reference.time[-1] - slack:
        return Deviation(name, fault=_misses("ends", result.time[-1], reference.time[-1]))
    if tolerance == EXACT:
        return _exact_deviation(name, unit, result.time, values, reference.time, expected)
    if np.isnan(expected).all():
        return Deviation(name, fault="has no value in the reference")
    height = tolerance.height(unit, extent(expected), f"tolerance of {name}")
    lower, upper = tube(reference.time, expected, result.time, tolerance.time, height)
    excess = np.nan_to_num(np.fmax(lower - values, values - upper), nan=0.0, posinf=np.inf)
    excess[np.isnan(values) & ~np.isnan(lower)] = np.inf
    inside = np.interp(result.time, reference.time, expected)
    return Deviation(name, unit, result.time, values, inside, lower, upper, np.maximum(excess, 0.0))


def _misses(verb: str, time: float, expected: float) -> str:
    return f"{verb} at {time:.6g} s, the reference at {expected:.6g} s"


def _exact_deviation(
    name: str, unit: str, time: Array, values: Array, expected_time: Array, expected: Array
) -> Deviation:
    """Return how a signal deviates that must be the same to the last bit."""
    count = expected.size
    if _bits(time[:count]) != _bits(expected_time):
        return Deviation(name, fault="is at other times than in the reference; allow a tolerance")
    values = values[:count]
    differs = values.astype("<f8").view("<i8") != expected.astype("<f8").view("<i8")
    difference = np.nan_to_num(np.abs(values - expected), nan=np.inf, posinf=np.inf)
    # zeros of different sign differ as well
    excess = np.where(differs, np.maximum(difference, np.finfo(float).tiny), 0.0)
    return Deviation(name, unit, expected_time, values, expected, expected, expected, excess)


def _bits(values: Array) -> bytes:
    return values.astype("<f8").tobytes()


def extent(values: Array) -> float:
    """Return the range of values; of a constant, its magnitude, as csv-compare does."""
    return float(np.nanmax(values) - np.nanmin(values) or np.nanmax(np.abs(values)))


def tube(
    time: Array, reference: Array, at: Array, width: float, height: float
) -> tuple[Array, Array]:
    """Return the tube around a signal that is straight between its samples.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Of the samples, s, not falling; a jump has two of one time.
    reference : ndarray, shape (n,)
    at : ndarray, shape (m,)
        Times at which the tube is wanted, s.
    width : float
        Half the width of the rectangles, s.
    height : float
        Half their height, in the signal's unit.

    Returns
    -------
    lower, upper : ndarray, shape (m,)
        NaN where no rectangle reaches, and where one has no value.
    """
    first = np.clip(at - width, time[0], time[-1])
    last = np.clip(at + width, time[0], time[-1])
    ends = np.interp([first, last], time, reference)
    begin = np.searchsorted(time, first, "left")
    end = np.searchsorted(time, last, "right")
    lower = np.minimum(ends.min(axis=0), _reduced(np.minimum, reference, begin, end, np.inf))
    upper = np.maximum(ends.max(axis=0), _reduced(np.maximum, reference, begin, end, -np.inf))
    outside = (at < time[0] - width) | (at > time[-1] + width)
    lower[outside] = np.nan
    upper[outside] = np.nan
    return lower - height, upper + height


def _reduced(
    function: np.ufunc, values: Array, begin: Indices, end: Indices, neutral: float
) -> Array:
    """Return a function of the values from each beginning to before each end."""
    padded = np.append(values, neutral)
    of_pairs = function.reduceat(padded, np.column_stack([begin, end]).ravel())[::2]
    return np.where(begin < end, of_pairs, neutral)
