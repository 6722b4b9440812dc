"""Forecast of an actuator's life from the growth of its impedance (sections 4.2 and 4.3, fig. 4-7).

The impedance may fall at first, and then grows; at the end of the life it is 15 to 25 % above its
first value. Neither the shape of the growth nor the noise is known, so both are averaged over:

* growth by a power of the time or by an exponential, of which a line is the middle,
* no fall, or one with a time constant,
* white noise, noise with an exponential memory (AR(1) where samples are equidistant), 1/f noise.

Given these, the model is linear with a Gaussian likelihood (generalised least squares), integrated
over coefficients and size of the noise (restricted likelihood: Harville, J. Am. Stat. Assoc. 72,
1977). A life is shorter than t if the impedance at t exceeds a multiple of that at the beginning,
which is a linear function of the coefficients: its probability is one of Student's distribution. So
the first value is as uncertain as all others.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import sici, stdtr

from fmus.kit import UserError
from fmus.kit.arrays import Array, Indices
from orchestration.identify.metrics import finite_or_none

FEWEST = 6  # values; the model has up to four coefficients and shapes beside the noise
_MOST = 240  # values; neighbours are averaged beyond
# Of an interval of 95 %, and the median: 93 % of the posterior hold 95 % of drawn lives, as it has
# shapes that bend more than lives do (decision 162).
_ENDS = (0.035, 0.5, 0.965)
# Ranges of the shapes, in record lengths: what bends more is no growth that can be forecast.
_POWERS = np.linspace(0.3, 2.5, 23)
_RATES = np.linspace(-4.0, 4.0, 32)  # without zero
_FALLS = 10  # time constants of a fall
_FASTEST, _SLOWEST = 0.01, 0.3
_SEEN = 3.0  # values within the fastest time constant: a single one that is high is no fall
_PASSES = 3  # the ranges are narrowed to where the likelihood is, so that steps are small
_NEGLIGIBLE = 1e-4  # of the largest weight
_LONGEST = 0.33  # memory of the noise, in record lengths: beyond, it is a part of the growth
_CUTOFF = 20.0  # record lengths of the slowest period of 1/f noise
_TOGETHER = 1e-6  # of a sample: the covariance has its limit at none, log(1 / (2 f0))
_EXACT = 1e-14  # share of the sum of squares that is rounding
_HORIZON = 100.0  # record lengths beyond which nothing is forecast


@dataclass(frozen=True)
class LifeForecast:
    """Forecast of the time at which a growing impedance reaches its limit.

    Attributes
    ----------
    life : float
        Median, in s of the record; infinite if it is more likely that it never ends.
    interval : tuple of float
        95 % interval in s; the upper end is infinite if the growth is not significant.
    rise : float
        Share of the first value at the end of the life.
    limit : float
        Impedance at the end of the life, expected value, ohm.
    """

    life: float
    interval: tuple[float, float]
    rise: float
    limit: float
    posterior: _Posterior = field(repr=False, compare=False)

    def course(self, time: ArrayLike) -> Array:
        """Return the expected impedance in ohm at times (m,) in s, without noise."""
        return self.posterior.expected(np.asarray(time, dtype=float))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: None for what has no end."""
        return {
            "rise": self.rise,
            "limit": self.limit,
            "life": finite_or_none(self.life),
            "ci95": [finite_or_none(end) for end in self.interval],
        }

    def __str__(self) -> str:
        low, high = self.interval
        return (
            f"{self.limit:.4g} ohm after {self.life:.4g} s (95 % interval {low:.4g} to {high:.4g})"
        )


