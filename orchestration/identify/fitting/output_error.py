"""The output-error method: parameters and the white noise of every output, fitted in turn.

The model runs free over the record; its residual is weighted by its size (Ljung: System
Identification, section 7.2). Noise is Gaussian or of Student's t distribution.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import log
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array, Mask
from orchestration.identify.fitting.any_fmu import FmuWithDifferences
from orchestration.identify.fitting.least_squares import Minimum, SearchEndedError, minimise
from orchestration.identify.fitting.problem import Problem
from orchestration.identify.fitting.simulation_error import error_at
from orchestration.identify.noise import Noise, tails
from orchestration.identify.uncertainty import (
    Covariance,
    heteroscedastic,
    parameter_covariance,
    weighted_square,
)

# Fall of the sum of squared innovations, of variance 1, below which a search ends: where rounding
# begins, as the values are the result.
_TOLERANCE = 1e-6
# If its last Gauss-Newton step is longer than this, in searched coordinates, a search with exact
# derivatives goes on to the second tolerance, relative to the sum: steps shrink slowly where a
# model is curved and its residual large.
_PRECISE = 1e-7
_FINE_TOLERANCE = 1e-14
_TRIALS = 200  # points that the search of a pass tries
_PASSES = 5  # of parameters in given noise, and of the noise of the residual
_SETTLED = 1e-3  # fall of BIC from one pass to the next below which no further one is made
_CURVED = 0.1  # of the expected curvature, below which the observed one is chance


@dataclass(frozen=True)
class Pass:
    """The end of a pass, and the noise that is estimated from the residual there.

    Attributes
    ----------
    q : ndarray, shape (p,)
        Searched coordinates.
    converged : bool
        True if the search ended by itself.
    noise : dict of str to Noise
        By output, of the residual.
    residual : dict of str to ndarray, shape (m,)
        Measured minus simulated, SI.
    innovation : dict of str to ndarray, shape (m,)
        The residual over its deviation.
    deviance : float
        Minus twice the log likelihood, up to a constant.
    bic : float
        Bayesian information criterion.
    """

    q: Array
    converged: bool
    noise: dict[str, Noise]
    residual: dict[str, Array]
    innovation: dict[str, Array]
    deviance: float
    bic: float


@dataclass(frozen=True)
class FitResult(Pass):
    """Fitted parameters, noise, residuals and their statistics.

    Attributes
    ----------
    values : dict of str to float
        Parameters by name, SI.
    weights : dict of str to ndarray, shape (m,)
        Weights of innovations; about 1, and small for outliers in heavy tails.
    information : ndarray, shape (p, p)
        Of all innovations on the searched coordinates (Fisher).
    covariance : Covariance
        Of the searched coordinates.
    """

    values: dict[str, float]
    weights: dict[str, Array]
    information: Array
    covariance: Covariance


def fit_output_error(problem: Problem, start: Array) -> FitResult:
    """Fit the searched parameters of a problem, and the noise of its outputs in turn.

    The fit scores at least as well as its start, each in the noise that is estimated there.

    Parameters
    ----------
    problem : Problem
    start : ndarray, shape (p,)
        Searched coordinates to begin with.

    Returns
    -------
    FitResult

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    low, high = problem.bounds()
    at_start = _pass_at_start(problem, np.clip(start, low, high))
    begin = np.clip(_move_off_bounds(problem, start), low, high)
    size = {name: Noise(float(np.nanstd(y)) or 1.0) for name, y in problem.measured.items()}
    size |= problem.given
    best = _iterate(problem, _one_pass(problem, begin, size))
    # tails are estimated by more than the likelihood: passes may end less likely than they begin
    if at_start and at_start.bic < best.bic:
        best = replace(at_start, converged=best.converged)
    return _assess(problem, best)


def _move_off_bounds(problem: Problem, start: Array) -> Array:
    """Return a start off the bounds, where steps of the search would be small.

    A start near a bound may be right: it is moved only if its free run is then no farther from
    the record. A start at a bound is always moved.
    """
    inside = problem.inside(start)
    low, high = problem.bounds()
    only_from_bounds = np.where((start <= low) | (start >= high), inside, start)
    if np.array_equal(inside, only_from_bounds):
        return inside
    return min((inside, only_from_bounds), key=lambda q: error_at(problem, q))


