"""Forecast of an actuator's life from the growth of its impedance (sections 4.2 and 4.3, fig. 4-7).

The impedance falls at first and then "increases monotonically and linearly"; the end of the life is
a share above its first value, 15 to 25 % in section 4.2. The line is fitted from the minimum on,
and where it crosses that value has the interval of inverse regression (Fieller, J. R. Stat. Soc. B
16, 1954), which has no end where the growth is not certain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from demonstrations.graphical.quantity import GraphicalEstimate, quantity
from demonstrations.graphical.signals import over_time
from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify.uncertainty import clustered_covariance, parameter_covariance

_STRETCHES = 8  # of the growth, whose lines are held against each other: their errors have memory
_FEWEST = 3  # points of a stretch
_LEVEL = 0.975  # of a two-sided interval of 95 %


@dataclass(frozen=True)
class LifeForecast:
    """When an impedance that grows linearly will have reached its limit.

    Attributes
    ----------
    life : GraphicalEstimate
        In s, on the clock of the record; an end is infinite where the growth is not certain.
    rate : GraphicalEstimate
        Growth in ohm/s.
    begin : float
        s, from which on the impedance grows: its minimum.
    limit : float
        Impedance at the end of the life, ohm.
    """

    life: GraphicalEstimate
    rate: GraphicalEstimate
    begin: float
    limit: float

    def __str__(self) -> str:
        return f"{self.limit:.4g} ohm after {self.life}; growth {self.rate} from {self.begin:g} s"


def forecast_life(
    time: ArrayLike, impedance: ArrayLike, rise: float = 0.15, begin: float | None = None
) -> LifeForecast:
    """Forecast when the impedance will be a share above its first value.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, increasing.
    impedance : array_like, shape (n,)
        In ohm; the first value is that of the first use, from which the rise counts.
    rise : float
        Share of the first value at the end of the life.
    begin : float, optional
        s, from which on the growth is linear; the smallest impedance by default.

    Returns
    -------
    LifeForecast

    Raises
    ------
    UserError
        If the signals do not fit together, the share is not above 0, or too few points follow the
        minimum.
    """
    clock, values = over_time(time, impedance=impedance)
    if not rise > 0.0:
        raise UserError(f"rise = {rise:g}: must be above 0")
    start = float(clock[np.argmin(values)]) if begin is None else float(begin)
    growing = clock >= start
    count = int(np.count_nonzero(growing))
    if count < _STRETCHES * _FEWEST:
        raise UserError(
            f"{count} impedances from {start:g} s on: at least {_STRETCHES * _FEWEST} show a growth"
        )
    limit = float(values[0]) * (1.0 + rise)
    life, rate = _extrapolated(clock[growing], values[growing], limit)
    return LifeForecast(life, rate, start, limit)


def _extrapolated(t: Array, z: Array, limit: float) -> tuple[GraphicalEstimate, GraphicalEstimate]:
    """Return when a line through the growth crosses a limit, in s, and its slope in ohm/s."""
    middle = float(t.mean())
    (height, slope), covariance = _line(t - middle, z)
    q = float(stdtrit(_STRETCHES - 1, _LEVEL))
    low, high = _crossing(height - limit, slope, q**2 * covariance)
    crossing = middle + (limit - height) / slope if slope > 0.0 else np.inf
    return (
        GraphicalEstimate(float(crossing), (middle + low, middle + high), "s"),
        quantity(float(slope), float(np.sqrt(covariance[1, 1])), _STRETCHES, "ohm/s"),
    )


def _line(t: Array, z: Array) -> tuple[Array, Array]:
    """Return height and slope of a line, and their covariance from stretch to stretch."""
    jacobian = np.column_stack([np.ones_like(t), t])
    line = np.asarray(np.linalg.lstsq(jacobian, z)[0], dtype=np.float64)
    stretch = (np.arange(t.size) * _STRETCHES) // t.size
    bread = parameter_covariance(jacobian.T @ jacobian)
    spread = clustered_covariance(bread, jacobian, z - jacobian @ line, stretch)
    return line, spread.matrix


def _crossing(gap: float, slope: float, covariance: Array) -> tuple[float, float]:
    """Return the times at which zero is within reach of the line ``gap + slope t``, by Fieller.

    The reach is the square root of the quadratic form of (1, t) with the covariance.
    """
    a = slope**2 - covariance[1, 1]
    b = gap * slope - covariance[0, 1]
    c = gap**2 - covariance[0, 0]
    if a <= 0.0 or slope <= 0.0:
        return -np.inf, np.inf
    root = float(np.sqrt(max(b**2 - a * c, 0.0)))
    return (-b - root) / a, (-b + root) / a
