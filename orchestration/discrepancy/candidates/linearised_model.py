"""A fitted model, linear in its coordinates: the improvement that a change would bring to a fit.

The colour of the noise is estimated anew from what the change leaves, not from what the model
without it does: a slow effect looks like noise with a long memory to a model that has no state for
it. Products of residual, Jacobian and changes at the first few lags, with those near the ends of a
stretch apart, are all that the exact likelihood takes, in whatever colour (Box, Jenkins, Reinsel:
Time Series Analysis, appendix A7.4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Effect
from fmus.kit.arrays import Array, Mask
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.candidates.score_test import ScoreDirections
from orchestration.identify.noise import ORDER, Noise, yule_walker
from orchestration.identify.uncertainty import parameter_covariance

_ROUNDS = 3  # of solving with a colour and estimating the colour from what remains
# Relative to the curvature. Where a fit starts depends on it, and so does, where a model has
# several optima, in which of them it ends: with a third or three times as much, another of two
# close alternatives is named first.
_RIDGE = 1e-9
_FLAT = 1e-10  # share of a change that the model could not make itself, below which there is none


@dataclass(frozen=True)
class PredictedImprovement:
    """The improvement that is expected of a fit.

    Attributes
    ----------
    fall : float
        Of the information criterion, the change costing nothing.
    beyond : float
        The same, beyond what a further step of the model itself would gain.
    amount : float
        Of the change that is put to use.
    step : ndarray, shape (p,)
        Of the searched coordinates of the model, beside it.
    """

    fall: float
    beyond: float
    amount: float
    step: Array


@dataclass(frozen=True)
class ScreenedCandidate:
    """An effect that may be worth a fit.

    Attributes
    ----------
    below : FittedCandidate
        The model that it is laid over, from which the fit starts.
    effect : type[Effect]
    start : dict of str to float
        Its parameters where the fit starts, SI.
    predicted : PredictedImprovement
    """

    below: FittedCandidate
    effect: type[Effect]
    start: dict[str, float]
    predicted: PredictedImprovement


@dataclass(frozen=True)
class _Products:
    """Products of columns at lags and depths, each the sum of both orders of the two.

    Attributes
    ----------
    own : ndarray, shape (products, 1 + p, 1 + p)
        Of the residual, first, and the Jacobian; see `_PLACES`.
    cross : ndarray, shape (products, 1 + p, k)
        Of these with k changes.
    changes : ndarray, shape (products, k)
        Of every change with itself.
    """

    own: Array
    cross: Array
    changes: Array

    def whitened(self, noise: Noise) -> _Products:
        """Return the products in units of innovations, in one lag."""
        weights = _weights(noise.coefficients) / noise.deviation**2
        own, cross, changes = (
            np.tensordot(weights, part, axes=1)[np.newaxis]
            for part in (self.own, self.cross, self.changes)
        )
        return _Products(own, cross, changes)

    def one(self, k: int) -> _Products:
        """Return the products of one change."""
        return replace(self, cross=self.cross[:, :, k : k + 1], changes=self.changes[:, k : k + 1])

    def remaining(self, amount: float, step: Array) -> Array:
        """Return the products (products,) of the residual after a step and some of one change."""
        v = np.append(1.0, step)
        own = np.einsum("i,lij,j->l", v, self.own, v)
        cross = self.cross[:, :, 0] @ v
        return np.asarray(own + 2.0 * amount * cross + amount**2 * self.changes[:, 0])


@dataclass(frozen=True)
class _Solution:
    """Least squares for amounts of k changes, each by itself beside the model's own coordinates."""

    gradient: Array  # (p,)
    spread: Array  # (p, p)
    along: Array  # (p, k): steps that make as much of the changes as the model can
    power: Array  # (k,): of what it cannot
    wanted: Array  # (k,): product of that with the residual


