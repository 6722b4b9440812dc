"""Slope, with and without forced zero crossing, and area of the loops that one signal makes over another.

So the thesis reads the strain to charge ratio off displacement over charge (section 3.3.1, figs. 3-10 and 3-11; eq.
3.4). Intervals are those of one cycle against another: what repeats in every cycle, a hysteresis or a lag, is no noise
of theirs, and what drifts is told by the gap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fmus.kit.errors import UserError
from orchestration.identify.covariance import clustered, covariance
from orchestration.identify.graphical.quantity import Quantity, mean, quantity
from orchestration.identify.graphical.signals import over_time

Array = NDArray[np.float64]
_ROUNDING = 1e-6  # of a cycle: a sample that rounding puts just before a cycle's end is its end
_FEWEST = 4  # samples of a cycle that can enclose an area


@dataclass(frozen=True)
class Loops:
    """What repeated loops of y over x tell.

    Attributes
    ----------
    slope : Quantity
        Of the straight line of least squares, in the unit of y over that of x.
    intercept : Quantity
        Of that line, in the unit of y.
    slope_through_zero : Quantity
        Of the line that is made to cross zero.
    area : Quantity
        Enclosed by a cycle, closed by its chord; the mean over cycles, in the unit of x times that of y. Positive if
        traversed counterclockwise, with x to the right and y upwards: y lags behind x. Negative if it leads.
    gap : Quantity
        Change of y from the beginning of a cycle to its end: of a closed loop 0.
    cycles : int
    """

    slope: Quantity
    intercept: Quantity
    slope_through_zero: Quantity
    area: Quantity
    gap: Quantity
    cycles: int

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON."""
        names = ("slope", "intercept", "slope_through_zero", "area", "gap")
        return {name: getattr(self, name).to_dict() for name in names} | {"cycles": self.cycles}


def loops(
    time: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    period: float,
    units: tuple[str, str] = ("C", "m"),
    start: float = 0.0,
    drift: bool = False,
) -> Loops:
    """Analyse the loops of y over x, cycle by cycle.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, increasing.
    x, y : array_like, shape (n,)
    period : float
        Of a cycle in seconds; need not be a whole number of samples.
    units : tuple of str
        Of x and y.
    start : float
        Seconds from the first sample that are left out; what is short of a cycle in the end is left out too.
    drift : bool
        Whether y may also change steadily with time, as a film does that flows under its load. The rate is estimated
        with either line, and that of the free one is taken off y before area and gap are.

    Returns
    -------
    Loops

    Raises
    ------
    UserError
        If the signals do not fit together or are not finite, there is no whole cycle of at least 4 samples, or x stands
        still.
    """
    t, across, up = over_time(time, x=x, y=y)
    t = t - t[0] - start
    if not (np.isfinite(period) and period > 0.0):
        raise UserError(f"period = {period:g} s: must be above 0")
    if not start >= 0.0:
        raise UserError(f"start = {start:g} s: must be 0 or more")
    count = int(np.floor(t[-1] / period + _ROUNDING))
    if count < 1:
        raise UserError(f"record of {t[-1]:g} s after the start: a cycle takes {period:g} s")
    cycle = np.floor(t / period + _ROUNDING).astype(np.intp)
    inside = (cycle >= 0) & (cycle < count)
    counted = np.bincount(cycle[inside], minlength=count)
    if counted.min() < _FEWEST:
        scarce = int(np.argmin(counted))
        raise UserError(
            f"cycle {scarce + 1} has {counted[scarce]} samples: at least {_FEWEST} enclose an area"
        )
    if np.ptp(across[inside]) == 0.0:
        raise UserError("x does not change: there is no slope over it")
    lines = [
        _line(across[inside], up[inside], t[inside], cycle[inside], zero, drift)
        for zero in (False, True)
    ]
    up = up - lines[0].rate * t
    enclosed, gaps = zip(*(_cycle(t, across, up, k, period) for k in range(count)), strict=True)
    of_x, of_y = units
    free, forced = (quantity(*line.slope, count, f"{of_y}/{of_x}") for line in lines)
    intercept = quantity(*lines[0].intercept, count, of_y)
    return Loops(free, intercept, forced, mean(enclosed, f"{of_x}*{of_y}"), mean(gaps, of_y), count)


def area(x: ArrayLike, y: ArrayLike) -> float:
    """Return the area of a polygon (Gauss), positive if traversed counterclockwise; its ends are joined by a chord.

    Parameters
    ----------
    x, y : array_like, shape (n,)

    Returns
    -------
    float
        In the unit of x times that of y.
    """
    across, up = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    across, up = (
        across - across.mean(),
        up - up.mean(),
    )  # far from the origin the products would lose digits
    return float(0.5 * np.sum(across * np.roll(up, -1) - np.roll(across, -1) * up))


def _cycle(t: Array, x: Array, y: Array, number: int, period: float) -> tuple[float, float]:
    """Area of a cycle and its gap; its two ends are interpolated."""
    ends = number * period, (number + 1) * period
    within = (t > ends[0]) & (t < ends[1])
    path = [
        np.concatenate([[np.interp(ends[0], t, s)], s[within], [np.interp(ends[1], t, s)]])
        for s in (x, y)
    ]
    return area(*path), float(path[1][-1] - path[1][0])


class _Line(NamedTuple):
    """Slope and intercept with their standard errors, and the rate at which y drifts."""

    slope: tuple[float, float]
    intercept: tuple[float, float]
    rate: float


def _line(x: Array, y: Array, t: Array, cycle: NDArray[np.intp], zero: bool, drift: bool) -> _Line:
    """Fit a line by least squares; its errors are from how far single cycles pull it."""
    columns = (
        {"slope": x}
        | ({} if zero else {"intercept": np.ones_like(x)})
        | ({"rate": t} if drift else {})
    )
    jacobian = np.column_stack(list(columns.values()))
    estimate = np.linalg.lstsq(jacobian, y)[0]
    errors = clustered(
        covariance(jacobian.T @ jacobian), jacobian, y - jacobian @ estimate, cycle
    ).standard_errors
    found = {
        name: (float(v), float(e)) for name, v, e in zip(columns, estimate, errors, strict=True)
    }
    nothing = 0.0, 0.0
    return _Line(found["slope"], found.get("intercept", nothing), found.get("rate", nothing)[0])
