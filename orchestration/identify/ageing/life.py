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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
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
    posterior = _posterior(*_averaged(clock, values), float(clock[0]))
    low, median, high = (posterior.life(rise, end) for end in _ENDS)
    limit = (1.0 + rise) * float(posterior.expected(clock[:1])[0])
    return LifeForecast(median, (low, high), rise, limit, posterior)


def _averaged(clock: Array, values: Array) -> tuple[Array, Array]:
    """Return times and values, with neighbours averaged where there are many."""
    first = np.linspace(0, clock.size, min(clock.size, _MOST) + 1).astype(int)[:-1]
    counts = np.diff(first, append=clock.size)
    return np.add.reduceat(clock, first) / counts, np.add.reduceat(values, first) / counts


class _Group(NamedTuple):
    """Fits with p coefficients each, of k combinations of noise and shapes.

    Attributes
    ----------
    weight : ndarray, shape (k,)
        Logarithm of the integrated likelihood.
    columns : ndarray, shape (k, p)
        Columns of `_Shapes` that have the coefficients.
    coefficients : ndarray, shape (k, p)
    covariance : ndarray, shape (k, p, p)
    freedom : int
        Degrees of freedom.
    """

    weight: Array
    columns: Indices
    coefficients: Array
    covariance: Array
    freedom: int


@dataclass(frozen=True)
class _Shapes:
    """Shapes of growth and fall over the share x of the record."""

    powers: Array
    rates: Array
    falls: Array

    @classmethod
    def of(cls, count: int) -> _Shapes:
        """Return all that can be seen in a number of values."""
        fastest = np.clip(_SEEN / count, _FASTEST, _SLOWEST / 2.0)
        return cls(_POWERS, _RATES, np.geomspace(fastest, _SLOWEST, _FALLS))

    def columns(self, x: Array) -> Array:
        """Return the columns at shares x (m,): a constant, growths, and falls."""
        share = np.maximum(x, 0.0)[:, None]
        rates = self.rates + 1e-9  # none is zero
        growths = [share**self.powers, np.expm1(rates * share) / rates]
        return np.hstack([np.ones_like(share), *growths, np.exp(-share / self.falls)])

    def designs(self) -> list[Indices]:
        """Return the columns of each model without a fall (k, 2), and of each with one (l, 3)."""
        growths = 1 + np.arange(self.powers.size + self.rates.size)
        falls = growths[-1] + 1 + np.arange(self.falls.size)
        return [
            np.array([(0, growth) for growth in growths]),
            np.array([(0, growth, fall) for growth in growths for fall in falls]),
        ]

    def narrowed(self, used: Indices) -> _Shapes:
        """Return as many shapes in the ranges of the columns that are used, and a step beyond."""
        ends = np.cumsum([1, self.powers.size, self.rates.size])
        parts = [
            _narrowed(values, used[(used >= end) & (used < end + values.size)] - end)
            for end, values in zip(ends, (self.powers, self.rates, np.log(self.falls)), strict=True)
        ]
        return _Shapes(parts[0], parts[1], np.exp(parts[2]))


def _narrowed(values: Array, used: Indices) -> Array:
    if not used.size:
        return values
    low, high = max(used.min() - 1, 0), min(used.max() + 1, values.size - 1)
    return np.linspace(values[low], values[high], values.size)


@dataclass(frozen=True)
class _Posterior:
    """Distribution of the course of the impedance, over shapes and noises.

    Attributes
    ----------
    shapes : _Shapes
    groups : sequence of _Group
        With weights that sum to 1, of those that are not negligible.
    begin, length : float
        Of the record, in s.
    """

    shapes: _Shapes
    groups: Sequence[_Group]
    begin: float
    length: float

    def expected(self, time: Array) -> Array:
        """Return the expected impedance (m,) in ohm at times in s."""
        columns = self.shapes.columns((time - self.begin) / self.length)
        parts = [
            np.einsum("k,mkp,kp->m", one.weight, columns[:, one.columns], one.coefficients)
            for one in self.groups
        ]
        return np.sum(parts, axis=0)

    def life(self, rise: float, probability: float) -> float:
        """Return the time in s before which the life has ended with a probability."""
        first = (1.0 + rise) * self.shapes.columns(np.zeros(1))[0]

        def excess(logarithm: float) -> float:
            above = self.shapes.columns(np.exp([logarithm]))[0] - first
            return sum(_probability(one, above) for one in self.groups) - probability

        low, high = -np.log(_HORIZON), np.log(_HORIZON)
        if excess(low) > 0.0:
            return self.begin
        if excess(high) < 0.0:
            return np.inf
        return self.begin + self.length * float(np.exp(brentq(excess, low, high)))


