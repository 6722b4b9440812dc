"""Forecast of an actuator's life from the growth of its impedance (sections 4.2 and 4.3, fig. 4-7).

The impedance falls at first and then "increases monotonically and linearly". At the end of the life
it is 15 to 25 % above its first value (section 4.2). A line is fitted from the minimum on; the time
at which it crosses the limit has the interval of inverse regression (Fieller, J. R. Stat. Soc. B
16, 1954), which is not bounded if the growth is not significant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from demonstrations.graphical.clustered import clustered_covariance
from demonstrations.graphical.quantity import GraphicalEstimate, quantity
from demonstrations.graphical.signals import over_time
from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.identify.uncertainty import parameter_covariance

_STRETCHES = 8  # clusters of points for the covariance, as errors are autocorrelated
_FEWEST = 3  # points of a cluster
_LEVEL = 0.975  # of a two-sided interval of 95 %


@dataclass(frozen=True)
class LifeForecast:
    """Forecast of the time at which an impedance with linear growth reaches its limit.

    Attributes
    ----------
    life : GraphicalEstimate
        Time in s of the record; the interval is not bounded if the growth is not significant.
    rate : GraphicalEstimate
        Growth in ohm/s.
    begin : float
        Time in s of the minimum, from which on the impedance grows.
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
    """Forecast the time at which the impedance is a share above its first value.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, increasing.
    impedance : array_like, shape (n,)
        In ohm; the rise is relative to the first value, that of the first use.
    rise : float
        Share of the first value at the end of the life.
    begin : float, optional
        Time in s from which on the growth is linear; by default that of the minimum.

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
    life, rate = _extrapolate(clock[growing], values[growing], limit)
    return LifeForecast(life, rate, start, limit)


def _extrapolate(t: Array, z: Array, limit: float) -> tuple[GraphicalEstimate, GraphicalEstimate]:
    """Return the time in s at which a line through the growth crosses a limit, and its slope."""
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
    """Return height and slope of a line, and their clustered covariance."""
    jacobian = np.column_stack([np.ones_like(t), t])
    line = np.asarray(np.linalg.lstsq(jacobian, z)[0], dtype=np.float64)
    stretch = (np.arange(t.size) * _STRETCHES) // t.size
    bread = parameter_covariance(jacobian.T @ jacobian)
    spread = clustered_covariance(bread, jacobian, z - jacobian @ line, stretch)
    return line, spread.matrix


def _crossing(gap: float, slope: float, covariance: Array) -> tuple[float, float]:
    """Return Fieller's interval of the time at which the line ``gap + slope t`` is zero.

    In it the line is no further from zero than the square root of the quadratic form of (1, t) with
    the covariance.
    """
    a = slope**2 - covariance[1, 1]
    b = gap * slope - covariance[0, 1]
    c = gap**2 - covariance[0, 0]
    if a <= 0.0 or slope <= 0.0:
        return -np.inf, np.inf
    root = float(np.sqrt(max(b**2 - a * c, 0.0)))
    return (-b - root) / a, (-b + root) / a
