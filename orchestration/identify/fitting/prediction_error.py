"""The prediction-error method: parameters and the noise of every output, fitted in turn.

The model runs free over the record; its residual is whitened by an autoregression that is estimated
with it (Ljung: System Identification, section 7.2), or weighted by its size where the noise is
taken as white: the output-error method. Physical parameters may have a Gaussian prior.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.identify.fitting.least_squares import Minimum, minimise
from orchestration.identify.fitting.problem import Problem
from orchestration.identify.fitting.simulation_error import (
    error_at,
)
from orchestration.identify.noise import Noise, tails, white_noise
from orchestration.identify.uncertainty import (
    Covariance,
    excess_variance,
    heteroscedastic,
    parameter_covariance,
    weighted_square,
)

# Standard deviation, in the logarithm, of the prior of a physical parameter: a factor of 2.7. It
# keeps parameters that the record does not determine from running away, and weighs next to nothing
# in others.
PRIOR_STD = 1.0
# error of the free run that a noise model may cost, over the least
TOLERATED_EXCESS = 1.02
# Trial points of a fit that is begun again in white noise; the one in coloured noise goes on from
# where it ends.
BRIEF = 12
_BISECTIONS = 6
_CURVED = 0.1  # of the expected curvature, below which the observed one is chance


@dataclass(frozen=True)
class Method:
    """Limits of the effort of a fit.

    A pass fits the parameters with a noise model, and then estimates the noise model from the
    residual.

    Attributes
    ----------
    tolerance : float
        Fall of the sum of squared innovations (of variance 1) below which a search ends. The
        default is far below any difference that evidence depends on.
    passes : int
        Largest number of passes.
    settled : float
        Fall of BIC from one pass to the next below which no further pass is made.
    trials : int
        Largest number of points that the search of a pass tries.
    restarts : int
        Largest number of restarts in white noise.
    near : bool
        Whether the start is known to be near the optimum, so that no other start is tried.
    """

    tolerance: float = 0.05
    passes: int = 3
    settled: float = 0.5
    trials: int = 200
    # One or two suffice where the model can follow the record; where it cannot, as with a wrong
    # unit, each gains a little and dozens would follow.
    restarts: int = 4
    near: bool = False


FULL = Method()
FIXED_COLOUR = Method(restarts=0)  # in a colour that is known
SCREEN = Method(passes=1, trials=BRIEF, restarts=0)  # to decide whether a full fit is worth it
EVALUATE = Method(passes=1, trials=1, restarts=0)  # evaluation without a search


@dataclass(frozen=True)
class FitResult:
    """A fitted candidate: parameters, noise, residuals and their statistics.

    Attributes
    ----------
    q : ndarray, shape (p,)
        Searched coordinates.
    values : dict of str to float
        Parameters by name, SI.
    noise : dict of str to Noise
        By output, of the residual.
    residual : dict of str to ndarray, shape (m,)
        Measured minus simulated.
    innovation : dict of str to ndarray, shape (m,)
        The whitened residual.
    weights : dict of str to ndarray, shape (m,)
        Weights of innovations; about 1, and small for outliers in heavy tails.
    information : ndarray, shape (p, p)
        Of all innovations on the searched coordinates (Fisher).
    prior_precision : ndarray, shape (p,)
        Curvature of the prior of every coordinate; zero where there is none.
    deviance : float
        Minus twice the logarithm of the likelihood, up to a constant of the record.
    parameters : int
        Number of estimated parameters, those of the noise included.
    samples : int
    converged : bool
        True if the search ended by itself.
    covariance : Covariance
        Of the searched coordinates. It includes the prior, so that parameters of which the record
        determines only a combination, such as a ratio, are not given as exact.
    excess_variance : ndarray, shape (p,)
        Ratio of the variance of every coordinate to that of the likelihood, at least 1: more in
        noise of a level that varies with the effect of the coordinate.
    """

    q: Array
    values: dict[str, float]
    noise: dict[str, Noise]
    residual: dict[str, Array]
    innovation: dict[str, Array]
    weights: dict[str, Array]
    information: Array
    prior_precision: Array
    deviance: float
    parameters: int
    samples: int
    converged: bool
    covariance: Covariance
    excess_variance: Array

    @property
    def bic(self) -> float:
        """Bayesian information criterion."""
        return self.deviance + self.parameters * float(np.log(self.samples))


@dataclass(frozen=True)
class _Prior:
    """Gaussian prior of some coordinates, as rows of a least-squares problem."""

    mean: Array
    precision: Array  # zero where there is none

    @property
    def _informed(self) -> Indices:
        return np.flatnonzero(self.precision)

    def residual(self, q: Array) -> Array:
        """Return the rows (r,) of the coordinates that have a prior."""
        return np.asarray(np.sqrt(self.precision[self._informed]) * (q - self.mean)[self._informed])

    @property
    def jacobian(self) -> Array:
        """The derivatives (r, p) of the rows."""
        return np.diag(np.sqrt(self.precision))[self._informed]


def fit_prediction_error(
    problem: Problem,
    start: Array,
    noise: Mapping[str, Noise] | None = None,
    physical: Mask | None = None,
    prior_std: float = PRIOR_STD,
    method: Method = FULL,
    *,
    farthest: float = np.inf,
) -> FitResult:
    """Fit the searched parameters of a problem, and the noise of its outputs in turn.

    The fit scores at least as well as its start, each in the noise that is estimated there, so that
    an extended model that starts where it equals its base scores as well.

    Parameters
    ----------
    problem : Problem
    start : ndarray, shape (p,)
        Searched coordinates to begin with.
    noise : Mapping of str to Noise, optional
        By output, to begin with; None takes noise of the size of the residual, white unless its
        colour is known.
    physical : ndarray of bool, shape (p,), optional
        Parameters that have a prior; none by default.
    prior_std : float
        Its standard deviation, see `PRIOR_STD`.
    method : Method
    farthest : float
        Limit of the pooled error of the free run, however likely the noise makes the record beyond
        it.

    Returns
    -------
    FitResult

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    prior = _make_prior(problem, physical, prior_std)
    alternating = _AlternatingFit(problem, prior, method, farthest)
    at_start = _pass_at_start(problem, np.clip(start, *problem.bounds()), prior, farthest)
    # an evaluation without a search is at the start itself
    begin = _move_off_bounds(problem, start) if method.trials > 1 else start
    q = np.clip(begin, *problem.bounds())
    residual = problem.evaluate(q)[0]
    first = alternating.one_pass(
        q, noise or (problem.noise(residual) if problem.colour else white_noise(residual))
    )
    best = alternating.restart_in_white(alternating.iterate(first), None if noise else first)
    # the colour of noise is estimated by its covariance, not its likelihood: passes may end less
    # likely than they begin
    if at_start and at_start.bic < best.bic:
        converged = best.minimum.converged
        best = replace(at_start, minimum=at_start.minimum._replace(converged=converged))
    return _assess(problem, best, prior)


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


