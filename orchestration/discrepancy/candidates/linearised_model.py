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
from fmus.kit.arrays import Array, Indices, Mask
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

    def one(self, k: int) -> _Products:
        """Return the products of one change."""
        return replace(self, cross=self.cross[:, :, k : k + 1], changes=self.changes[:, k : k + 1])

    def remaining(self, amount: float, step: Array) -> Array:
        """Return the products (products,) of the residual after a step and some of one change."""
        v = np.append(1.0, step)
        own = self.own @ v @ v
        cross = self.cross[:, :, 0] @ v
        return np.asarray(own + 2.0 * amount * cross + amount**2 * self.changes[:, 0])


@dataclass(frozen=True)
class _Coordinates:
    """Least squares for the model's own coordinates, in one noise."""

    weights: dict[str, Array]  # (products,), by output: they whiten
    gradient: Array  # (p,)
    information: Array  # (p, p)
    spread: Array  # (p, p)


@dataclass(frozen=True)
class _Solution:
    """Least squares for amounts of k changes, each by itself beside the model's own coordinates."""

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
        self._lagged = {
            o: _Lagged(
                self._padded(o, np.column_stack([e, jacobian[o]])),
                self._padded(o, np.ones((e.size, 1)))[:, 0] > 0.0,
            )
            for o, e in error.items()
        }
        self._products: dict[ScoreDirections, dict[str, _Products]] = {}
        prior_mean = problem.position(problem.start)
        self._centre = np.where(fit.prior_precision > 0.0, prior_mean, fit.q)
        self._gradient_of_prior = fit.prior_precision * (fit.q - self._centre)
        low, high = problem.bounds()
        self._bounds = low - fit.q, high - fit.q
        white = {o: Noise(np.empty(0), size) for o, size in self._size.items()}
        self._in_white = self._coordinates(white)
        self._in_colour = self._coordinates(fit.noise)

    def _padded(self, output: str, values: NDArray[Any]) -> Array:
        """Return columns (n, k) over the whole record, zero where nothing counts."""
        present: Mask = self._problem.present[output]
        # every column in one piece, as products with itself read it
        whole = np.zeros((len(present), values.shape[1]), order="F")
        whole[present] = values * self._rows[output][:, np.newaxis]
        return whole

    def products(self, directions: ScoreDirections) -> dict[str, _Products]:
        """Return the products with changes, by output; they are computed once."""
        if directions not in self._products:
            self._products[directions] = {
                o: lagged.products(self._padded(o, directions.gradient[o]))
                for o, lagged in self._lagged.items()
            }
        return self._products[directions]

    def _coordinates(self, noise: Mapping[str, Noise]) -> _Coordinates:
        """Solve for the model's own coordinates, in one noise."""
        weights = {o: _weights(n.coefficients) / n.deviation**2 for o, n in noise.items()}
        own = _weighed(weights, {o: x.own for o, x in self._lagged.items()})
        information = own[1:, 1:]
        ridge = _RIDGE * (np.diag(information) + self._fit.prior_precision)
        spread = parameter_covariance(information, self._fit.prior_precision + ridge).matrix
        return _Coordinates(weights, own[1:, 0], information, spread)

    def _solved(self, products: Mapping[str, _Products], own: _Coordinates) -> _Solution:
        """Project changes away from the model's own coordinates, in one noise."""
        cross = _weighed(own.weights, {o: x.cross for o, x in products.items()})
        changes = _weighed(own.weights, {o: x.changes for o, x in products.items()})
        along = own.spread @ cross[1:]
        power = changes - 2.0 * np.sum(cross[1:] * along, axis=0)
        power += np.sum(along * (own.information @ along), axis=0)
        power = np.where(power > _FLAT * changes, power, 0.0)
        return _Solution(along, power, cross[0] - along.T @ own.gradient)

    def score_statistics(self, directions: ScoreDirections) -> list[Array]:
        """Return the fall of the sum of squares with some of each change, in two kinds of noise.

        Returns
        -------
        list of ndarray, shape (k,)
            In the noise as estimated, and in white noise.
        """
        products = self.products(directions)
        least = np.array([one.least for one in directions.settings])
        most = np.array([one.most for one in directions.settings])
        falls = []
        for own in (self._in_colour, self._in_white):
            solved = self._solved(products, own)
            with np.errstate(divide="ignore", invalid="ignore"):
                amount = np.clip(np.nan_to_num(-solved.wanted / solved.power), least, most)
            fall = -amount * (2.0 * solved.wanted + amount * solved.power)
            falls.append(np.where(solved.power > 0.0, fall, 0.0))
        return falls

    def identifiable_shares(self, directions: ScoreDirections) -> Array:
        """Return the share (k,) of changes, in power, that own coordinates cannot make."""
        products = self.products(directions)
        changes = _weighed(self._in_white.weights, {o: x.changes for o, x in products.items()})
        power = self._solved(products, self._in_white).power
        return np.asarray(np.divide(power, changes, out=np.zeros_like(power), where=changes > 0.0))

    def confounded_shares(self, one: ScoreDirections, k: int) -> Callable[[ScoreDirections], Array]:
        """Return a function of other changes: the shares of one change that they make, in power.

        Of all changes only what the model's own coordinates cannot make counts.
        """
        products = _of_one(self.products(one), k)
        mine = self._solved(products, self._in_white)
        cross = _weighed(self._in_white.weights, {o: x.cross for o, x in products.items()})[1:, 0]
        columns = {
            o: g[:, k] * (self._rows[o] / self._size[o]) ** 2 for o, g in one.gradient.items()
        }

        def shares(other: ScoreDirections) -> Array:
            solved = self._solved(self.products(other), self._in_white)
            common = sum(column @ other.gradient[o] for o, column in columns.items())
            common = common - cross @ solved.along
            power = mine.power[0] * solved.power
            return np.asarray(
                np.divide(common**2, power, out=np.zeros_like(power), where=power > 0.0)
            )

        return shares

    def predicted_improvement(self, directions: ScoreDirections, k: int) -> PredictedImprovement:
        """Solve for an amount of a change, within bounds, beside the model's own coordinates."""
        setting = directions.settings[k]
        products = _of_one(self.products(directions), k)
        criterion, amount, step = self._improved(products, setting.least, setting.most)
        present, own = self._without_change
        return PredictedImprovement(
            present - criterion, min(present, own) - criterion, amount, step
        )

    def _improved(
        self, products: Mapping[str, _Products], least: float, most: float
    ) -> tuple[float, float, Array]:
        """Return the criterion with some of a change, its amount, and the step beside it."""
        own = self._in_white
        for left in reversed(range(_ROUNDS)):
            solved = self._solved(products, own)
            total = own.gradient + self._gradient_of_prior
            along = solved.along[:, 0]
            wanted = solved.wanted[0] - along @ self._gradient_of_prior
            power = solved.power[0] + self._fit.prior_precision @ along**2
            amount = -wanted / power if solved.power[0] > 0.0 else 0.0
            amount = float(np.clip(amount, least, most))
            step = np.clip(-own.spread @ total - amount * along, *self._bounds)
            noise = self._noise(products, amount, step)
            if left:
                own = self._coordinates(noise)
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
            o: _Products(x.own, np.zeros((*x.own.shape[:2], 1)), np.zeros((len(x.own), 1)))
            for o, x in self._lagged.items()
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