def forecast_life(time: ArrayLike, impedance: ArrayLike, rise: float = 0.15) -> LifeForecast:
    """Forecast the time at which the impedance is a share above its first value.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, increasing.
    impedance : array_like, shape (n,)
        In ohm; the rise is relative to the value at the first time, that of the first use, of
        which the first measurement is no better than any other.
    rise : float
        Share of the first value at the end of the life.

    Returns
    -------
    LifeForecast

    Raises
    ------
    UserError
        If the signals do not fit together, the share is not above 0, or there are too few values.
    """
    clock, values = np.asarray(time, dtype=float), np.asarray(impedance, dtype=float)
    if clock.ndim != 1 or clock.shape != values.shape or clock.size < FEWEST:
        raise UserError(
            f"time and impedance have the shapes {clock.shape} and {values.shape}: must be vectors"
            f" of one length, of {FEWEST} values or more"
        )
    if not (np.isfinite(clock).all() and np.isfinite(values).all()):
        raise UserError("time and impedance: every value must be a finite number")
    late = np.flatnonzero(np.diff(clock) <= 0.0)
    if late.size:
        raise UserError(f"time: must increase, and does not after sample {late[0]}")
    if not rise > 0.0:
        raise UserError(f"rise = {rise:g}: must be above 0")
    posterior = _posterior(_averaged(clock, values), float(clock[0]))
    low, median, high = (posterior.life(rise, end) for end in _ENDS)
    limit = (1.0 + rise) * float(posterior.expected(clock[:1])[0])
    return LifeForecast(median, (low, high), rise, limit, posterior)


def _averaged(clock: Array, values: Array) -> Array:
    """Return times and values (2, m), with neighbours averaged where there are many."""
    ends = np.linspace(0, clock.size, min(clock.size, _MOST) + 1).astype(int)[1:-1]
    parts = np.split(np.array([clock, values]), ends, axis=1)
    return np.transpose([part.mean(axis=1) for part in parts])


@dataclass(frozen=True)
class _Posterior:
    """Distribution of the course of the impedance: k fits, each of a shape in a noise.

    Attributes
    ----------
    shapes : _Shapes
    begin, length : float
        Of the record, in s.
    weight : ndarray, shape (k,)
        Probability of each, without those that are negligible.
    columns : ndarray, shape (k, 3)
        Columns of `_Shapes` that have the coefficients.
    coefficients : ndarray, shape (k, 3)
    covariance : ndarray, shape (k, 3, 3)
    freedom : ndarray, shape (k,)
        Degrees of freedom.
    """

    shapes: _Shapes
    begin: float
    length: float
    weight: Array
    columns: Indices
    coefficients: Array
    covariance: Array
    freedom: Indices

    def expected(self, time: Array) -> Array:
        """Return the expected impedance (m,) in ohm at times in s."""
        columns = self.shapes.columns((time - self.begin) / self.length)[:, self.columns]
        found: Array = np.einsum("k,mkp,kp->m", self.weight, columns, self.coefficients)
        return found

    def life(self, rise: float, probability: float) -> float:
        """Return the time in s before which the life has ended with a probability."""
        first = (1.0 + rise) * self.shapes.columns(np.zeros(1))[0]

        def excess(logarithm: float) -> float:
            above = self.shapes.columns(np.exp([logarithm]))[0] - first
            contrast = above[self.columns]
            spread = np.sqrt(np.einsum("kp,kpq,kq->k", contrast, self.covariance, contrast))
            t = np.sum(contrast * self.coefficients, axis=1) / spread
            return float(self.weight @ stdtr(self.freedom, t)) - probability

        low, high = -np.log(_HORIZON), np.log(_HORIZON)
        if excess(low) > 0.0:
            return self.begin
        if excess(high) < 0.0:
            return np.inf
        return self.begin + self.length * float(np.exp(brentq(excess, low, high)))


class _Shapes(NamedTuple):
    """Shapes of growth and fall over the share x of the record.

    Attributes
    ----------
    powers, rates : ndarray
        Of growths.
    falls : ndarray
        Logarithms of time constants.
    """

    powers: Array
    rates: Array
    falls: Array

    def columns(self, x: Array) -> Array:
        """Return the columns (m, c) at shares x (m,).

        They are a constant, growths, falls, and zero for no fall.
        """
        share = np.maximum(x, 0.0)[:, None]
        rates = self.rates + 1e-9  # none is zero
        growths = [share**self.powers, np.expm1(rates * share) / rates]
        falls = np.exp(-share / np.exp(self.falls))
        return np.hstack([np.ones_like(share), *growths, falls, np.zeros_like(share)])

    def designs(self) -> Indices:
        """Return the columns (k, 3) of each model: the constant, a growth, and a fall or none."""
        fall = 1 + self.powers.size + self.rates.size
        falls = range(fall, fall + self.falls.size + 1)
        return np.array([*product([0], range(1, fall), falls)])

    def narrowed(self, used: Indices) -> _Shapes:
        """Return as many shapes in the ranges of the columns that are used, and a step beyond."""
        ranges = []
        column = 1
        for values in self:
            inside = used[(used >= column) & (used < column + values.size)] - column
            column += values.size
            if inside.size:
                ends = np.clip([inside.min() - 1, inside.max() + 1], 0, values.size - 1)
                values = np.linspace(values[ends[0]], values[ends[1]], values.size)
            ranges.append(values)
        return _Shapes(*ranges)


