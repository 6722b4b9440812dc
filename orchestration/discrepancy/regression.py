"""Fitting a candidate: output error, whitened by the colour of what it leaves, and how likely it makes the record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.noise import Noise, estimate
from orchestration.identify.damped import minimise
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
# Width, in the logarithm, of what is believed of a physical parameter before the record is seen: a factor of 2.7. It
# keeps parameters that the record does not determine from running away, and weighs next to nothing in others.
BELIEF = 1.0
FLAT = 1e-12  # relative curvature below which a direction counts as undetermined
_PASSES = 3  # of fitting with a colour and estimating the colour from what is left
_SETTLED = 0.5  # change of the log-likelihood that ends it


@dataclass(frozen=True)
class Fitted:
    """A candidate at its best.

    Attributes
    ----------
    q : ndarray, shape (p,)
        Searched coordinates.
    values : dict of str to float
        Parameters by name, SI.
    noise : dict of str to Noise
        By output, of what is left.
    residual : dict of str to ndarray, shape (m,)
        Simulated minus measured.
    innovation : dict of str to ndarray
        The residual whitened.
    jacobian : ndarray, shape (sum of m, p)
        Whitened derivatives of all residuals by the searched coordinates.
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
    jacobian: Array
    deviance: float
    parameters: int
    samples: int

    @property
    def bic(self) -> float:
        """Bayesian information criterion."""
        return self.deviance + self.parameters * float(np.log(self.samples))


def fit(problem: Problem, start: Array, noise: Mapping[str, Noise] | None, physical: NDArray[np.bool_]) -> Fitted:
    """Fit the searched parameters of a problem, and the colour of its noise in turn.

    Parameters
    ----------
    problem : Problem
    start : ndarray, shape (p,)
        Searched coordinates to begin with.
    noise : Mapping of str to Noise, optional
        By output, to begin with; None takes white noise of the size of the residual.
    physical : ndarray of bool, shape (p,)
        Parameters of which something is believed, see `BELIEF`.

    Returns
    -------
    Fitted

    Raises
    ------
    UserError
        If the simulation fails where the search starts.
    """
    low, high = problem.bounds()
    q = np.clip(problem.inside(start), low, high)
    centre = problem.position(problem.start)
    held = np.flatnonzero(physical & np.isfinite(centre))
    colours = dict(noise) if noise else {o: _white(e) for o, e in problem.evaluate(q)[0].items()}

    def rows(q: Array) -> Array:
        try:
            error = problem.evaluate(q)[0]
        except UserError:
            if not problem.ran:
                raise
            return np.full(size, np.inf)  # a point to step back from
        return np.concatenate([*(colours[o].whiten(e, problem.present[o]) for o, e in error.items()), belief(q)])

    def slopes(q: Array) -> Array:
        jacobian = problem.evaluate(q)[1]
        prior = np.zeros((len(held), len(q)))
        prior[np.arange(len(held)), held] = 1.0 / BELIEF
        return np.vstack([*(colours[o].whiten(j, problem.present[o]) for o, j in jacobian.items()), prior])

    def belief(q: Array) -> Array:
        return (q[held] - centre[held]) / BELIEF

    size, before = 0, np.inf
    for _ in range(_PASSES):
        size = rows(q).size
        q = minimise(rows, slopes, q, low, high)
        error = problem.evaluate(q)[0]
        colours = {o: estimate(e, problem.present[o]) for o, e in error.items()}
        innovation = {o: colours[o].whiten(e, problem.present[o]) for o, e in error.items()}
        deviance = float(sum(2.0 * len(innovation[o]) * np.log(n.deviation) for o, n in colours.items()))
        if before - deviance < _SETTLED:
            break
        before = deviance
    samples = sum(map(len, innovation.values()))
    jacobian = slopes(q)[:samples]
    count = len(q) + sum(len(n.coefficients) for n in colours.values())
    deviance += float(belief(q) @ belief(q))
    return Fitted(q, problem.values(q), colours, error, innovation, jacobian, deviance, count, samples)


def _white(residual: Array) -> Noise:
    return Noise(np.empty(0), float(np.sqrt(np.mean(residual**2))) or np.finfo(float).tiny)


def normal_inverse(jacobian: Array) -> tuple[NDArray[np.intp], Array]:
    """Return which columns of a Jacobian are not zero, and the inverse of their normal matrix, scaled before."""
    scale = np.sqrt((jacobian**2).sum(axis=0))
    seen = np.flatnonzero(scale > 0.0)
    unit = jacobian[:, seen] / scale[seen]
    return seen, np.linalg.pinv(unit.T @ unit, rcond=FLAT, hermitian=True) / np.outer(scale[seen], scale[seen])
