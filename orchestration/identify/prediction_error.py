"""Prediction-error method: parameters and the noise of every output in turn, until innovations are smallest.

The model runs free over the record; its residual is whitened by an autoregression that is estimated with it (Ljung:
System Identification, section 7.2), or weighted by its size where the noise is taken as white: the output-error
method. Physical parameters may have a Gaussian prior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.covariance import (
    Covariance,
    covariance,
    excess_variance,
    heteroscedastic,
    sandwich,
)
from orchestration.identify.least_squares import Minimum, minimise
from orchestration.identify.method import BRIEF, FULLY, Method
from orchestration.identify.noise import tails
from orchestration.identify.noise.model import Noise, white
from orchestration.identify.problem import Problem
from orchestration.identify.simulation_error import (
    error_at,
    error_scales,
    fit_simulation_error,
    pooled_error,
)

Array = NDArray[np.float64]
# Standard deviation, in the logarithm, of the prior of a physical parameter: a factor of 2.7. It
# keeps parameters that the record does not determine from running away, and weighs next to nothing in others.
PRIOR_STD = 1.0
_BISECTIONS = 6
_CURVED = 0.1  # of the curvature that is expected, below which the one observed is chance
TOLERATED_EXCESS = (
    1.02  # of the error of the free run over the least there is, which a noise model may take
)


@dataclass(frozen=True)
class FitResult:
    """A candidate at its best.

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
        The residual whitened.
    weights : dict of str to ndarray, shape (m,)
        How much every innovation counts; about 1, and little where one is far out in heavy tails.
    information : ndarray, shape (p, p)
        Of all innovations on the searched coordinates (Fisher).
    prior_precision : ndarray, shape (p,)
        Curvature of the prior of every coordinate; zero where there is none.
    deviance : float
        Minus twice the logarithm of the likelihood, up to what is the same for every candidate of one record.
    parameters : int
        Estimated ones, those of the noise included.
    samples : int
    converged : bool
        Whether the search ended by itself.
    covariance : Covariance
        Of the searched coordinates. The prior counts, so that parameters of which the record determines a combination
        only, such as a ratio, are as uncertain as they are.
    excess_variance : ndarray, shape (p,)
        How much more every coordinate scatters than the likelihood says, in variance, at least 1: noise of a level that
        varies with what the coordinate does.
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
    def _held(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.precision)

    def residual(self, q: Array) -> Array:
        return np.asarray(np.sqrt(self.precision[self._held]) * (q - self.mean)[self._held])

    @property
    def jacobian(self) -> Array:
        return np.diag(np.sqrt(self.precision))[self._held]


