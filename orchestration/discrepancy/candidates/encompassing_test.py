"""Encompassing test: how much of another simulation a record asks for beside a fitted model.

The other simulation has no parameter of its own that could be fitted, and enters with an amount
beside the model's own coordinates: none of it is the model as it stands, all of it the other
(Davidson and MacKinnon: Several tests for model
specification in the presence of alternative hypotheses, Econometrica 49, 1981).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array, Indices
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.identify.uncertainty import parameter_covariance

_ROUNDS = 8  # of amounts and the weights that depend on them


@dataclass(frozen=True)
class Amount:
    """The amount of another simulation that a record asks for.

    Attributes
    ----------
    value, standard_error : float
        The latter is infinite where the model's own parameters do the same.
    shift : ndarray, shape (p,)
        By how much the model's own coordinates would move with all of the other.
    inflation : float
        Variance of the value over that which the noise of the outputs gives it alone. So many times
        as large is a likelihood ratio that knows of no other noise (McCullagh and Nelder:
        Generalized Linear Models, section 9.2).
    """

    value: float
    standard_error: float
    shift: Array
    inflation: float = 1.0

    @property
    def margin(self) -> float:
        """Fall of minus twice the log-likelihood with all of the other in place of none of it."""
        return (2.0 * self.value - 1.0) / self.standard_error**2

    @property
    def excess(self) -> float:
        """Further fall of that with the estimated amount in place of all of it."""
        return ((self.value - 1.0) / self.standard_error) ** 2


def encompassing(
    model: FittedCandidate,
    others: Sequence[Mapping[str, Array]],
    disturbances: Sequence[Mapping[str, Array]] = (),
) -> list[Amount]:
    """Estimate how much of other simulations a record asks for, all of them beside each other.

    Parameters
    ----------
    model : FittedCandidate
    others : sequence of Mapping of str to ndarray, shape (n,)
        What each makes of the outputs at the fitted parameters, SI.
    disturbances : sequence of Mapping of str to ndarray, shape (n,)
        Realisations of what else may be in the outputs beside their noise, SI; they add to the
        standard errors.

    Returns
    -------
    list of Amount
    """
    fit = model.fit
    own = len(fit.q)
    slopes, innovation, ends = _whitened(model, others)
    precision = np.append(fit.prior_precision, np.zeros(len(others)))
    amounts = np.zeros(slopes.shape[1])
    # what is far out in heavy tails, and by the amounts so far, counts less
    for _ in range(_ROUNDS):
        remaining = np.split(innovation + slopes @ amounts, ends)
        weights = [noise.weights(e) for noise, e in zip(fit.noise.values(), remaining, strict=True)]
        weighted = np.concatenate(weights)[:, np.newaxis] * slopes
        spread = parameter_covariance(weighted.T @ slopes, precision)
        amounts = -spread.matrix @ (weighted.T @ innovation)
    own_variances = spread.standard_errors**2
    variances = own_variances
    for disturbance in disturbances:
        moved = spread.matrix @ (weighted.T @ _whitened_disturbance(model, disturbance))
        variances = variances + moved**2 / len(disturbances)
    shifts = _shifts(weighted[:, :own], slopes, fit.prior_precision)
    return [
        Amount(
            float(amounts[i]),
            float(np.sqrt(variances[i])),
            shifts[:, i - own],
            float(variances[i] / own_variances[i]) if np.isfinite(variances[i]) else 1.0,
        )
        for i in range(own, len(amounts))
    ]


def _shifts(weighted: Array, slopes: Array, precision: Array) -> Array:
    """Return how the model's own coordinates move with all of each other simulation.

    Parameters
    ----------
    weighted : ndarray, shape (n, p)
        Slopes by the model's own coordinates, weighted.
    slopes : ndarray, shape (n, p + k)
        By the model's own coordinates and by the amounts of the others.
    precision : ndarray, shape (p,)
        Of the prior.
    """
    own = len(precision)
    covariance = parameter_covariance(weighted.T @ slopes[:, :own], precision)
    return np.asarray(-covariance.matrix @ (weighted.T @ slopes[:, own:]))


def _whitened(
    model: FittedCandidate, others: Sequence[Mapping[str, Array]]
) -> tuple[Array, Array, Indices]:
    """Whiten a model and other simulations of it.

    Returns
    -------
    slopes : ndarray, shape (n, p + k)
        Derivatives of the residual by the model's own coordinates and by the amounts of the others.
    innovation : ndarray, shape (n,)
        Residual of the model.
    ends : ndarray of int
        Where the samples of an output end; without those of the last.
    """
    problem = model.problem
    residual, jacobian = problem.evaluate(model.fit.q)
    slopes = []
    innovations = []
    for output, noise in model.fit.noise.items():
        present = problem.present[output]
        measured = problem.measured[output][present]
        columns = [measured - other[output][present] - residual[output] for other in others]
        slopes.append(noise.whiten(np.column_stack([jacobian[output], *columns]), present))
        innovations.append(noise.whiten(residual[output], present))
    ends = np.cumsum([len(innovation) for innovation in innovations])[:-1]
    return np.vstack(slopes), np.concatenate(innovations), ends


def _whitened_disturbance(model: FittedCandidate, disturbance: Mapping[str, Array]) -> Array:
    pieces = []
    for output, noise in model.fit.noise.items():
        present = model.problem.present[output]
        pieces.append(noise.whiten(disturbance[output][present], present))
    return np.concatenate(pieces)