def _make_prior(problem: Problem, physical: Mask | None, prior_std: float) -> _Prior:
    """Return the prior of physical parameters, with the start of the problem as its mean."""
    mean = problem.position(problem.start)
    informed = np.isfinite(mean) & (False if physical is None else physical.astype(bool))
    return _Prior(mean, np.where(informed, prior_std**-2, 0.0))


def _pull_back(problem: Problem, begin: Array, end: Array, farthest: float) -> Array:
    """Return the last point from begin to end whose simulation error is at most `farthest`.

    It is found by bisection; the end itself if the begin is farther away, too.
    """
    if farthest == np.inf:
        return end

    def allowed(q: Array) -> bool:
        return error_at(problem, q) <= farthest

    if allowed(end) or not allowed(begin):
        return end
    near = 0.0
    far = 1.0
    for _ in range(_BISECTIONS):
        middle = (near + far) / 2.0
        if allowed(begin + middle * (end - begin)):
            near = middle
        else:
            far = middle
    return np.asarray(begin + near * (end - begin))


def fit_in_noise(
    problem: Problem, q: Array, noise: Mapping[str, Noise], method: Method
) -> tuple[Array, float]:
    """Fit in noise that is given, without a prior; return the end, (p,), and the deviance there.

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    end = _minimise(problem, q, noise, _make_prior(problem, None, PRIOR_STD), method).q
    return end, problem.deviance(noise, problem.evaluate(end)[0])


def _minimise(
    problem: Problem,
    q: Array,
    noise: Mapping[str, Noise],
    prior: _Prior,
    method: Method,
) -> Minimum:
    """Minimise in given noise, and again beyond the sample at which a delay ends a search.

    Residuals are not smooth where a delay is a whole number of samples: `Problem.smooth_bounds`.
    """
    loss = _Loss(problem, noise, prior)
    best = loss.minimise_smooth(q, method)
    other = problem.across_sample(best.q)
    while other is not None:
        candidate = loss.minimise_smooth(other, method)
        if loss.cost(candidate.q) >= loss.cost(best.q):
            break
        best = candidate
        other = problem.across_sample(best.q)
    return best


@dataclass(frozen=True)
class _Loss:
    """Deviance of the innovations in given noise, and of a prior, as a sum of squares."""

    problem: Problem
    noise: Mapping[str, Noise]
    prior: _Prior

    def cost(self, q: Array) -> float:
        """Return the deviance at a point, but for terms that do not depend on it."""
        return float((self._rows(q) ** 2).sum())

    def minimise_smooth(self, start: Array, method: Method) -> Minimum:
        """Minimise within the bounds about a start where the residuals are smooth."""
        problem = self.problem
        low, high = problem.smooth_bounds(start)
        residual = problem.time_limited(self._rows)
        tolerance = method.tolerance / problem.samples
        return minimise(
            residual, self._slopes, start, low, high, tolerance=tolerance, trials=method.trials
        )

    def _rows(self, q: Array) -> Array:
        """Return signed roots of the deviance (m + r,): those of innovations, then the prior."""
        roots = [root for root, _ in self._roots(q).values()]
        return np.concatenate([*roots, self.prior.residual(q)])

    def _slopes(self, q: Array) -> Array:
        """Return the derivatives (m + r, p) of the rows."""
        stacked = _whitened_slopes(self.problem, q, self.noise, self.prior.jacobian)
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
            innovations = model.whiten(residual[output], self.problem.present[output])
            roots[output] = tails.deviance_roots(innovations, model.freedom)
        return roots


def _whitened_slopes(problem: Problem, q: Array, noise: Mapping[str, Noise], below: Array) -> Array:
    """Return the whitened Jacobians of all outputs one below the other, and more rows below them.

    They are whitened one by one into the result, as a second copy of all takes much memory.

    Parameters
    ----------
    problem : Problem
    q : ndarray, shape (p,)
    noise : Mapping of str to Noise
    below : ndarray, shape (r, p)

    Returns
    -------
    ndarray, shape (m + r, p)
    """
    jacobian = problem.evaluate(q)[1]
    rows = sum(len(jacobian[output]) for output in noise)
    stacked = np.empty((rows + len(below), len(q)))
    first = 0
    for output, model in noise.items():
        last = first + len(jacobian[output])
        stacked[first:last] = model.whiten(jacobian[output], problem.present[output])
        first = last
    stacked[rows:] = below
    return stacked


@dataclass(frozen=True)
class _Pass:
    """The end of a pass, and the noise that is estimated from the residual there.

    Attributes
    ----------
    minimum : Minimum
    residual : dict of str to ndarray, shape (n,)
        Measured minus simulated, by output, SI.
    noise : dict of str to Noise
    innovation : dict of str to ndarray, shape (m,)
        The residual whitened.
    deviance : float
        Twice the negative logarithm of the likelihood.
    parameters : int
        Of the model and of its noise.
    samples : int
    """

    minimum: Minimum
    residual: dict[str, Array]
    noise: dict[str, Noise]
    innovation: dict[str, Array]
    deviance: float
    parameters: int
    samples: int

    @property
    def bic(self) -> float:
        """Bayesian information criterion."""
        return self.deviance + self.parameters * float(np.log(self.samples))


@dataclass(frozen=True)
class _AlternatingFit:
    """Fits of the parameters in noise that is given, and of the noise where each ends, in turn."""

    problem: Problem
    prior: _Prior
    method: Method
    farthest: float

    def one_pass(self, q: Array, noise: Mapping[str, Noise]) -> _Pass:
        """Fit in noise that is given, from a point, and estimate the noise at the end."""
        problem = self.problem
        end = _minimise(problem, q, noise, self.prior, self.method)
        near = _pull_back(problem, q, end.q, self.farthest)
        return _end_pass(problem, end._replace(q=near), self.prior)

    def iterate(self, first: _Pass) -> _Pass:
        """Repeat passes until BIC falls by less than `Method.settled`; return the best pass.

        Each begins where the last one ended, with the noise that was estimated there.
        """
        fitted = first
        for _ in range(self.method.passes - 1):
            before = fitted
            fitted = self.one_pass(before.minimum.q, before.noise)
            if before.bic - fitted.bic < self.method.settled:
                return min(before, fitted, key=lambda f: f.bic)
        return fitted

    def restart_in_white(self, best: _Pass, in_white: _Pass | None) -> _Pass:
        """Restart in white noise, as long as the noise is coloured and a restart lowers BIC.

        A noise model that explains a part of the record keeps the model from explaining that part.

        Parameters
        ----------
        best : _Pass
        in_white : _Pass, optional
            The last pass in white noise, if there was one.
        """
        brief = replace(self, method=replace(self.method, trials=BRIEF))
        for _ in range(self.method.restarts):
            if not any(len(model.coefficients) > 1 for model in best.noise.values()):
                break
            again = brief.one_pass(best.minimum.q, white_noise(best.residual))
            # where the last pass in white noise ended as well, further passes would go as before
            is_same = in_white is not None and abs(in_white.bic - again.bic) < self.method.settled
            in_white = again
            other = again if is_same else self.iterate(again)
            if best.bic - other.bic < self.method.settled:
                break
            best = other
        return best


def _end_pass(problem: Problem, minimum: Minimum, prior: _Prior) -> _Pass:
    """Return the pass that ends at a point, with the noise estimated from the residual there."""
    q = minimum.q
    residual = problem.evaluate(q)[0]
    noise = problem.noise(residual)
    innovation = {
        output: model.whiten(residual[output], problem.present[output])
        for output, model in noise.items()
    }
    deviance = sum(
        model.deviance(innovation[output], problem.present[output])
        for output, model in noise.items()
    )
    return _Pass(
        minimum,
        residual,
        noise,
        innovation,
        deviance=float(deviance + (prior.residual(q) ** 2).sum()),
        parameters=len(q) + sum(model.parameters for model in noise.values()),
        samples=sum(map(len, innovation.values())),
    )


def _pass_at_start(problem: Problem, q: Array, prior: _Prior, farthest: float) -> _Pass | None:
    """Return a pass without a search; None if its point cannot be simulated or is too far off."""
    error = error_at(problem, q)
    if error == np.inf or error > farthest:
        return None
    return _end_pass(problem, Minimum(q, False), prior)


def _assess(problem: Problem, end: _Pass, prior: _Prior) -> FitResult:
    """Return the result of a fit, with the covariance of its parameters."""
    q = end.minimum.q
    noise = end.noise
    innovation = end.innovation
    weights = {output: model.weights(innovation[output]) for output, model in noise.items()}
    jacobian = _whitened_slopes(problem, q, noise, np.empty((0, len(q))))
    score = np.concatenate([weights[output] * innovation[output] for output in noise])
    curvature = _curvature(noise, innovation)
    information = weighted_square(jacobian, curvature.expected)
    plain = parameter_covariance(information, prior.precision)
    return FitResult(
        q,
        problem.values(q),
        noise,
        end.residual,
        innovation,
        weights,
        information=information,
        prior_precision=prior.precision,
        deviance=end.deviance,
        parameters=end.parameters,
        samples=end.samples,
        converged=end.minimum.converged,
        covariance=_covariance(plain, jacobian, score, curvature, information, prior),
        excess_variance=excess_variance(plain, jacobian, score, curvature.expected),
    )


class _Curvature(NamedTuple):
    """Second derivative of the loss by every innovation, (m,): as expected, and as it is."""

    expected: Array
    observed: Array


def _curvature(noise: Mapping[str, Noise], innovation: Mapping[str, Array]) -> _Curvature:
    """Return the curvature of the loss at the innovations of all outputs."""
    expected = [
        np.full_like(innovation[output], model.information) for output, model in noise.items()
    ]
    observed = [
        tails.curvature(innovation[output], model.freedom) for output, model in noise.items()
    ]
    return _Curvature(np.concatenate(expected), np.concatenate(observed))


def _covariance(
    plain: Covariance,
    jacobian: Array,
    score: Array,
    curvature: _Curvature,
    information: Array,
    prior: _Prior,
) -> Covariance:
    """Return the covariance of the parameters, corrected for noise of varying level.

    The curvature of the log-likelihood is the observed one, unless it is not clearly positive, as
    may happen by chance with few samples in heavy tails. It is then the expected one (Fisher).

    Parameters
    ----------
    plain : Covariance
        Inverse of expected curvature and prior.
    jacobian : ndarray, shape (m, p)
        Of all innovations.
    score : ndarray, shape (m,)
        Derivative of the loss by every innovation.
    curvature : _Curvature
    information : ndarray, shape (p, p)
        Expected curvature, without the prior.
    prior : _Prior
    """
    observed = weighted_square(jacobian, curvature.observed)
    if not _is_positive(observed, information):
        return heteroscedastic(plain, jacobian, score, curvature.expected)
    bread = parameter_covariance(observed, prior.precision)
    return heteroscedastic(bread, jacobian, score, curvature.observed)