def fit(
    problem: Problem,
    start: Array,
    noise: Mapping[str, Noise] | None = None,
    physical: NDArray[np.bool_] | None = None,
    prior_std: float = PRIOR_STD,
    method: Method = FULLY,
    farthest: float = np.inf,
) -> FitResult:
    """Fit the searched parameters of a problem, and the noise of its outputs in turn.

    Parameters
    ----------
    problem : Problem
    start : ndarray, shape (p,)
        Searched coordinates to begin with.
    noise : Mapping of str to Noise, optional
        By output, to begin with; None takes noise of the size of the residual, white unless its colour is known.
    physical : ndarray of bool, shape (p,), optional
        Parameters that have a prior; none by default.
    prior_std : float
        Its standard deviation, see `PRIOR_STD`.
    method : Method
    farthest : float
        Pooled error of the free run that must not be passed, whatever noise makes the record likely there.

    Returns
    -------
    FitResult

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    prior = _prior(problem, physical, prior_std)

    def one_pass(q: Array, noise: Mapping[str, Noise], trials: int = method.trials) -> FitResult:
        end = _minimised(problem, q, noise, prior, method, trials)
        return _assessed(problem, end._replace(q=_kept_near(problem, q, end.q, farthest)), prior)

    def iterate(fitted: FitResult) -> FitResult:
        """Fit in the noise that is seen from where a pass ended, in turn."""
        for _ in range(method.passes - 1):
            best, fitted = fitted, one_pass(fitted.q, fitted.noise)
            if best.bic - fitted.bic < method.settled:
                return min(best, fitted, key=lambda f: f.bic)
        return fitted

    q = np.clip(problem.inside(start), *problem.bounds())
    residual = problem.evaluate(q)[0]
    begin = one_pass(q, noise or (problem.noise(residual) if problem.colour else white(residual)))
    best, without = (
        iterate(begin),
        None if noise else begin,
    )  # the latter is what a pass without colour came to
    for _ in range(method.again):
        if not any(len(n.coefficients) > 1 for n in best.noise.values()):
            break
        # a colour that has swallowed what the model could follow keeps it from following: once more without
        again = one_pass(best.q, white(best.residual), BRIEF)
        # from where the pass without colour ended before, all would go as before
        same = without is not None and abs(without.bic - again.bic) < method.settled
        other, without = again if same else iterate(again), again
        if best.bic - other.bic < method.settled:
            break
        best = other
    return best


def fit_free_run(
    problem: Problem,
    starts: Sequence[Array],
    physical: NDArray[np.bool_] | None = None,
    prior_std: float = PRIOR_STD,
    method: Method = FULLY,
) -> FitResult:
    """Fit the free run by plain least squares, and assess it in the noise that its residual shows.

    Its intervals allow for the colour and the changing level of that noise, which the fit knew nothing of.

    Parameters
    ----------
    problem : Problem
    starts : sequence of ndarray, shape (p,)
        Points to begin at; see `simulation_error.starting_points`.
    physical, prior_std, method
        See :func:`fit`.

    Returns
    -------
    FitResult

    Raises
    ------
    UserError
        If the simulation fails where the first search starts.
    """
    prior, scales = _prior(problem, physical, prior_std), error_scales(problem)
    rows = (prior.residual, prior.jacobian)
    minimum = fit_simulation_error(
        problem, starts, scales, method.tolerance / problem.samples, rows
    )
    fitted, slopes = _assessed(problem, minimum, prior), problem.evaluate(minimum.q)[1]
    weighted = {o: j / scales[o] for o, j in slopes.items()}
    stacked = np.vstack(list(weighted.values()))
    noise = [replace(n, deviation=n.deviation / scales[o]) for o, n in fitted.noise.items()]
    bread = covariance(stacked.T @ stacked, prior.precision)
    return replace(fitted, covariance=sandwich(bread, weighted.values(), noise))


def trusted(problem: Problem, likeliest: FitResult, free_run: FitResult) -> FitResult:
    """Return the likelier of two fits unless its simulation is farther from the record than the best one.

    A noise model may make a record likely with a simulation that follows it badly: what it takes for noise is then what
    the simulation should explain.

    Parameters
    ----------
    problem : Problem
    likeliest, free_run : FitResult
        Of :func:`fit` and :func:`fit_free_run`.
    """
    scales, weights = error_scales(problem), likeliest.weights
    near = TOLERATED_EXCESS * pooled_error(free_run.residual, scales, weights)
    return likeliest if pooled_error(likeliest.residual, scales, weights) <= near else free_run


def _is_curved(observed: Array, expected: Array) -> bool:
    """Whether an observed information is positive in every direction, beside the one that is expected."""
    scale = np.sqrt(np.diag(expected))
    seen = scale > 0.0
    size = np.outer(scale[seen], scale[seen])
    least = [
        np.linalg.eigvalsh(m[np.ix_(seen, seen)] / size).min(initial=1.0)
        for m in (observed, expected)
    ]
    return bool(least[0] > _CURVED * least[1])


def _prior(problem: Problem, physical: NDArray[np.bool_] | None, prior_std: float) -> _Prior:
    mean = problem.position(problem.start)
    held = np.isfinite(mean) & (False if physical is None else physical.astype(bool))
    return _Prior(mean, np.where(held, prior_std**-2, 0.0))


def _kept_near(problem: Problem, begin: Array, end: Array, farthest: float) -> Array:
    """Return the last point on the way of a search at which its simulation is not too far from the record."""
    if farthest == np.inf:
        return end

    def allowed(q: Array) -> bool:
        return error_at(problem, q) <= farthest

    if allowed(end) or not allowed(begin):
        return end
    near, far = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = (near + far) / 2.0
        near, far = (middle, far) if allowed(begin + middle * (end - begin)) else (near, middle)
    return np.asarray(begin + near * (end - begin))


def fit_in_noise(
    problem: Problem, q: Array, noise: Mapping[str, Noise], method: Method
) -> tuple[Array, float]:
    """Fit in noise that is given, without a prior: where it ends, (p,), and the deviance there.

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    end = _minimised(problem, q, noise, _prior(problem, None, PRIOR_STD), method, method.trials).q
    residual, present = problem.evaluate(end)[0], problem.present
    return end, sum(
        n.deviance(n.whiten(residual[o], present[o]), present[o]) for o, n in noise.items()
    )