@dataclass(frozen=True)
class ScoredModel:
    """A fitted model with the directions in which effects would move it.

    Attributes
    ----------
    model : FittedCandidate
    directions : dict of type[Effect] to ScoreDirections
    """

    model: FittedCandidate
    directions: dict[type[Effect], ScoreDirections]

    @cached_property
    def linearised(self) -> LinearisedModel:
        """The model, linear in its searched coordinates."""
        return LinearisedModel(self.model)


# Lag and depth of every product: how far both samples are from the ends of their stretch, up to
# where it makes no difference.
_PLACES = [(lag, depth) for lag in range(ORDER + 1) for depth in range(ORDER - lag + 1)]
_FIRST = [_PLACES.index((lag, 0)) for lag in range(ORDER + 1)]
# Lag and depth of the pairs that are apart: of two stretches (-1), and near an end of one.
_GROUPS = [(lag, depth) for lag in range(ORDER + 1) for depth in range(-1, ORDER - lag)]
_GROUP_OF_LAG = [_GROUPS.index((lag, -1)) for lag in range(ORDER + 1)]
_NEAR = [place for place, (_, depth) in enumerate(_GROUPS) if depth >= 0]


def _weights(coefficients: Array) -> Array:
    """Return the weight of every product in the sum of squares of innovations."""
    filtered = np.zeros(ORDER + 1)
    filtered[0] = 1.0
    filtered[1 : len(coefficients) + 1] = -coefficients
    weights = [filtered[: d + 1] @ filtered[lag : lag + d + 1] for lag, d in _PLACES]
    weights[0 : ORDER + 1] = [0.5 * one for one in weights[0 : ORDER + 1]]
    return np.array(weights)


