"""Whether a record lies with a fitted model or with another simulation of it that has no parameter of its own to tell.

The other simulation enters with an amount beside the model's own coordinates: none of it is the model as it stands, all
of it the other (Davidson and MacKinnon: Several tests for model specification in the presence of alternative
hypotheses, Econometrica 49, 1981).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.identify.covariance import covariance

Array = NDArray[np.float64]
_ROUNDS = 8  # of amounts and the weights that hang on them


@dataclass(frozen=True)
class Amount:
    """How much of another simulation a record asks for.

    Attributes
    ----------
    value, standard_error : float
        The latter is infinite where the model's own parameters do the same.
    shift : ndarray, shape (p,)
        By how much the model's own coordinates would move with all of the other.
    """

    value: float
    standard_error: float
    shift: Array

    @property
    def margin(self) -> float:
        """Fall of minus twice the log-likelihood with all of the other in place of none."""
        return (2.0 * self.value - 1.0) / self.standard_error**2

    @property
    def excess(self) -> float:
        """By how much that is likelier yet with the amount asked for than with all of it."""
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
        Realisations of what else may be in the outputs beside their noise, SI; they add to the standard errors.

    Returns
    -------
    list of Amount
    """
    problem, fit = model.problem, model.fit
    residual, jacobian = problem.evaluate(fit.q)
    rows, errors = [], []
    for output, noise in fit.noise.items():
        present = problem.present[output]
        measured = problem.measured[output][present]
        columns = [measured - other[output][present] - residual[output] for other in others]
        rows.append(noise.whiten(np.column_stack([jacobian[output], *columns]), present))
        errors.append(noise.whiten(residual[output], present))
    slopes, innovation, noises = np.vstack(rows), np.concatenate(errors), list(fit.noise.values())
    ends = np.cumsum([len(error) for error in errors])[:-1]
    amounts = np.zeros(slopes.shape[1])
    for _ in range(
        _ROUNDS
    ):  # what is far out in heavy tails, and by what is asked for, counts less
        left = np.split(innovation + slopes @ amounts, ends)
        weight = np.concatenate([n.weights(e) for n, e in zip(noises, left, strict=True)])[
            :, np.newaxis
        ]
        weighted = weight * slopes
        spread = covariance(
            weighted.T @ slopes, np.append(fit.prior_precision, np.zeros(len(others)))
        )
        amounts = -spread.matrix @ (weighted.T @ innovation)
    errors_squared = spread.standard_errors**2
    for disturbance in disturbances:
        pieces = [
            noise.whiten(disturbance[o][problem.present[o]], problem.present[o])
            for o, noise in fit.noise.items()
        ]
        moved = spread.matrix @ (weighted.T @ np.concatenate(pieces))
        errors_squared = errors_squared + moved**2 / len(disturbances)
    own, n = weighted[:, : len(fit.q)], len(fit.q)
    shifts = -covariance(own.T @ slopes[:, :n], fit.prior_precision).matrix @ (
        own.T @ slopes[:, n:]
    )
    found = zip(amounts[n:], np.sqrt(errors_squared[n:]), shifts.T, strict=True)
    return [Amount(float(value), float(error), shift) for value, error, shift in found]