def _minimised(
    problem: Problem,
    q: Array,
    noise: Mapping[str, Noise],
    prior: _Prior,
    method: Method,
    trials: int,
) -> Minimum:
    """Fit with noise that is given."""

    def rooted(q: Array) -> dict[str, tuple[Array, Array]]:
        residual = problem.evaluate(q)[0]
        return {
            o: tails.rooted(n.whiten(residual[o], problem.present[o]), n.freedom)
            for o, n in noise.items()
        }

    def rows(q: Array) -> Array:
        return np.concatenate([*(root for root, _ in rooted(q).values()), prior.residual(q)])

    def slopes(q: Array) -> Array:
        jacobian = problem.evaluate(q)[1]
        whitened = {o: n.whiten(jacobian[o], problem.present[o]) for o, n in noise.items()}
        tailed = {
            o: slope[:, np.newaxis]
            for o, (_, slope) in rooted(q).items()
            if noise[o].freedom < np.inf
        }
        return np.vstack(
            [*(tailed[o] * w if o in tailed else w for o, w in whitened.items()), prior.jacobian]
        )

    end = method.tolerance / problem.samples, trials
    best = minimise(problem.while_there_is_time(rows), slopes, q, *problem.neighbourhood(q), *end)
    while (other := problem.beyond(best.q)) is not None:
        tried = minimise(
            problem.while_there_is_time(rows), slopes, other, *problem.neighbourhood(other), *end
        )
        if (rows(tried.q) ** 2).sum() >= (rows(best.q) ** 2).sum():
            break
        best = tried
    return best


def _assessed(problem: Problem, minimum: Minimum, prior: _Prior) -> FitResult:
    """How likely a point makes the record, in the noise that is estimated from its residual."""
    q = minimum.q
    residual, slopes = problem.evaluate(q)
    noise = problem.noise(residual)
    innovation = {o: n.whiten(residual[o], problem.present[o]) for o, n in noise.items()}
    weights = {o: n.weights(innovation[o]) for o, n in noise.items()}
    jacobian = {o: n.whiten(slopes[o], problem.present[o]) for o, n in noise.items()}
    deviance = sum(n.deviance(innovation[o], problem.present[o]) for o, n in noise.items())
    stacked, score = (
        np.vstack(list(jacobian.values())),
        np.concatenate([weights[o] * innovation[o] for o in noise]),
    )
    # of the loss, by every innovation, as expected and as it is
    expected = np.concatenate(
        [np.full_like(innovation[o], n.information) for o, n in noise.items()]
    )
    observed = np.concatenate([tails.curvature(innovation[o], n.freedom) for o, n in noise.items()])
    information, bent = ((stacked.T * each) @ stacked for each in (expected, observed))
    plain = covariance(information, prior.precision)
    # of few samples in heavy tails the curvature may be anything
    bread, curved = (
        (covariance(bent, prior.precision), observed)
        if _is_curved(bent, information)
        else (plain, expected)
    )
    return FitResult(
        q,
        problem.values(q),
        noise,
        residual,
        innovation,
        weights,
        information=information,
        prior_precision=prior.precision,
        deviance=float(deviance + (prior.residual(q) ** 2).sum()),
        parameters=len(q) + sum(n.parameters for n in noise.values()),
        samples=len(score),
        converged=minimum.converged,
        covariance=heteroscedastic(bread, stacked, score, curved),
        excess_variance=excess_variance(plain, stacked, score, expected),
    )
