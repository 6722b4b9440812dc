"""What a fitted model could do about a change of its outputs if all were linear, the colour of the noise included.

The noise is estimated from what the change leaves, not from what the model without it does: a slow effect looks like
noise with a long memory to a model that has no word for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.noise import Noise, estimate, white
from orchestration.identify.prediction_error import Fitted
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
Columns = Mapping[str, NDArray[Any]]
_ROUNDS = 3  # of solving with a colour and estimating the colour from what is left
_RIDGE = 1e-9  # relative to the curvature
_FLAT = 1e-10  # share of a change that the model could not make itself, below which there is none


@dataclass(frozen=True)
class Outlook:
    """What is expected of a fit.

    Attributes
    ----------
    fall : float
        Of the information criterion, the change costing nothing.
    amount : float
        Of the change that is put to use.
    step : ndarray, shape (p,)
        Of the searched coordinates of the model, beside it.
    noise : dict of str to Noise
        What is then left as noise, by output.
    """

    fall: float
    amount: float
    step: Array
    noise: dict[str, Noise]

    def still(self) -> Outlook:
        """The same without a step."""
        return replace(self, step=np.zeros_like(self.step))


class Linearised:
    """A fitted model, linear in its searched coordinates.

    Parameters
    ----------
    problem : Problem
    fitted : Fitted
    """

    def __init__(self, problem: Problem, fitted: Fitted):
        error, jacobian = problem.evaluate(fitted.q)
        self._error, self._jacobian, self._present, self._even = error, jacobian, problem.present, problem.even
        self._fitted = fitted
        believed = problem.position(problem.start)
        self._centre = np.where(fitted.belief > 0.0, believed, fitted.q)
        self._pull = fitted.belief * (fitted.q - self._centre)
        low, high = problem.bounds()
        self._room = low - fitted.q, high - fitted.q
        self._views = [self._view(noise) for noise in (fitted.noise, white(error, problem.even))]

    def _view(self, noise: Mapping[str, Noise]) -> tuple[Mapping[str, Noise], Array, Array, Array]:
        """Whitened residual and Jacobian, and the covariance of the coordinates."""
        left, slopes = self._whitened(self._error, noise), self._whitened(self._jacobian, noise)
        return noise, left, slopes, inverse(slopes.T @ slopes + np.diag(self._fitted.belief))

    def _whitened(self, values: Columns, noise: Mapping[str, Noise]) -> Array:
        return np.concatenate([n.whiten(values[o], self._present[o]) for o, n in noise.items()])

    def falls(self, change: Columns, least: float, most: float) -> list[float]:
        """By how much the sum of squares would fall with some of a change: in the noise found, and in white."""
        found = []
        for noise, left, slopes, covariance in self._views:
            column = self._whitened(change, noise)
            new = column - slopes @ (covariance @ (slopes.T @ column))
            power = float(new @ new)
            if power <= _FLAT * float(column @ column):
                found.append(0.0)
                continue
            amount = float(np.clip(-float(new @ left) / power, least, most))
            found.append(-amount * (2.0 * float(new @ left) + amount * power))
        return found

    def own(self, change: Columns) -> float:
        """Share of a change, in power, that the model's own coordinates cannot make."""
        column, new = self._new(change)
        power = float(column @ column)
        return float(new @ new) / power if power > 0.0 else 0.0

    def alike(self, change: Columns) -> Callable[[Columns], float]:
        """Return what tells the share of a change, in power, that some of another makes, beyond the model's own."""
        one = self._new(change)[1]

        def share(other: Columns) -> float:
            new = self._new(other)[1]
            power = float(one @ one) * float(new @ new)
            return float(one @ new) ** 2 / power if power > 0.0 else 0.0

        return share

    def _new(self, change: Columns) -> tuple[Array, Array]:
        """Return a change in units of white noise, and what of it the model's own coordinates cannot make."""
        noise, _, slopes, covariance = self._views[1]
        column = self._whitened(change, noise)
        return column, column - slopes @ (covariance @ (slopes.T @ column))

    def outlook(self, change: Columns, least: float, most: float) -> Outlook:
        """Solve for an amount of a change, within bounds, and the model's own coordinates beside it."""
        noise: Mapping[str, Noise] = self._views[1][0]
        for _ in range(_ROUNDS):
            left, slopes = self._whitened(self._error, noise), self._whitened(self._jacobian, noise)
            column = self._whitened(change, noise)
            covariance = inverse(slopes.T @ slopes + np.diag(self._fitted.belief))
            along = covariance @ (slopes.T @ column)
            power = float(column @ column - (slopes.T @ column) @ along)
            pulled = slopes.T @ left + self._pull
            wanted = -float(column @ left - along @ pulled) / power if power > 0.0 else 0.0
            amount = float(np.clip(wanted, least, most))
            step = np.clip(-covariance @ pulled - amount * along, *self._room)
            rest = {o: e + amount * change[o] + self._jacobian[o] @ step for o, e in self._error.items()}
            noise = {o: estimate(e, self._present[o], self._even) for o, e in rest.items()}
        below = self._fitted
        moved = below.q + step - self._centre
        innovations = {o: len(n.whiten(rest[o], self._present[o])) for o, n in noise.items()}
        order = sum(len(n.coefficients) for n in noise.values()) - sum(
            len(n.coefficients) for n in below.noise.values()
        )
        deviance = sum(2.0 * innovations[o] * np.log(n.deviation) for o, n in noise.items())
        deviance += float(below.belief @ moved**2)
        fall = below.deviance - deviance - order * np.log(below.samples)
        return Outlook(float(fall), amount, step, dict(noise))


def inverse(curvature: Array) -> Array:
    """Inverse of a normal matrix, scaled before; a coordinate of which it knows nothing stays where it is."""
    scale = np.sqrt(np.diag(curvature))
    scale[scale == 0.0] = 1.0
    unit = curvature / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
    return np.asarray(np.linalg.inv(unit) / np.outer(scale, scale))
