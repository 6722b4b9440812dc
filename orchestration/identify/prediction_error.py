"""Prediction-error method: parameters and the noise of every output in turn, until innovations are smallest.

The model runs free over the record; its residual is whitened by an autoregression that is estimated with it (Ljung:
System Identification, section 7.2), or weighted by its size where the noise is taken as white: the output-error
method. Physical parameters may have a Gaussian prior.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.covariance import Covariance, covariance
from orchestration.identify.levenberg_marquardt import Minimum, minimise
from orchestration.identify.noise import Noise, estimate, white
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
Residual = Callable[[Array], Array]
# Standard deviation, in the logarithm, of the prior of a physical parameter: a factor of 2.7. It
# keeps parameters that the record does not determine from running away, and weighs next to nothing in others.
PRIOR_STD = 1.0


@dataclass(frozen=True)
class Method:
    """How a fit is made; as it stands, quickly, and to far below what any evidence turns on.

    Attributes
    ----------
    minimise : callable
        `levenberg_marquardt.minimise`, or what has the same face.
    tolerance : float
        Fall of the sum of squared innovations that ends a search.
    passes : int
        Of fitting with a noise model and estimating the noise model from the residual, at most.
    settled : float
        Fall of BIC from one pass to the next that ends them.
    """

    minimise: Callable[[Residual, Residual, Array, Array, Array, float], Minimum] = minimise
    tolerance: float = 0.05
    passes: int = 3
    settled: float = 0.5


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
    innovation : dict of str to ndarray
        The residual whitened.
    information : ndarray, shape (p, p)
        Normal matrix of the whitened derivatives of all residuals by the searched coordinates.
    prior_precision : ndarray, shape (p,)
        Curvature of the prior of every coordinate; zero where there is none.
    deviance : float
        Minus twice the logarithm of the likelihood, up to what is the same for every candidate of one record.
    parameters : int
        Estimated ones, those of the noise included.
    samples : int
    converged : bool
        Whether the search ended by itself.
    """

    q: Array
    values: dict[str, float]
    noise: dict[str, Noise]
    residual: dict[str, Array]
    innovation: dict[str, Array]
    information: Array
    prior_precision: Array
    deviance: float
    parameters: int
    samples: int
    converged: bool

    @property
    def bic(self) -> float:
        """Bayesian information criterion."""
        return self.deviance + self.parameters * float(np.log(self.samples))

    @property
    def covariance(self) -> Covariance:
        """Covariance of the searched coordinates.

        The prior counts, so that parameters of which the record determines a combination only, such as a ratio, are
        as uncertain as they are.
        """
        return covariance(self.information, self.prior_precision)


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
    method: Method = Method(),
) -> FitResult:
    """Fit the searched parameters of a problem, and the noise of its outputs in turn.

    Parameters
    ----------
    problem : Problem
    start : ndarray, shape (p,)
        Searched coordinates to begin with.
    noise : Mapping of str to Noise, optional
        By output, to begin with; None takes white noise of the size of the residual.
    physical : ndarray of bool, shape (p,), optional
        Parameters that have a prior; none by default.
    prior_std : float
        Its standard deviation, see `PRIOR_STD`.
    method : Method

    Returns
    -------
    FitResult

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    low, high = problem.bounds()
    mean = problem.position(problem.start)
    held = np.isfinite(mean) & (False if physical is None else physical)
    prior = _Prior(mean, np.where(held, prior_std**-2, 0.0))

    def iterate(q: Array, noise: Mapping[str, Noise]) -> FitResult:
        """Fit with a noise model and estimate it from the residual, in turn."""
        best: FitResult | None = None
        for _ in range(method.passes):
            fitted = _assessed(problem, _minimised(problem, q, noise, prior, method), prior)
            if best is not None and best.bic - fitted.bic < method.settled:
                return min(best, fitted, key=lambda f: f.bic)
            best, q, noise = fitted, fitted.q, fitted.noise
        return fitted

    q = np.clip(problem.inside(start), low, high)
    best = iterate(q, noise or white(problem.evaluate(q)[0], problem.order))
    while any(len(n.coefficients) > 1 for n in best.noise.values()):
        # a colour that has swallowed what the model could follow keeps it from following: once more without
        other = iterate(best.q, white(best.residual, problem.order))
        if best.bic - other.bic < method.settled:
            break
        best = other
    return best


def _minimised(problem: Problem, q: Array, noise: Mapping[str, Noise], prior: _Prior, method: Method) -> Minimum:
    """Fit with noise that is given."""

    def rows(q: Array) -> Array:
        residual = problem.evaluate(q)[0]
        return np.concatenate(
            [*(noise[o].whiten(e, problem.present[o]) for o, e in residual.items()), prior.residual(q)]
        )

    def slopes(q: Array) -> Array:
        jacobian = problem.evaluate(q)[1]
        return np.vstack([*(noise[o].whiten(j, problem.present[o]) for o, j in jacobian.items()), prior.jacobian])

    tolerance = method.tolerance / problem.samples
    best = method.minimise(rows, slopes, q, *problem.neighbourhood(q), tolerance)
    while (other := problem.beyond(best.q)) is not None:
        tried = method.minimise(rows, slopes, other, *problem.neighbourhood(other), tolerance)
        if (rows(tried.q) ** 2).sum() >= (rows(best.q) ** 2).sum():
            break
        best = tried
    return best


def _assessed(problem: Problem, minimum: Minimum, prior: _Prior) -> FitResult:
    """How likely a point makes the record, in the noise that is estimated from its residual."""
    q = minimum.q
    residual, slopes = problem.evaluate(q)
    noise = {o: estimate(e, problem.present[o], problem.order) for o, e in residual.items()}
    innovation = {o: n.whiten(residual[o], problem.present[o]) for o, n in noise.items()}
    jacobian = np.vstack([n.whiten(slopes[o], problem.present[o]) for o, n in noise.items()])
    deviance = sum(2.0 * len(innovation[o]) * np.log(n.deviation) for o, n in noise.items())
    deviance += float((prior.residual(q) ** 2).sum())
    return FitResult(
        q,
        problem.values(q),
        noise,
        residual,
        innovation,
        information=jacobian.T @ jacobian,
        prior_precision=prior.precision,
        deviance=float(deviance),
        parameters=len(q) + sum(len(n.coefficients) for n in noise.values()),
        samples=len(jacobian),
        converged=minimum.converged,
    )