def _posterior(course: Array, begin: float) -> _Posterior:
    """Return the distribution of a course (2, n), of times and values.

    Ranges of shapes are narrowed to those that fit.
    """
    clock, values = course
    length = float(clock[-1]) - begin
    x = (clock - begin) / length
    prior, roots = _noises(x)
    fastest = np.clip(_SEEN / x.size, _FASTEST, _SLOWEST / 2.0)
    shapes = _Shapes(_POWERS, _RATES, np.linspace(np.log(fastest), np.log(_SLOWEST), _FALLS))
    for _ in range(_PASSES):
        white = np.linalg.solve(roots, np.column_stack([shapes.columns(x), values]))
        normal = np.swapaxes(white, 1, 2) @ white
        found = _Posterior(shapes, begin, length, *_fits(normal, prior, shapes.designs(), x.size))
        shapes = shapes.narrowed(found.columns)
    return found


def _noises(x: Array) -> tuple[Array, Array]:
    """Return noises: logarithms of their prior densities (m,), and roots of covariances (m, n, n).

    The first is white. It is as likely as all that remember, and of these 1/f noise is as likely as
    each exponential memory.
    """
    distance = np.abs(x[:, None] - x) / np.median(np.diff(x))
    white = np.eye(x.size)
    memories = 0.5 * 2.0 ** np.arange(np.log2(max(2.0 * _LONGEST * x.size, 2.0)))
    remembering = np.exp(-distance / memories[:, None, None])
    roots = np.linalg.cholesky([white, *remembering, _flicker(distance) + 1e-9 * white])
    prior = -np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    prior[1:] -= np.log(memories.size + 1.0) + 0.5 * np.log(x.size)
    return prior, roots


def _flicker(distance: Array) -> Array:
    """Return the covariance of noise with the density 1/f up to the Nyquist frequency.

    From f0 to 1/2 a sample it is Ci(pi h) - Ci(2 pi f0 h) at the distance h, where f0 h is small.
    """
    f0 = 1.0 / (_CUTOFF * distance.max())
    h = np.maximum(distance, _TOGETHER)
    covariance: Array = sici(np.pi * h)[1] - np.euler_gamma - np.log(2.0 * np.pi * f0 * h)
    return covariance


def _fits(
    normal: Array, prior: Array, design: Indices, n: int
) -> tuple[Array, Indices, Array, Array, Indices]:
    """Fit designs (k, 3) by normal matrices (m, c, c) of n values in noises, of which one is white.

    The last column is the data, and the one before it that of no fall. Falls are as likely as none,
    and their coefficient has the prior of one value (unit information: Kass and Wasserman, J. Am.
    Stat. Assoc. 90, 1995).

    Returns
    -------
    tuple of ndarray
        Attributes of `_Posterior` from `weight` on.
    """
    normal[:, -2, -2] = 1.0  # so that its coefficient is zero
    matrix = normal[:, design[:, :, None], design[:, None, :]]
    moment = normal[:, design, -1]
    inverse = np.linalg.inv(matrix)
    coefficients = np.einsum("mkpq,mkq->mkp", inverse, moment)
    power = normal[:, -1:, -1]
    squares = np.maximum(power - np.sum(coefficients * moment, axis=2), _EXACT * power)
    volume = np.linalg.slogdet(matrix)[1]
    has_fall = design[:, 2] < design.max()
    freedom = np.broadcast_to(n - 2 - has_fall, squares.shape)
    weight = prior[:, None] + 0.5 * (volume[0] - volume - (n - 2) * np.log(squares))
    weight -= has_fall * (0.5 * np.log(n) + np.log(_FALLS))
    likelihood = np.exp(weight - weight.max())
    kept = likelihood > _NEGLIGIBLE
    return (
        likelihood[kept] / likelihood[kept].sum(),
        design[np.nonzero(kept)[1]],
        coefficients[kept],
        inverse[kept] * (squares / freedom)[kept][:, None, None],
        freedom[kept],
    )
