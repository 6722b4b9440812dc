"""A fitted model, linear in its coordinates: the improvement that a change would bring to a fit.

The colour of the noise is estimated anew from what the change leaves, not from what the model
without it does: a slow effect looks like noise with a long memory to a model that has no state for
it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.arrays import Array
from orchestration.identify.fitting import FitResult, Problem
from orchestration.identify.noise import Noise, Whitening, white_noise
from orchestration.identify.uncertainty import parameter_covariance

Gradient = Mapping[str, NDArray[Any]]
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
    amount : float
        Of the change that is put to use.
    step : ndarray, shape (p,)
        Of the searched coordinates of the model, beside it.
    noise : dict of str to Noise
        What then remains as noise, by output.
    """

    fall: float
    amount: float
    step: Array
    noise: dict[str, Noise]


class LinearisedModel:
    """A fitted model, linear in its searched coordinates.

    Parameters
    ----------
    problem : Problem
    fit : FitResult
    """

    def __init__(self, problem: Problem, fit: FitResult):
        error, jacobian = problem.evaluate(fit.q)
        self._error = error
        self._jacobian = jacobian
        self._present = problem.present
        self._fit = fit
        prior_mean = problem.position(problem.start)
        self._centre = np.where(fit.prior_precision > 0.0, prior_mean, fit.q)
        self._gradient_of_prior = fit.prior_precision * (fit.q - self._centre)
        low, high = problem.bounds()
        self._bounds = low - fit.q, high - fit.q
        self._estimate = problem.noise
        self._whitenings = [self._whitening(noise) for noise in (fit.noise, white_noise(error))]

    def _whitening(self, noise: Mapping[str, Noise]) -> tuple[Whitening, Array, Array, Array]:
        """Return the whitening, whitened residual and Jacobian, and the coordinates' covariance."""
        whitened = Whitening.of(noise, self._error, self._present)
        slopes = whitened(self._jacobian)
        return whitened, whitened(self._error), slopes, self._covariance(slopes)

    def _covariance(self, slopes: Array) -> Array:
        """Return the covariance of the coordinates, bounded where the record determines little."""
        information = slopes.T @ slopes
        ridge = _RIDGE * (np.diag(information) + self._fit.prior_precision)
        return parameter_covariance(information, self._fit.prior_precision + ridge).matrix

    def score_statistics(self, change: Gradient, least: float, most: float) -> list[float]:
        """Return the fall of the sum of squares with some of a change, in two kinds of noise.

        Parameters
        ----------
        change : Mapping of str to ndarray, shape (m,)
            What all of it adds to the residual, by output.
        least, most : float
            Bounds of the amount.

        Returns
        -------
        list of float
            In the noise as estimated, and in white noise.
        """
        falls = []
        for whitened, residual, slopes, spread in self._whitenings:
            column = whitened(change)
            orthogonal = column - slopes @ (spread @ (slopes.T @ column))
            power = float(orthogonal @ orthogonal)
            if power <= _FLAT * float(column @ column):
                falls.append(0.0)
                continue
            amount = float(np.clip(-float(orthogonal @ residual) / power, least, most))
            falls.append(-amount * (2.0 * float(orthogonal @ residual) + amount * power))
        return falls

    def identifiable_share(self, change: Gradient) -> float:
        """Return the share of a change, in power, that the model's own coordinates cannot make."""
        column, orthogonal = self._orthogonal_part(change)
        power = float(column @ column)
        return float(orthogonal @ orthogonal) / power if power > 0.0 else 0.0

    def confounded_share(self, change: Gradient) -> Callable[[Gradient], float]:
        """Return a function of another change: the share of this change that it makes, in power.

        Of both changes only what the model's own coordinates cannot make counts.
        """
        _, one = self._orthogonal_part(change)

        def share(other: Gradient) -> float:
            _, orthogonal = self._orthogonal_part(other)
            power = float(one @ one) * float(orthogonal @ orthogonal)
            return float(one @ orthogonal) ** 2 / power if power > 0.0 else 0.0

        return share

    def _orthogonal_part(self, change: Gradient) -> tuple[Array, Array]:
        """Return a change in units of white noise, and its part that no own coordinates make."""
        whitened, _, slopes, spread = self._whitenings[1]
        column = whitened(change)
        return column, column - slopes @ (spread @ (slopes.T @ column))

    def predicted_improvement(
        self, change: Gradient, least: float, most: float
    ) -> PredictedImprovement:
        """Solve for an amount of a change, within bounds, beside the model's own coordinates."""
        whitened, *_ = self._whitenings[1]
        for _ in range(_ROUNDS):
            amount, step = self._solved(whitened, change, least, most)
            remaining = {
                o: e + amount * change[o] + self._jacobian[o] @ step for o, e in self._error.items()
            }
            noise = self._estimate(remaining)
            whitened = Whitening.of(noise, remaining, self._present)
        return PredictedImprovement(self._fall(step, remaining, noise), amount, step, dict(noise))

    def _solved(
        self, whitened: Whitening, change: Gradient, least: float, most: float
    ) -> tuple[float, Array]:
        """Return the amount of a change and the step of the coordinates, the noise given."""
        residual = whitened(self._error)
        slopes = whitened(self._jacobian)
        column = whitened(change)
        spread = self._covariance(slopes)
        along = spread @ (slopes.T @ column)
        power = float(column @ column - (slopes.T @ column) @ along)
        gradient = slopes.T @ residual + self._gradient_of_prior
        wanted = -float(column @ residual - along @ gradient) / power if power > 0.0 else 0.0
        amount = float(np.clip(wanted, least, most))
        return amount, np.clip(-spread @ gradient - amount * along, *self._bounds)

    def _fall(
        self, step: Array, remaining: Mapping[str, Array], noise: Mapping[str, Noise]
    ) -> float:
        """Return the fall of BIC, the change costing nothing."""
        fit = self._fit
        moved = fit.q + step - self._centre
        order = sum(n.parameters for n in noise.values())
        order -= sum(n.parameters for n in fit.noise.values())
        deviance = sum(
            n.deviance(n.whiten(remaining[o], self._present[o]), self._present[o])
            for o, n in noise.items()
        )
        deviance += float(fit.prior_precision @ moved**2)
        return float(fit.deviance - deviance - order * np.log(fit.samples))
