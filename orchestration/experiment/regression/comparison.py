"""Comparison of the signals of two records by a tube around the reference.

The tube is that of csv-compare by rectangles: all points less than half a width away in time and
half a height away in value from the reference, which is straight between its samples. Every sample
of the result must be in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.kit import units
from fmus.kit.arrays import Array, Indices
from fmus.kit.declare import of_differences
from fmus.kit.errors import UserError, suggestion
from orchestration.experiment.regression.tolerances import EXACT, OTHERS, Tolerance
from orchestration.records import Record

_NOTHING = np.empty(0)
_ROUNDING = 1e-9  # of the duration, by which ends may be apart


class Deviation(NamedTuple):
    """Deviation of a signal of a result from the reference.

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
        difference = np.nan_to_num(np.abs(self.values - self.reference))
        return int(np.argmax(self.excess if self.outside else difference))

    @property
    def outside(self) -> int:
        """Number of samples outside of the tube."""
        return int(np.count_nonzero(self.excess))

    @property
    def compared(self) -> int:
        """Number of samples at which there is a tube."""
        return int(np.count_nonzero(~np.isnan(self.lower) | (self.excess > 0.0)))

    @property
    def difference(self) -> float:
        """Difference from the reference at the worst sample; infinite if there is no number."""
        if self.fault:
            return np.inf
        difference = abs(float(self.values[self.worst] - self.reference[self.worst]))
        return np.inf if np.isnan(difference) else difference

    @property
    def message(self) -> str:
        """Reason for which the result is refused, with the worst place; empty if it is not."""
        if not self.outside:
            return self.fault
        k = self.worst
        now, lower, upper = (self.shown(one[k]) for one in (self.values, self.lower, self.upper))
        return (
            f"differs by {self.shown_difference} at {self.time[k]:.6g} s: {now}, allowed"
            f" {lower} to {upper}; {self.outside} of {self.compared} samples are outside"
        )

    @property
    def shown_difference(self) -> str:
        """The difference with its unit; of temperatures it is in K, whatever their scale."""
        unit = of_differences(self.unit)
        if unit == self.unit:
            return self.shown(self.difference)
        return f"{units.convert(self.difference, unit, 'K'):.7g} K"

    def shown(self, value: float) -> str:
        """Return a value with the unit."""
        return f"{value:.7g} {self.unit}".removesuffix(" 1")


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
    exact : list of str
        Signals without a tolerance, where others have one.
    """

    result: str
    reference: str
    deviations: list[Deviation]
    new: list[str]
    exact: list[str] = field(default_factory=list)

    @property
    def refused(self) -> list[Deviation]:
        """The deviations that the tolerances do not allow."""
        return [one for one in self.deviations if one.message]


def compare(result: Record, reference: Record, tolerances: Mapping[str, Tolerance]) -> Regression:
    """Compare a result with a reference.

    Signals without a tolerance must be the same to the last bit, at the same times.

    Parameters
    ----------
    result, reference : Record
        In any units; see `orchestration.records.read_samples`.
    tolerances : Mapping of str to Tolerance
        See `read_tolerances`.

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
    for name in tolerances:
        if name != OTHERS and name not in reference.signals:
            near = suggestion(name, reference.signals)
            raise UserError(f"tolerance of {name}: {reference.source} has no such signal{near}")
    others = tolerances.get(OTHERS, EXACT)
    if not result.signals.keys() & reference.signals.keys():
        raise UserError(
            f"nothing to compare: {result.source} has {', '.join(result.signals) or 'no signals'},"
            f" {reference.source} has {', '.join(reference.signals) or 'no signals'}"
        )
    return Regression(
        str(result.source),
        str(reference.source),
        [
            _deviation(name, result, reference, tolerances.get(name, others))
            for name in reference.signals
        ],
        [name for name in result.signals if name not in reference.signals],
        [n for n in reference.signals if tolerances and tolerances.get(n, others) == EXACT],
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
    # a column without a unit is in that of the other file
    unit = reference.units[name] or result.units[name] or "1"
    expected = reference.signals[name]
    try:
        values = units.convert(result.signals[name], result.units[name] or unit, unit)
    except UserError as error:
        return Deviation(name, fault=f"cannot be compared: {error}")
    slack = tolerance.time + _ROUNDING * np.ptp(reference.time)
    begin, end = result.time[[0, -1]]
    first, last = reference.time[[0, -1]]
    if begin > first + slack or end < last - slack:
        covers = f"covers {begin:.6g} s to {end:.6g} s, the reference {first:.6g} s to {last:.6g} s"
        return Deviation(name, fault=covers)
    if tolerance == EXACT:
        return _exact_deviation(name, unit, result.time, values, reference.time, expected)
    height = tolerance.height(unit, extent(expected), f"tolerance of {name}")
    lower, upper = tube(reference.time, expected, result.time, tolerance.time, height)
    if np.isnan(lower).all():
        return Deviation(name, fault="has no value in the reference at the times of the result")
    excess = np.nan_to_num(np.fmax(lower - values, values - upper), nan=0.0, posinf=np.inf)
    excess[np.isnan(values) & ~np.isnan(lower)] = np.inf
    inside = np.interp(result.time, reference.time, expected)
    return Deviation(name, unit, result.time, values, inside, lower, upper, np.maximum(excess, 0.0))


def _exact_deviation(
    name: str, unit: str, time: Array, values: Array, expected_time: Array, expected: Array
) -> Deviation:
    """Return how a signal deviates that must be the same to the last bit."""
    count = expected.size
    if not np.array_equal(_bits(time[:count]), _bits(expected_time)):
        return Deviation(name, fault="is at other times than in the reference; allow a tolerance")
    values = values[:count]
    difference = np.nan_to_num(np.abs(values - expected), nan=np.inf, posinf=np.inf)
    # zeros of different sign differ as well
    difference = np.maximum(difference, np.finfo(float).tiny)
    excess = np.where(_bits(values) != _bits(expected), difference, 0.0)
    return Deviation(name, unit, expected_time, values, expected, expected, expected, excess)


def _bits(values: Array) -> NDArray[np.int64]:
    return values.astype("<f8").view("<i8")


def extent(values: Array) -> float:
    """Return the range of finite values; of a constant, its magnitude, as csv-compare does."""
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite) or np.abs(finite).max()) if finite.size else 0.0


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
