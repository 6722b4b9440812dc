"""Slope, with and without forced zero crossing, and area of loops of one signal over another.

In this way the thesis reads the strain to charge ratio from displacement over charge (section
3.3.1, figs. 3-10 and 3-11; eq. 3.4). Intervals are from the variation between cycles: a hysteresis
or a lag, which repeats in every cycle, does not widen them; a drift appears in the gap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from demonstrations.graphical.clustered import clustered_covariance
from demonstrations.graphical.quantity import GraphicalEstimate, mean, quantity
from demonstrations.graphical.signals import over_time
from fmus.kit import UserError
from fmus.kit.arrays import Array, Indices
from orchestration.identify.uncertainty import parameter_covariance

_ROUNDING = 1e-6  # of a cycle: a sample so shortly before its end is its end
_FEWEST = 4  # samples of a cycle for an area


@dataclass(frozen=True)
class Loops:
    """Slopes, areas and gaps of repeated loops of y over x.

    Attributes
    ----------
    slope : GraphicalEstimate
        Slope of the line of least squares, in the unit of y over that of x.
    intercept : GraphicalEstimate
        Intercept of that line, in the unit of y.
    slope_through_zero : GraphicalEstimate
        Slope of the line of least squares through zero.
    area : GraphicalEstimate
        Mean area of a cycle, which is closed by its chord, in the unit of x times that of y.
        Positive if counterclockwise, with x to the right and y upwards, so that y lags behind x;
        negative if y leads.
    gap : GraphicalEstimate
        Mean change of y from the beginning of a cycle to its end, 0 for a closed loop.
    cycles : int
    """

    slope: GraphicalEstimate
    intercept: GraphicalEstimate
    slope_through_zero: GraphicalEstimate
    area: GraphicalEstimate
    gap: GraphicalEstimate
    cycles: int


def read_loops(
    time: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    period: float,
    *,
    units: tuple[str, str] = ("C", "m"),
    start: float = 0.0,
    drift: bool = False,
) -> Loops:
    """Return slopes, mean area and mean gap of the loops of y over x.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, increasing.
    x, y : array_like, shape (n,)
    period : float
        Duration of a cycle in seconds; it need not be a whole number of samples.
    units : tuple of str
        Units of x and y.
    start : float
        Seconds after the first sample that are omitted, as is an incomplete last cycle.
    drift : bool
        Whether y may also have a linear drift, like a film that flows under its load. Its rate is
        estimated with each line, and that of the free line is subtracted from y for area and gap.

    Returns
    -------
    Loops

    Raises
    ------
    UserError
        If the signals do not fit together or are not finite, there is no whole cycle of at least 4
        samples, or x is constant.
    """
    clock, x_values, y_values = over_time(time, x=x, y=y)
    t = clock - clock[0] - start
    cycle, count = _cycles(t, period, start)
    inside = (cycle >= 0) & (cycle < count)
    if np.ptp(x_values[inside]) == 0.0:
        raise UserError("x does not change: there is no slope over it")
    points = _Points(x_values[inside], y_values[inside], t[inside], cycle[inside])
    free = _line(points, through_zero=False, drift=drift)
    forced = _line(points, through_zero=True, drift=drift)
    y_without_drift = y_values - free.rate * t
    of_x, of_y = units
    loops = [_cycle(t, x_values, y_without_drift, number, period) for number in range(count)]
    return Loops(
        slope=quantity(*free.slope, count, f"{of_y}/{of_x}"),
        intercept=quantity(*free.intercept, count, of_y),
        slope_through_zero=quantity(*forced.slope, count, f"{of_y}/{of_x}"),
        area=mean([enclosed for enclosed, _ in loops], f"{of_x}*{of_y}"),
        gap=mean([gap for _, gap in loops], of_y),
        cycles=count,
    )


def _cycles(t: Array, period: float, start: float) -> tuple[Indices, int]:
    """Return the number of the cycle of every sample (n,), and the number of complete cycles.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Seconds from the beginning of the first cycle.
    period, start : float
        See :func:`read_loops`.
    """
    if not (np.isfinite(period) and period > 0.0):
        raise UserError(f"period = {period:g} s: must be above 0")
    if not start >= 0.0:
        raise UserError(f"start = {start:g} s: must be 0 or more")
    count = int(np.floor(t[-1] / period + _ROUNDING))
    if count < 1:
        raise UserError(f"record of {t[-1]:g} s after the start: a cycle takes {period:g} s")
    cycle = np.floor(t / period + _ROUNDING).astype(np.intp)
    samples = np.bincount(cycle[(cycle >= 0) & (cycle < count)], minlength=count)
    if samples.min() < _FEWEST:
        scarce = int(np.argmin(samples))
        raise UserError(
            f"cycle {scarce + 1} has {samples[scarce]} samples: at least {_FEWEST} enclose an area"
        )
    return cycle, count


def area(x: ArrayLike, y: ArrayLike) -> float:
    """Return the area of a polygon by Gauss's formula, positive if counterclockwise.

    A chord joins its ends.

    Parameters
    ----------
    x, y : array_like, shape (n,)

    Returns
    -------
    float
        In the unit of x times that of y.
    """
    given_x = np.asarray(x, dtype=float)
    given_y = np.asarray(y, dtype=float)
    # relative to the centre, as products of large coordinates would lose digits
    across = given_x - given_x.mean()
    up = given_y - given_y.mean()
    return float(0.5 * np.sum(across * np.roll(up, -1) - np.roll(across, -1) * up))


def _cycle(t: Array, x: Array, y: Array, number: int, period: float) -> tuple[float, float]:
    """Return the area and the gap of a cycle with interpolated ends."""
    begin = number * period
    end = (number + 1) * period
    within = (t > begin) & (t < end)

    def path(signal: Array) -> Array:
        first = np.interp(begin, t, signal)
        last = np.interp(end, t, signal)
        return np.concatenate([[first], signal[within], [last]])

    over = path(y)
    return area(path(x), over), float(over[-1] - over[0])


class _Points(NamedTuple):
    """Samples (n,) of all complete cycles, with the number of the cycle of each."""

    x: Array
    y: Array
    t: Array
    cycle: Indices


class _Line(NamedTuple):
    """Slope and intercept, each with its standard error, and the rate of the drift of y."""

    slope: tuple[float, float]
    intercept: tuple[float, float]
    rate: float


def _line(points: _Points, through_zero: bool, drift: bool) -> _Line:
    """Fit a line by least squares, with standard errors from the variation between cycles."""
    columns = {"slope": points.x}
    if not through_zero:
        columns["intercept"] = np.ones_like(points.x)
    if drift:
        columns["rate"] = points.t
    jacobian = np.column_stack(list(columns.values()))
    estimate = np.linalg.lstsq(jacobian, points.y)[0]
    bread = parameter_covariance(jacobian.T @ jacobian)
    residual = points.y - jacobian @ estimate
    errors = clustered_covariance(bread, jacobian, residual, points.cycle).standard_errors
    fitted = {
        name: (float(value), float(error))
        for name, value, error in zip(columns, estimate, errors, strict=True)
    }
    absent = (0.0, 0.0)
    return _Line(fitted["slope"], fitted.get("intercept", absent), fitted.get("rate", absent)[0])
