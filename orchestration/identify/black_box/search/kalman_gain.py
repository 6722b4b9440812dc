"""The gain of a Kalman predictor, by the prediction-error method: the colour of what a simulation leaves unexplained.

With A and C known, ``v = C x + e``, ``x' = A x + K e``; K makes e smallest (Ljung, sections 4.3 and 7.2).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.black_box.models.state_space import states
from orchestration.identify.black_box.polynomials import solved
from orchestration.identify.black_box.search.gauss_newton import minimise
from orchestration.identify.black_box.search.start_values import innovations

Array = NDArray[np.float64]
_INSIDE = 1.0 - 1e-7  # largest modulus of an eigenvalue of a predictor that is called stable


def kalman_gain(a: Array, c: Array, disturbance: Array) -> Array:
    """Return the gain (n,) of the stationary predictor.

    Parameters
    ----------
    a : ndarray, shape (n, n)
        Stable.
    c : ndarray, shape (n,)
    disturbance : ndarray, shape (samples,)
        Output less simulation.

    Returns
    -------
    ndarray, shape (n,)
        The better one of two searches, from no gain and from that of a long autoregression's innovations.
    """
    problem = _GainErrors(a, c, disturbance)
    e = innovations(disturbance, len(a))
    effect = states(a.T, np.outer(e, c), np.zeros(len(a)))
    long = solved(effect, disturbance - e)
    starts = [start for start in (long, np.zeros(len(a))) if problem.admissible(start)]
    return min((minimise(problem, start) for start in starts), key=lambda found: found.cost).theta


class _GainErrors:
    """Prediction errors as functions of the gain.

    Parameters
    ----------
    a, c, disturbance
        See `kalman_gain`.
    """

    def __init__(self, a: Array, c: Array, disturbance: Array):
        self._a, self._c, self._v = a, c, disturbance

    def errors(self, gain: Array) -> Array:
        """Return the prediction errors (n,)."""
        predicted = (
            states(self._a - np.outer(gain, self._c), np.outer(self._v, gain), np.zeros(len(gain)))
            @ self._c
        )
        return np.asarray(self._v - predicted, dtype=np.float64)

    def jacobian(self, gain: Array) -> Array:
        """Return their derivatives (n, p): the errors, through the predictor."""
        predictor = self._a - np.outer(gain, self._c)
        return -states(predictor.T, np.outer(self.errors(gain), self._c), np.zeros(len(gain)))

    def admissible(self, gain: Array) -> bool:
        """Whether the predictor is stable."""
        return bool(np.abs(np.linalg.eigvals(self._a - np.outer(gain, self._c))).max() < _INSIDE)