class LinearisedModel:
    """A fitted model, linear in its searched coordinates.

    Parameters
    ----------
    model : FittedCandidate
    """

    def __init__(self, model: FittedCandidate):
        problem = model.problem
        fit = model.fit
        self._problem = problem
        self._fit = fit
        error, jacobian = problem.evaluate(fit.q)
        self._size = {o: max(float(np.sqrt(np.mean(e**2))), 1e-30) for o, e in error.items()}
        # what is far out in heavy tails counts less, and an effect may show there alone
        self._rows = {o: np.sqrt(fit.weights[o] / fit.weights[o].max()) for o in error}
        self._columns = {
            o: self._padded(o, np.column_stack([e, jacobian[o]])) for o, e in error.items()
        }
        self._pairs = {o: _pairs(self._padded(o, np.ones((e.size, 1)))) for o, e in error.items()}
        self._own = {o: _lagged(x, x, self._pairs[o], _each) for o, x in self._columns.items()}
        prior_mean = problem.position(problem.start)
        self._centre = np.where(fit.prior_precision > 0.0, prior_mean, fit.q)
        self._gradient_of_prior = fit.prior_precision * (fit.q - self._centre)
        low, high = problem.bounds()
        self._bounds = low - fit.q, high - fit.q
        self._white = {o: Noise(np.empty(0), size) for o, size in self._size.items()}

    def _padded(self, output: str, values: NDArray[Any]) -> Array:
        """Return columns (n, k) over the whole record, zero where nothing counts."""
        present: Mask = self._problem.present[output]
        whole = np.zeros((len(present), values.shape[1]))
        whole[present] = values * self._rows[output][:, np.newaxis]
        return whole

    def products(self, change: Mapping[str, NDArray[Any]]) -> dict[str, _Products]:
        """Return the products with changes (m, k), by output."""
        products = {}
        for o, own in self._own.items():
            columns = self._padded(o, change[o])
            cross = _lagged(self._columns[o], columns, self._pairs[o], _each)
            squares = _lagged(columns, columns, self._pairs[o], _itself)
            products[o] = _Products(own, cross, squares)
        return products

    def _solved(self, products: Mapping[str, _Products], noise: Mapping[str, Noise]) -> _Solution:
        """Project changes away from the model's own coordinates, in one noise."""
        white = [products[o].whitened(n) for o, n in noise.items()]
        own = np.sum([w.own[0] for w in white], axis=0)
        cross = np.sum([w.cross[0] for w in white], axis=0)
        changes = np.sum([w.changes[0] for w in white], axis=0)
        information = own[1:, 1:]
        ridge = _RIDGE * (np.diag(information) + self._fit.prior_precision)
        spread = parameter_covariance(information, self._fit.prior_precision + ridge).matrix
        along = spread @ cross[1:]
        power = changes - 2.0 * np.sum(cross[1:] * along, axis=0)
        power += np.sum(along * (information @ along), axis=0)
        power = np.where(power > _FLAT * changes, power, 0.0)
        return _Solution(own[1:, 0], spread, along, power, cross[0] - along.T @ own[1:, 0])

    def score_statistics(self, directions: ScoreDirections) -> list[Array]:
        """Return the fall of the sum of squares with some of each change, in two kinds of noise.

        Returns
        -------
        list of ndarray, shape (k,)
            In the noise as estimated, and in white noise.
        """
        products = self.products(directions.gradient)
        least = np.array([one.least for one in directions.settings])
        most = np.array([one.most for one in directions.settings])
        falls = []
        for noise in (self._fit.noise, self._white):
            solved = self._solved(products, noise)
            with np.errstate(divide="ignore", invalid="ignore"):
                amount = np.clip(np.nan_to_num(-solved.wanted / solved.power), least, most)
            fall = -amount * (2.0 * solved.wanted + amount * solved.power)
            falls.append(np.where(solved.power > 0.0, fall, 0.0))
        return falls

    def identifiable_shares(self, directions: ScoreDirections) -> Array:
        """Return the share (k,) of changes, in power, that own coordinates cannot make."""
        products = self.products(directions.gradient)
        changes = sum(products[o].whitened(n).changes[0] for o, n in self._white.items())
        power = self._solved(products, self._white).power
        return np.asarray(np.divide(power, changes, out=np.zeros_like(power), where=changes > 0.0))

    def confounded_shares(self, one: ScoreDirections, k: int) -> Callable[[ScoreDirections], Array]:
        """Return a function of other changes: the shares of one change that they make, in power.

        Of all changes only what the model's own coordinates cannot make counts.
        """
        mine = {o: g[:, k : k + 1] for o, g in one.gradient.items()}
        own_products = self.products(mine)
        own = self._solved(own_products, self._white)
        columns = {o: self._padded(o, g)[:, 0] for o, g in mine.items()}

        def shares(other: ScoreDirections) -> Array:
            products = self.products(other.gradient)
            solved = self._solved(products, self._white)
            common = np.zeros(len(other.settings))
            for o, column in columns.items():
                common += column @ self._padded(o, other.gradient[o]) / self._size[o] ** 2
            cross = sum(own_products[o].whitened(n).cross[0] for o, n in self._white.items())
            common -= np.asarray(cross)[1:, 0] @ solved.along
            power = own.power[0] * solved.power
            return np.asarray(
                np.divide(common**2, power, out=np.zeros_like(power), where=power > 0.0)
            )

        return shares

    def predicted_improvement(self, directions: ScoreDirections, k: int) -> PredictedImprovement:
        """Solve for an amount of a change, within bounds, beside the model's own coordinates."""
        change = {o: g[:, k : k + 1] for o, g in directions.gradient.items()}
        setting = directions.settings[k]
        criterion, amount, step = self._improved(self.products(change), setting.least, setting.most)
        present, own = self._without_change
        return PredictedImprovement(
            present - criterion, min(present, own) - criterion, amount, step
        )

    def _improved(
        self, products: Mapping[str, _Products], least: float, most: float
    ) -> tuple[float, float, Array]:
        """Return the criterion with some of a change, its amount, and the step beside it."""
        noise: Mapping[str, Noise] = self._white
        for _ in range(_ROUNDS):
            solved = self._solved(products, noise)
            total = solved.gradient + self._gradient_of_prior
            along = solved.along[:, 0]
            wanted = solved.wanted[0] - along @ self._gradient_of_prior
            power = solved.power[0] + self._fit.prior_precision @ along**2
            amount = -wanted / power if solved.power[0] > 0.0 else 0.0
            amount = float(np.clip(amount, least, most))
            step = np.clip(-solved.spread @ total - amount * along, *self._bounds)
            noise = self._noise(products, amount, step)
        return self._criterion(noise, step), amount, step

    def _noise(
        self, products: Mapping[str, _Products], amount: float, step: Array
    ) -> dict[str, Noise]:
        """Return the noise that would remain."""
        noise = {}
        for o, own in products.items():
            n = len(self._rows[o])
            remaining = own.remaining(amount, step) / max(n, 1)
            coefficients = self._problem.colour.get(o)
            if coefficients is None:
                order = min(self._problem.order, ORDER)
                covariance = 0.5 * np.add.reduceat(remaining, _FIRST)
                coefficients, _ = yule_walker(covariance[: order + 1], n)
            variance = float(_weights(coefficients) @ remaining)
            noise[o] = Noise(coefficients, max(variance, 1e-60) ** 0.5)
        return noise

    @cached_property
    def _without_change(self) -> tuple[float, float]:
        """Criterion of the model as it stands, and after a further step by itself."""
        nothing = {
            o: _Products(x, np.zeros((*x.shape[:2], 1)), np.zeros((len(x), 1)))
            for o, x in self._own.items()
        }
        stays = np.zeros(len(self._fit.q))
        present = self._criterion(self._noise(nothing, 0.0, stays), stays)
        return present, self._improved(nothing, 0.0, 0.0)[0]

    def _criterion(self, noise: Mapping[str, Noise], step: Array) -> float:
        """Return BIC, the change costing nothing, up to a constant."""
        fit = self._fit
        moved = fit.q + step - self._centre
        order = sum(len(n.coefficients) for n in noise.values())
        deviance = sum(
            2.0 * len(self._rows[o]) * float(np.log(n.deviation)) for o, n in noise.items()
        )
        penalty = float(fit.prior_precision @ moved**2) + order * float(np.log(fit.samples))
        return deviance + penalty