def _weighed(weights: Mapping[str, Array], products: Mapping[str, Array]) -> Array:
    """Return the sum of products (products, ...) of all outputs by their weights."""
    parts = [w @ products[o].reshape(len(w), -1) for o, w in weights.items()]
    shape = next(iter(products.values())).shape
    return np.asarray(np.sum(parts, axis=0)).reshape(shape[1:])


def _of_one(products: Mapping[str, _Products], k: int) -> dict[str, _Products]:
    """Return the products of one change, by output."""
    return {o: of_output.one(k) for o, of_output in products.items()}


class _Lagged:
    """Columns to be multiplied with others at lags and depths; see `_PLACES`.

    Parameters
    ----------
    columns : ndarray, shape (n, j)
        Zero where nothing counts.
    counts : ndarray of bool, shape (n,)
        Where something does.

    Attributes
    ----------
    own : ndarray, shape (products, j, j)
        Products with each other, both orders together.
    """

    def __init__(self, columns: Array, counts: Mask):
        n, self._width = columns.shape
        groups = [_special_pairs(counts, lag) for lag in range(ORDER + 1)]
        pairs = [(first, first + lag) for lag, firsts in enumerate(groups) for first in firsts]
        self._first, self._second = (np.concatenate(side) for side in zip(*pairs, strict=True))
        sizes = [len(first) for first, _ in pairs]
        group = np.repeat(np.arange(len(_GROUPS)), sizes)
        self._in_group = np.equal.outer(np.arange(len(_GROUPS)), group).astype(float)
        self._rows = np.union1d(self._first, self._second)
        # to every row those are added that it is paired with, so that all lags take one product
        near = np.zeros((len(self._rows), len(_GROUPS), self._width))
        for place, sides in enumerate(pairs):
            one, other = np.searchsorted(self._rows, sides)
            near[one, place] += columns[self._rows[other]]
            near[other, place] += columns[self._rows[one]]
        far = np.zeros((n, ORDER + 1, self._width))
        for lag in range(ORDER + 1):
            far[lag:, lag] += columns[: n - lag]
            far[: n - lag, lag] += columns[lag:]
        far[self._rows] -= np.add.reduceat(near, _GROUP_OF_LAG, axis=1)
        self._near = near[:, _NEAR].reshape(len(self._rows), -1)
        self._far = far.reshape(n, -1)
        self.own = self._cross(columns)

    def products(self, others: Array) -> _Products:
        """Return the products with other columns (n, k)."""
        return _Products(self.own, self._cross(others), self._squares(others))

    def _cross(self, others: Array) -> Array:
        """Return the products (products, j, k) with other columns."""
        shape = (self._width, others.shape[1])
        near = (self._near.T @ others[self._rows]).reshape(len(_NEAR), *shape)
        far = (self._far.T @ others).reshape(ORDER + 1, *shape)
        return _by_place(near, far)

    def _squares(self, others: Array) -> Array:
        """Return the products (products, k) of other columns with themselves."""
        n = len(others)
        near = self._in_group @ (others[self._first] * others[self._second])
        whole = [np.einsum("nk,nk->k", others[: n - lag], others[lag:]) for lag in range(ORDER + 1)]
        far = np.array(whole) - np.add.reduceat(near, _GROUP_OF_LAG, axis=0)
        return _by_place(2.0 * near[_NEAR], 2.0 * far)


def _by_place(near: Array, far: Array) -> Array:
    """Return products in the order of `_PLACES`."""
    products = np.empty((len(_PLACES), *far.shape[1:]))
    is_far = np.array([depth == ORDER - lag for lag, depth in _PLACES])
    products[is_far] = far
    products[~is_far] = near
    return products


def _special_pairs(counts: Mask, lag: int) -> list[Indices]:
    """Return the first samples of pairs of two stretches, and by depth of those near an end.

    Parameters
    ----------
    counts : ndarray of bool, shape (n,)
        False where a sample counts for nothing.
    lag : int
    """
    n = len(counts)
    places = np.arange(n)
    before = np.maximum.accumulate(np.where(counts, -1, places))
    after = np.minimum.accumulate(np.where(counts, n, places)[::-1])[::-1]
    first = np.flatnonzero(counts[: n - lag] & counts[lag:])
    depth = np.minimum(first - before[first] - 1, after[first + lag] - first - lag - 1)
    apart = before[first] != before[first + lag]
    return [first[apart], *(first[~apart & (depth == d)] for d in range(ORDER - lag))]


def strongest(statistics: Sequence[Array]) -> list[int]:
    """Return the places of the largest score in every kind of noise, each once."""
    return list(dict.fromkeys(int(np.argmax(one)) for one in statistics if len(one)))
