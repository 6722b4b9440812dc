"""Prediction-error fit of a model with coloured output noise: whitened by an autoregression that is estimated with it.

Output error with a noise model of its own (Ljung: System Identification, section 7.2), and a Gaussian prior on physical
parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.identify.covariance import Covariance, covariance
from orchestration.identify.levenberg_marquardt import minimise
from orchestration.identify.noise import Noise, estimate, white
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
# Standard deviation, in the logarithm, of the prior of a physical parameter: a factor of 2.7. It
# keeps parameters that the record does not determine from running away, and weighs next to nothing in others.
PRIOR_STD = 1.0
_PASSES = 3  # of fitting with a colour and estimating the colour from the residual
_CONVERGED = 0.5  # change of the log-likelihood that ends it
TOLERANCE = 0.05  # fall of the sum of squared innovations that ends a search: far below what any evidence turns on


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

    @property
    def bic(self) -> float:
        """Bayesian information criterion."""
        return self.deviance + self.parameters * float(np.log(self.samples))

    @property
    def covariance(self) -> Covariance:
        """Covariance of the searched coordinates.

        The prior counts, so that parameters of which the record tells a combination only, such as a ratio, are as
        uncertain as they are.
        """
        return covariance(self.information, self.prior_precision)


def fit(
    problem: Problem,
    start: Array,
    noise: Mapping[str, Noise] | None,
    physical: NDArray[np.bool_],
    prior_std: float = PRIOR_STD,
) -> FitResult:
    """Fit the searched parameters of a problem, and the colour of its noise in turn.

    Parameters
    ----------
    problem : Problem
    start : ndarray, shape (p,)
        Searched coordinates to begin with.
    noise : Mapping of str to Noise, optional
        By output, to begin with; None takes white noise of the size of the residual.
    physical : ndarray of bool, shape (p,)
        Parameters that have a prior.
    prior_std : float
        Its standard deviation, see `PRIOR_STD`.

    Returns
    -------
    FitResult

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    low, high = problem.bounds()
    centre = problem.position(problem.start)
    held = np.flatnonzero(physical & np.isfinite(centre))
    prior_precision = np.zeros(len(centre))
    prior_precision[held] = prior_std**-2

    def iterate(q: Array, colours: Mapping[str, Noise]) -> FitResult:
        """Fit with a colour and estimate the colour from the residual, in turn."""
        best: FitResult | None = None
        for _ in range(_PASSES):
            q = _minimised(problem, q, colours, prior_precision, centre)
            fitted = _assessed(problem, q, prior_precision, centre)
            if best is not None and best.bic - fitted.bic < _CONVERGED:
                return min(best, fitted, key=lambda f: f.bic)
            best, colours = fitted, fitted.noise
        return fitted

    q = np.clip(problem.inside(start), low, high)
    best = iterate(q, noise or white(problem.evaluate(q)[0], problem.even))
    while any(len(n.coefficients) > 1 for n in best.noise.values()):
        # a colour that has swallowed what the model could tell keeps it from being told: ask once more without
        other = iterate(best.q, white(best.residual, problem.even))
        if best.bic - other.bic < _CONVERGED:
            break
        best = other
    problem.forget()  # of many candidates few are looked at again
    return best


def _minimised(
    problem: Problem, q: Array, colours: Mapping[str, Noise], prior_precision: Array, centre: Array
) -> Array:
    """Fit with noise of a known colour."""
    held = np.flatnonzero(prior_precision)
    root = np.sqrt(prior_precision[held])
    size = sum(p.sum() for p in problem.present.values())

    def rows(q: Array) -> Array:
        try:
            error = problem.evaluate(q)[0]
        except UserError:
            if not problem.ran:
                raise
            return np.full(size, np.inf)  # a point to step back from
        return np.concatenate(
            [*(colours[o].whiten(e, problem.present[o]) for o, e in error.items()), root * (q - centre)[held]]
        )

    def slopes(q: Array) -> Array:
        jacobian = problem.evaluate(q)[1]
        prior = np.zeros((len(held), len(q)))
        prior[np.arange(len(held)), held] = root
        return np.vstack([*(colours[o].whiten(j, problem.present[o]) for o, j in jacobian.items()), prior])

    tolerance = TOLERANCE / size
    q = minimise(rows, slopes, q, *problem.neighbourhood(q), tolerance)
    while (other := problem.beyond(q)) is not None:
        other = minimise(rows, slopes, other, *problem.neighbourhood(other), tolerance)
        if (rows(other) ** 2).sum() >= (rows(q) ** 2).sum():
            break
        q = other
    return q


def _assessed(problem: Problem, q: Array, prior_precision: Array, centre: Array) -> FitResult:
    """How likely a point makes the record, with the colour of what it leaves."""
    error, slopes = problem.evaluate(q)
    noise = {o: estimate(e, problem.present[o], problem.even) for o, e in error.items()}
    innovation = {o: n.whiten(error[o], problem.present[o]) for o, n in noise.items()}
    jacobian = np.vstack([n.whiten(slopes[o], problem.present[o]) for o, n in noise.items()])
    deviance = sum(2.0 * len(innovation[o]) * np.log(n.deviation) for o, n in noise.items())
    deviance += float(prior_precision @ np.where(prior_precision > 0.0, q - centre, 0.0) ** 2)
    count = len(q) + sum(len(n.coefficients) for n in noise.values())
    return FitResult(
        q,
        problem.values(q),
        noise,
        error,
        innovation,
        jacobian.T @ jacobian,
        prior_precision,
        float(deviance),
        count,
        len(jacobian),
    )