def _probability(group: _Group, contrast: Array) -> float:
    """Return the weighted probability that a linear function of the coefficients is positive."""
    c = contrast[group.columns]
    spread = np.sqrt(np.einsum("kp,kpq,kq->k", c, group.covariance, c))
    return float(
        group.weight @ stdtr(group.freedom, np.sum(c * group.coefficients, axis=1) / spread)
    )


def _posterior(clock: Array, values: Array, begin: float) -> _Posterior:
    """Return the distribution of courses; ranges of shapes are narrowed to those that fit."""
    length = float(clock[-1]) - begin
    x = (clock - begin) / length
    noises = [(weight, np.linalg.cholesky(matrix)) for weight, matrix in _noises(x)]
    shapes = _Shapes.of(x.size)
    groups = _groups(shapes, noises, x, values)
    for _ in range(_PASSES - 1):
        shapes = shapes.narrowed(np.unique(np.concatenate([one.columns.ravel() for one in groups])))
        groups = _groups(shapes, noises, x, values)
    return _Posterior(shapes, groups, begin, length)


def _noises(x: Array) -> Iterator[tuple[float, Any]]:
    """Yield correlations (n, n) of the noise, each with the logarithm of its prior probability.

    White noise is as likely as all that remembers; of that 1/f noise is as likely as each memory.
    """
    distance = np.abs(x[:, None] - x) / np.median(np.diff(x))
    white = np.eye(x.size)
    memories = 0.5 * 2.0 ** np.arange(np.log2(max(2.0 * _LONGEST * x.size, 2.0)))
    prior = -np.log(memories.size + 1.0) - 0.5 * np.log(x.size)
    yield 0.0, white
    for memory in memories:
        yield prior, np.exp(-distance / memory)
    yield prior, _flicker(distance) + 1e-9 * white


def _flicker(distance: Array) -> Array:
    """Return the covariance of noise with the density 1/f up to the Nyquist frequency.

    From f0 to 1/2 a sample it is Ci(pi h) - Ci(2 pi f0 h) at the distance h, where f0 h is small.
    """
    f0 = 1.0 / (_CUTOFF * distance.max())
    h = np.where(distance > 0.0, distance, 1.0)
    apart = sici(np.pi * h)[1] - np.euler_gamma - np.log(2.0 * np.pi * f0 * h)
    return np.where(distance > 0.0, apart, np.log(0.5 / f0))


def _groups(
    shapes: _Shapes, noises: Sequence[tuple[float, Any]], x: Array, values: Array
) -> list[_Group]:
    """Fit all combinations of shapes and noises, and weigh them."""
    columns = np.column_stack([shapes.columns(x), values])
    plain = columns.T @ columns
    fits = []
    for prior, root in noises:
        white = solve_triangular(root, columns, lower=True)
        prior = prior - float(np.log(np.diag(root)).sum())
        for design in shapes.designs():
            fits.append(_fit(white.T @ white, plain, design, prior, x.size))
    top = max(one.weight.max() for one in fits)
    total = sum(np.exp(one.weight - top).sum() for one in fits)
    found = []
    for one in fits:
        weight = np.exp(one.weight - top)
        kept = weight > _NEGLIGIBLE
        if kept.any():
            arrays = (one.columns[kept], one.coefficients[kept], one.covariance[kept])
            found.append(_Group(weight[kept] / total, *arrays, one.freedom))
    return found


def _fit(normal: Array, plain: Array, design: Indices, prior: float, n: int) -> _Group:
    """Fit models by normal matrices of all columns, whitened and plain; the last is the data.

    Falls are as likely as none, and their coefficient has the prior of one value (unit
    information: Kass and Wasserman, J. Am. Stat. Assoc. 90, 1995).
    """
    rows, across = design[:, :, None], design[:, None, :]
    matrix = normal[rows, across]
    p = design.shape[1]
    inverse = np.linalg.inv(matrix)
    coefficients = np.einsum("kpq,kq->kp", inverse, normal[design, -1])
    power = normal[-1, -1]
    squares = power - np.sum(coefficients * normal[design, -1], axis=1)
    squares = np.maximum(squares, _EXACT * power)
    volume = np.linalg.slogdet(plain[rows, across])[1] - np.linalg.slogdet(matrix)[1]
    falls = (p - 2) * (0.5 * np.log(n) + np.log(_FALLS))
    weight = prior + 0.5 * volume - 0.5 * (n - 2) * np.log(squares) - falls
    freedom = n - p
    return _Group(
        weight, design, coefficients, inverse * (squares / freedom)[:, None, None], freedom
    )