def fit_in_noise(
    problem: Problem, q: Array, noise: Mapping[str, Noise], trials: int
) -> tuple[Array, float]:
    """Fit in noise that is given; return the end, (p,), and the deviance there.

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    end = _minimise(problem, q, noise, trials).q
    return end, problem.deviance(noise, problem.evaluate(end)[0])


def _minimise(
    problem: Problem, q: Array, noise: Mapping[str, Noise], trials: int = _TRIALS
) -> Minimum:
    """Minimise in given noise, and again with other delays as long as that gains.

    Residuals are not smooth where a delay is a whole number of samples: `Problem.smooth_bounds`.
    """
    loss = _Loss(problem, noise, trials)
    best = loss.minimise_smooth(q)
    better: Minimum | None = best
    while better is not None:
        best = better
        found = map(loss.minimise_smooth, problem.other_delays(best.q))
        better = next((one for one in found if loss.cost(one.q) < loss.cost(best.q)), None)
    return loss.refined(best)


@dataclass(frozen=True)
class _Loss:
    """Deviance of the innovations in given noise, as a sum of squares."""

    problem: Problem
    noise: Mapping[str, Noise]
    trials: int

    def cost(self, q: Array) -> float:
        """Return the deviance at a point, but for terms that do not depend on it."""
        return float((self._rows(q) ** 2).sum())

    def minimise_smooth(self, start: Array) -> Minimum:
        """Minimise within the bounds about a start where the residuals are smooth."""
        low, high = self.problem.smooth_bounds(start)
        coarse = _TOLERANCE / self.problem.samples
        if self.problem.interrupt.pressed:
            return Minimum(start, False)
        return minimise(self._searched, self._slopes, start, low, high, coarse, trials=self.trials)

    def refined(self, end: Minimum) -> Minimum:
        """Minimise further from the end of a search, if derivatives are exact and steps long."""
        low, high = self.problem.smooth_bounds(end.q)
        exact = not isinstance(self.problem.model, FmuWithDifferences)
        if not (exact and end.converged and self._last_step(end.q, low, high) > _PRECISE):
            return end
        return minimise(
            self._searched, self._slopes, end.q, low, high, _FINE_TOLERANCE, trials=self.trials
        )

    def _last_step(self, q: Array, low: Array, high: Array) -> float:
        """Return the length of a Gauss-Newton step of the coordinates that are off their bounds."""
        slopes = self._slopes(q)[:, (low < q) & (q < high)]
        rows = self._rows(q)
        if not slopes.size or not (np.isfinite(slopes).all() and np.isfinite(rows).all()):
            return 0.0
        information = weighted_square(slopes, np.ones(len(rows)))
        step = parameter_covariance(information).matrix @ (slopes.T @ rows)
        return float(np.abs(step).max())

    def _searched(self, q: Array) -> Array:
        """Return the rows for a search, which ends at Ctrl-C."""
        if self.problem.interrupt.pressed:
            raise SearchEndedError("it was interrupted")
        return self._rows(q)

    def _rows(self, q: Array) -> Array:
        """Return signed roots (m,) of the deviance of every innovation."""
        return np.concatenate([root for root, _ in self._roots(q).values()])

    def _slopes(self, q: Array) -> Array:
        """Return the derivatives (m, p) of the rows."""
        stacked = _whitened_slopes(self.problem, q, self.noise)
        first = 0
        for output, (root, slope) in self._roots(q).items():
            if self.noise[output].freedom < np.inf:  # else the root is the innovation itself
                stacked[first : first + len(root)] *= slope[:, np.newaxis]
            first += len(root)
        return stacked

    def _roots(self, q: Array) -> dict[str, tuple[Array, Array]]:
        """Return `tails.deviance_roots` of the innovations, by output."""
        residual = self.problem.evaluate(q)[0]
        roots = {}
        for output, model in self.noise.items():
            innovation = residual[output] / model.deviation
            roots[output] = tails.deviance_roots(innovation, model.freedom)
        return roots


def _whitened_slopes(problem: Problem, q: Array, noise: Mapping[str, Noise]) -> Array:
    """Return the Jacobians of all outputs over their deviations, one below the other, (m, p).

    They are divided one by one into the result, as a second copy of all takes much memory.
    """
    jacobian = problem.evaluate(q)[1]
    stacked = np.empty((sum(len(jacobian[output]) for output in noise), len(q)))
    first = 0
    for output, model in noise.items():
        last = first + len(jacobian[output])
        np.divide(jacobian[output], model.deviation, out=stacked[first:last])
        first = last
    return stacked


def _one_pass(problem: Problem, q: Array, noise: Mapping[str, Noise]) -> Pass:
    """Fit in noise that is given, from a point, and estimate the noise at the end."""
    return _end_pass(problem, _minimise(problem, q, noise))


def _iterate(problem: Problem, first: Pass) -> Pass:
    """Repeat passes until BIC falls by less than `_SETTLED`; return the best pass.

    Each begins where the last one ended, with the noise that was estimated there.
    """
    fitted = first
    for _ in range(_PASSES - 1):
        before = fitted
        fitted = _one_pass(problem, before.q, before.noise)
        if before.bic - fitted.bic < _SETTLED:
            return min(before, fitted, key=lambda f: f.bic)
    return fitted


def _end_pass(problem: Problem, minimum: Minimum) -> Pass:
    """Return the pass that ends at a point, with the noise estimated from the residual there."""
    residual = problem.evaluate(minimum.q)[0]
    noise = problem.noise(residual)
    innovation = {name: residual[name] / model.deviation for name, model in noise.items()}
    parameters = len(minimum.q) + sum(model.parameters for model in noise.values())
    deviance = problem.deviance(noise, residual)
    bic = deviance + parameters * log(problem.samples)
    return Pass(minimum.q, minimum.converged, noise, residual, innovation, deviance, bic)


def _pass_at_start(problem: Problem, q: Array) -> Pass | None:
    """Return a pass without a search; None if its point cannot be simulated."""
    return None if error_at(problem, q) == np.inf else _end_pass(problem, Minimum(q, False))


def _assess(problem: Problem, end: Pass) -> FitResult:
    """Return the result of a fit, with the covariance of its parameters."""
    innovation = end.innovation
    noise = end.noise.items()
    weights = {o: tails.weights(innovation[o], model.freedom) for o, model in noise}
    jacobian = _whitened_slopes(problem, end.q, end.noise)
    curvature = _Curvature(
        np.concatenate([np.full_like(innovation[o], model.information) for o, model in noise]),
        np.concatenate([tails.curvature(innovation[o], model.freedom) for o, model in noise]),
    )
    score = np.concatenate([weights[o] * innovation[o] for o in weights])
    is_given = np.concatenate([np.full_like(innovation[o], o in problem.given) for o in weights])
    information = weighted_square(jacobian, curvature.expected)
    return FitResult(
        **vars(end),
        values=problem.values(end.q),
        weights=weights,
        information=information,
        covariance=_covariance(jacobian, score, curvature, information, is_given > 0.0),
    )


class _Curvature(NamedTuple):
    """Second derivative of the loss by every innovation, (m,): as expected, and as it is."""

    expected: Array
    observed: Array


def _covariance(
    jacobian: Array, score: Array, curvature: _Curvature, information: Array, is_given: Mask
) -> Covariance:
    """Return the covariance of the parameters, corrected for noise of varying level.

    The curvature of the log-likelihood is the observed one, unless it is not clearly positive, as
    may happen by chance with few samples in heavy tails. It is then the expected one (Fisher).

    Parameters
    ----------
    jacobian : ndarray, shape (m, p)
        Of all innovations.
    score : ndarray, shape (m,)
        Derivative of the loss by every innovation.
    curvature : _Curvature
    information : ndarray, shape (p, p)
        Expected curvature.
    is_given : ndarray of bool, shape (m,)
        Innovations whose noise is given; their scores are as large as it says, with no leverage.
    """
    observed = weighted_square(jacobian, curvature.observed)
    positive = _is_positive(observed, information)
    bread = parameter_covariance(observed if positive else information)
    curved = curvature.observed if positive else curvature.expected
    score = np.where(is_given, np.sqrt(curvature.expected), score)
    return heteroscedastic(bread, jacobian, score, np.where(is_given, 0.0, curved))


def _is_positive(observed: Array, expected: Array) -> bool:
    """Return whether an observed information is clearly positive in every direction.

    Both are scaled by the diagonal of the expected information; then their least eigenvalues are
    compared.
    """
    scale = np.sqrt(np.diag(expected))
    seen = (scale > 0.0) & np.isfinite(scale)
    size = np.outer(scale[seen], scale[seen])

    def least(information: Array) -> float:
        return float(np.linalg.eigvalsh(information[np.ix_(seen, seen)] / size).min(initial=1.0))

    return least(observed) > _CURVED * least(expected)