# Lag and depth of every product: how far both samples are from the ends of their stretch, up to
# where it makes no difference.
_PLACES = [(lag, depth) for lag in range(ORDER + 1) for depth in range(ORDER - lag + 1)]
_FIRST = [_PLACES.index((lag, 0)) for lag in range(ORDER + 1)]


def _weights(coefficients: Array) -> Array:
    """Return the weight of every product in the sum of squares of innovations."""
    filtered = np.zeros(ORDER + 1)
    filtered[0] = 1.0
    filtered[1 : len(coefficients) + 1] = -coefficients
    weights = [filtered[: d + 1] @ filtered[lag : lag + d + 1] for lag, d in _PLACES]
    weights[0 : ORDER + 1] = [0.5 * one for one in weights[0 : ORDER + 1]]
    return np.array(weights)


def _pairs(counts: Array) -> list[list[NDArray[np.intp]]]:
    """Return by lag the first samples of pairs that are special: of two stretches, and by depth.

    Parameters
    ----------
    counts : ndarray, shape (n, 1)
        Zero where a sample counts for nothing.
    """
    present = counts[:, 0] > 0.0
    n = len(present)
    places = np.arange(n)
    before = np.maximum.accumulate(np.where(present, -1, places))
    after = np.minimum.accumulate(np.where(present, n, places)[::-1])[::-1]
    pairs = []
    for lag in range(ORDER + 1):
        first = np.flatnonzero(present[: n - lag] & present[lag:])
        depth = np.minimum(first - before[first] - 1, after[first + lag] - first - lag - 1)
        apart = before[first] != before[first + lag]
        groups = [first[apart]]
        groups += [first[~apart & (depth == d)] for d in range(ORDER - lag)]
        pairs.append(groups)
    return pairs


def _lagged(
    one: Array,
    other: Array,
    pairs: list[list[NDArray[np.intp]]],
    product: Callable[[Array, Array], Array],
) -> Array:
    """Return the products of columns (n, k) and (n, m), both orders together; see `_PLACES`."""
    n = len(one)
    products = []
    for lag, groups in enumerate(pairs):
        whole = product(one[: n - lag], other[lag:]) + product(one[lag:], other[: n - lag])
        parts = [product(one[i], other[i + lag]) + product(one[i + lag], other[i]) for i in groups]
        products += [*parts[1:], whole - np.sum(parts, axis=0)]
    return np.array(products)


def _each(one: Array, other: Array) -> Array:
    """Return the products (k, m) of every column with every other."""
    return one.T @ other


def _itself(one: Array, other: Array) -> Array:
    """Return the products (k,) of every column with the same one."""
    return np.asarray(np.einsum("nk,nk->k", one, other))


def strongest(statistics: Sequence[Array]) -> list[int]:
    """Return the places of the largest score in every kind of noise, each once."""
    return list(dict.fromkeys(int(np.argmax(one)) for one in statistics if len(one)))
