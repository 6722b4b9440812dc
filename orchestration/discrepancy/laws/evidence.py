"""Evidence for a curve in a model that is linear in it, by a Gaussian process over the signal.

The straight part of a curve, and a step at zero, may be anything and have the price of BIC, the
logarithm of the samples; the bending part is an integrated Wiener process (Wahba, JRSS B 40, 1978),
whose size is the likeliest one (Kass, Raftery, JASA 90, 1995). What the parameters of the model can
do is no part of a curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fmus.kit import slopes
from fmus.kit.arrays import Array

KNOTS = 16  # of a curve of a signal as it is
FEW = 6  # of a curve of what is remembered
_NEAR = 0.005  # of the range, within which a curve may step at zero
# of the bending part, as precision of the data over that of the prior
_SIZES = np.geomspace(1e-2, 1e8, 11)
# share that the model's parameters leave of a constant, slope or step, below which it is theirs
_OWN = 1e-3
_FEWEST = 4  # knots, above which there may be a step
# times that of one sample, the variance of what may be anything: a strong effect costs no more than
# a weak
_FLAT = 1e4


# of the band of a curve: share of curves that it holds, deviations where all points go together,
# curves that are drawn, and points that are evaluated from one knot to the next
_CURVES = 0.95
_LEAST_DEVIATIONS = 1.96
_DRAWS = 2000
_POINTS_BETWEEN = 4


@dataclass(frozen=True)
class Basis:
    """A curve through values at knots: cubic in between, and straight on beyond the ends.

    It is that of :func:`~fmus.kit.functions.smooth_table`, whose corners would cost a simulation
    many steps.

    Attributes
    ----------
    knots : ndarray, shape (k,)
        Rising, in the unit of the signal.
    """

    knots: Array

    @classmethod
    def over(cls, values: Array, count: int = KNOTS, stepped: bool = True) -> Basis:
        """Place knots between the extremes, denser where a signal has been more often.

        Parameters
        ----------
        values : ndarray, shape (n,)
            Of the signal.
        count : int
            Of knots.
        stepped : bool
            Whether knots near zero come to these where the signal goes through it, so that there
            may be a step.

        Returns
        -------
        Basis
        """
        several = np.unique(values)
        # values of which round-off is all that differs are one: between them no curve has a slope
        apart = np.diff(several) > np.finfo(float).eps * (several[-1] - several[0])
        several = np.append(several[:-1][apart], several[-1])
        several[0] = values.min()
        if len(several) <= count:
            return cls(several)
        shares = np.linspace(0.0, 1.0, count)
        low, high = several[0], several[-1]
        knots = 0.5 * (low + shares * (high - low) + np.quantile(values, shares))
        knots[[0, -1]] = low, high  # whatever was rounded
        near = _NEAR * (high - low)
        if stepped and low < -near and high > near:
            knots = np.concatenate([knots[np.abs(knots) > 2.0 * near], [-near, 0.0, near]])
        return cls(np.unique(np.clip(knots, low, high)))

    def __call__(self, values: Array) -> Array:
        """Evaluate the curves through 1 at a knot and 0 at the others.

        Parameters
        ----------
        values : ndarray, shape (n,)
            Of the signal.

        Returns
        -------
        ndarray, shape (n, k)
            Whose product with values at the knots is the curve.
        """
        knots = self.knots
        unit = np.eye(len(knots))
        if len(knots) < 2:
            return np.ones((len(values), 1))
        rise, fall = self._slopes
        k = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
        width = (knots[k + 1] - knots[k])[:, None]
        inside = np.clip(values, knots[0], knots[-1])
        s = (inside - knots[k])[:, None] / width
        more = (values - inside)[:, None] * np.where(values[:, None] < knots[0], rise[0], fall[-1])
        bend = s * s * (3.0 - 2.0 * s)
        ends = (1.0 - bend) * unit[k] + bend * unit[k + 1]
        return np.asarray(ends + width * s * (1.0 - s) * ((1.0 - s) * rise[k] - s * fall[k]) + more)

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        """Slopes (k - 1, k) at both ends of each interval, per value at the knots."""
        ends = slopes([float(x) for x in self.knots], list(np.eye(len(self.knots))))
        return np.array([rise for rise, _ in ends]), np.array([fall for _, fall in ends])

    @cached_property
    def plain(self) -> list[Array]:
        """Constant and slope, (k, 2), and the same with a step at an inner zero, (k, 3)."""
        straight = np.column_stack([np.ones(len(self.knots)), self._unit - 0.5])
        if not (self.knots[0] < 0.0 < self.knots[-1] and len(self.knots) > _FEWEST):
            return [straight]
        return [straight, np.column_stack([straight, np.sign(self.knots)])]

    @cached_property
    def bending(self) -> Array:
        """Covariance (k, k) of an integrated Wiener process without its straight part."""
        return np.asarray(self._process / self._power)

    def left_between(self, values: Array) -> Array:
        """Return the covariance of such a process given its values at the knots.

        Parameters
        ----------
        values : ndarray, shape (v,)
            Of the signal.

        Returns
        -------
        ndarray, shape (v, v)
            Beside that of `bending`.
        """
        knots = self._unit
        places = self._relative(values)
        columns = self(values)
        across = columns @ _wiener(knots, places)
        of_knots = columns @ _wiener(knots, knots) @ columns.T
        remaining = _wiener(places, places) - across - across.T + of_knots
        return np.asarray(remaining / self._power)

    @cached_property
    def _process(self) -> Array:
        straight = self.plain[0]
        if len(straight) <= straight.shape[1]:
            return np.zeros((len(straight), len(straight)))  # a line goes through any two points
        project = np.eye(len(straight)) - straight @ np.linalg.pinv(straight)
        return np.asarray(project @ _wiener(self._unit, self._unit) @ project.T)

    @property
    def _power(self) -> float:
        return max(float(np.trace(self._process)) / len(self.knots), 1e-300)

    @property
    def _unit(self) -> Array:
        """Knots from 0 to 1."""
        return self._relative(self.knots)

    def _relative(self, values: Array) -> Array:
        """Return values relative to the ends, from 0 to 1; beyond these a curve is straight."""
        first, last = self.knots[0], self.knots[-1]
        return np.asarray((np.clip(values, first, last) - first) / (last - first))


def _wiener(one: Array, other: Array) -> Array:
    """Return the covariance (a, b) of an integrated Wiener process at times (a,) and (b,)."""
    low = np.minimum(one[:, None], other)
    high = np.maximum(one[:, None], other)
    return np.asarray(low**2 * (3.0 * high - low) / 6.0)


@dataclass(frozen=True)
class Curve:
    """A curve at its knots, as a linear model estimates it.

    Attributes
    ----------
    gain : float
        Twice the logarithm of the evidence against none, less the logarithm of the samples for a
        size of the bending part that was chosen: a fall of BIC, as far as that is one.
    values : ndarray, shape (k,)
        Likeliest values, in the unit of the law.
    covariance : ndarray, shape (k, k)
        Of the values.
    prior : ndarray, shape (k, k)
        Covariance that the values were expected to have.
    complexity : float
        By how much the gain is less than what the curve explains: the price of being able to bend
        so far.
    bending : float
        Mean variance at the knots that the bending part was expected to have.
    """

    gain: float
    values: Array
    covariance: Array
    prior: Array
    complexity: float
    bending: float = 0.0


@dataclass(frozen=True)
class RegressorColumns:
    """Effect of the knots of a curve on the whitened outputs, as products of these columns.

    Attributes
    ----------
    basis : Basis
        Of k knots.
    free : ndarray, shape (k, k)
        Of the columns, free of what the model's own parameters can do; per squared unit of the law.
    alone : ndarray, shape (k, k)
        Of the columns as they are.
    samples : int
        That the columns have.
    """

    basis: Basis
    free: Array
    alone: Array
    samples: int

    def best(self, score: Array) -> Curve:
        """Find the likeliest curve.

        Parameters
        ----------
        score : ndarray, shape (k,)
            Products of the free columns with what is to be explained, in noise of unit variance.

        Returns
        -------
        Curve
        """
        return self._stack.best(score[None])[0]

    def by_chance(self, scores: Array) -> Array:
        """Return the gains of the likeliest curves in mere noise.

        Parameters
        ----------
        scores : ndarray, shape (k, b)
            Products of the free columns with b draws of noise.

        Returns
        -------
        ndarray, shape (b,)
        """
        return np.asarray(self._stack.by_chance(scores[None])[0])

    @cached_property
    def _stack(self) -> RegressorStack:
        return RegressorStack([self.basis], self.free[None], self.alone[None], self.samples)


@dataclass(frozen=True)
class RegressorStack:
    """The same for several curves at once, each by itself.

    Attributes
    ----------
    bases : sequence of Basis
        The s of them are of k knots each, and have as many `plain` parts.
    free, alone : ndarray, shape (s, k, k)
    samples : int
        See `RegressorColumns`.
    """

    bases: Sequence[Basis]
    free: Array
    alone: Array
    samples: int

    def best(self, scores: Array) -> list[Curve]:
        """Find the likeliest curve of each, from scores (s, k)."""
        covariances, priors, prices, sizes = self._choices
        across = (covariances @ scores[:, None, :, None])[..., 0]
        gains = np.einsum("si,sci->sc", scores, across) - prices
        chosen = enumerate(np.argmax(gains, axis=1).tolist())
        return [
            Curve(
                float(gains[s, c]),
                across[s, c].copy(),  # of all choices one is kept
                covariances[s, c].copy(),
                priors[s, c].copy(),
                float(prices[s, c]),
                float(sizes[s, c]),
            )
            for s, c in chosen
        ]

    def by_chance(self, scores: Array) -> Array:
        """Return the gains (s, b) of the likeliest curves in mere noise, from scores (s, k, b)."""
        covariances, _, prices, _ = self._choices
        several = scores[:, None]
        explained = np.sum(several * (covariances @ several), axis=2)
        return np.asarray((explained - prices[:, :, None]).max(axis=1))

    @cached_property
    def _choices(self) -> tuple[Array, Array, Array, Array]:
        """Covariances after and before (s, c, k, k), prices (s, c), sizes of the bending part."""
        bending = np.array([basis.bending for basis in self.bases])
        count = bending.shape[-1]
        power = self._power(bending)
        # where nothing can bend the choices are all of no size, and the first of them is taken
        bends = power > 0.0
        of_bends = np.where(bends[:, None], _SIZES / np.where(bends, power, 1.0)[:, None], 0.0)
        sizes = np.column_stack([np.zeros(len(bends)), of_bends])
        parts = zip(*(basis.plain for basis in self.bases), strict=True)
        plain, free = zip(*(self._prior(np.array(part)) for part in parts), strict=True)
        bent = sizes[:, :, None, None] * bending[:, None]
        priors = np.concatenate([part[:, None] + bent for part in plain], axis=1)
        inner = np.eye(count) + self.free[:, None] @ priors
        paid = np.tile(np.where(sizes > 0.0, np.log(self.samples), 0.0), len(plain))
        paid -= np.repeat(np.column_stack(free), sizes.shape[1], axis=1) * np.log(_FLAT)
        covariances = np.linalg.solve(inner.swapaxes(2, 3), priors).swapaxes(2, 3)
        prices = np.linalg.slogdet(inner)[1] + paid
        return covariances, priors, prices, np.tile(sizes, len(plain))

    def _power(self, bending: Array) -> Array:
        """Return the mean effects (s,) of unit bends (s, k, k), 0 where they are all round-off."""
        total = np.einsum("sij,sji->s", self.free, bending)
        largest = np.trace(self.free, axis1=1, axis2=2) * np.trace(bending, axis1=1, axis2=2)
        return np.where(total > np.finfo(float).eps * largest, total / bending.shape[-1], 0.0)

    def _prior(self, part: Array) -> tuple[Array, Array]:
        """Return vague prior covariances (s, k, k), outside the model's own space, and ranks (s,).

        Parameters
        ----------
        part : ndarray, shape (s, k, j)
            Plain part of each basis.
        """
        turned = part.swapaxes(1, 2)
        free, alone = (turned @ each @ part for each in (self.free, self.alone))
        least = 1e-12 * np.trace(alone, axis1=1, axis2=2) + 1e-300
        # the generalised eigenvalues are those of one matrix in coordinates in which the other is 1
        lower = np.linalg.cholesky(alone + least[:, None, None] * np.eye(alone.shape[-1]))
        half = np.linalg.solve(lower, free)
        share, axes = np.linalg.eigh(np.linalg.solve(lower, half.swapaxes(1, 2)))
        seen = share > _OWN
        weight = np.where(seen, _FLAT * self.samples / np.where(seen, share, 1.0), 0.0)
        directions = part @ np.linalg.solve(lower.swapaxes(1, 2), axes)
        prior = (directions * weight[:, None]) @ directions.swapaxes(1, 2)
        return prior, seen.sum(axis=1)


class Band:
    """A curve with its 95 % band, in the unit of the law.

    The band holds the whole curve in 19 records of 20, rather than each of its points (Krivobokova,
    Kneib, Claeskens, JASA 105, 2010): its width is a multiple of the standard deviation that is
    drawn for all points at once.

    Parameters
    ----------
    basis : Basis
    curve : Curve
    """

    def __init__(self, basis: Basis, curve: Curve):
        self._basis = basis
        self._curve = curve
        knots = basis.knots
        shares = np.arange(_POINTS_BETWEEN) / _POINTS_BETWEEN
        points = np.append((knots[:-1, None] + shares * np.diff(knots)[:, None]).ravel(), knots[-1])
        self._deviations = _deviations(self._covariance(points))

    def __call__(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the curve, and the ends of its band, at values (v,) of the signal."""
        values = self._basis(x) @ self._curve.values
        spread = self._deviations * np.sqrt(np.clip(np.diag(self._covariance(x)), 0.0, None))
        return values, values - spread, values + spread

    def _covariance(self, x: Array) -> Array:
        columns = self._basis(x)
        return np.asarray(
            columns @ self._curve.covariance @ columns.T
            + self._curve.bending * self._basis.left_between(x)
        )


def _deviations(covariance: Array) -> float:
    """Return the number of standard deviations that hold all points of 19 curves of 20."""
    variance, axes = np.linalg.eigh(covariance)
    size = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    is_open = size > 0.0
    if not is_open.any():
        return _LEAST_DEVIATIONS
    draws = np.random.default_rng(0).standard_normal((len(size), _DRAWS))
    curves = (axes * np.sqrt(np.clip(variance, 0.0, None))) @ draws
    furthest = np.abs(curves[is_open] / size[is_open, None]).max(axis=0)
    return float(max(np.quantile(furthest, _CURVES), _LEAST_DEVIATIONS))
