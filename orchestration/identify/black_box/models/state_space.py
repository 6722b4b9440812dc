"""A state-space model in innovations form, ``x' = A x + B u + K e``, ``y = C x + D u + e``.

Source: Ljung, eq. 4.91.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigvals, schur
from scipy.signal import lfilter

from fmus.kit.arrays import Array
from orchestration.identify.black_box.models.identified import IdentifiedModel
from orchestration.identify.black_box.polynomials import Roots, without_part_in

_INFINITE = 1e8  # modulus of a generalised eigenvalue that is a zero at infinity
_INTEGRATES = 1e-9  # distance from one at which a pole integrates


@dataclass(frozen=True)
class StateSpaceModel(IdentifiedModel):
    """A state-space model of one output, in innovations form.

    Attributes
    ----------
    a : ndarray, shape (n, n)
    b : ndarray, shape (n, m)
    c : ndarray, shape (n,)
    d : ndarray, shape (m,)
    k : ndarray, shape (n,)
        Gain of the stationary Kalman predictor.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    k: Array

    def _forced(self, deviations: Array) -> Array:
        x = states(self.a, deviations @ self.b.T, np.zeros(len(self.a)))
        return x @ self.c + deviations @ self.d

    def _free(self, samples: int) -> Array:
        return free_responses(self.a, self.c, samples)

    def static_output(self, deviations: Array) -> float:
        """Return the deviation of the output at rest under deviations of the inputs (m,)."""
        drive = self.b @ deviations
        count = len(self.a)
        if not drive.any():
            return float(self.d @ deviations)
        if count and np.abs(np.linalg.eigvals(self.a) - 1.0).min() < _INTEGRATES:
            return float("inf")
        return float(self.c @ np.linalg.solve(np.eye(count) - self.a, drive) + self.d @ deviations)

    def _innovations(self, deviations: Array, output: Array) -> Array:
        predictor = self.a - np.outer(self.k, self.c)
        drive = deviations @ (self.b - np.outer(self.k, self.d)).T + np.outer(output, self.k)
        e = output - states(predictor, drive, np.zeros(len(self.a))) @ self.c - deviations @ self.d
        return without_part_in(free_responses(predictor, self.c, len(e)), e)

    def noise_response(self, samples: int) -> Array:
        """Return the impulse response (samples,) from white noise to the output."""
        later = states(self.a, np.zeros((max(samples - 1, 0), len(self.a))), self.k) @ self.c
        return np.concatenate([[1.0], later])[:samples]

    def poles(self, which: int | str = 0) -> Roots:
        """Return the poles in z, which all paths share."""
        self._index(which)
        return np.asarray(np.linalg.eigvals(self.a), dtype=np.complex128)

    def zeros(self, which: int | str = 0) -> Roots:
        """Return the zeros in z of the path from an input, without those of delays."""
        i = self._index(which)
        count = len(self.a)
        upper = [self.a, self.b[:, [i]]]
        lower = [self.c[np.newaxis], self.d[[i], np.newaxis]]
        system = np.block([upper, lower])
        weight = np.diag(np.r_[np.ones(count), 0.0])
        above, below = eigvals(system, weight, homogeneous_eigvals=True)
        finite = np.abs(above) < _INFINITE * np.abs(below)
        return above[finite] / below[finite]

    def _path(self, i: int) -> tuple[Array, Array]:
        return self._quotient(self.b[:, i], self.d[i])

    def _noise_path(self) -> tuple[Array, Array]:
        return self._quotient(self.k, 1.0)

    def _quotient(self, column: Array, feedthrough: float) -> tuple[Array, Array]:
        """Return numerator and denominator in z of the path of a column of B, or of K."""
        # from the impulse response, in which samples before a delay are exactly zero
        count = len(self.a)
        denominator = np.real(np.poly(self.a))
        later = states(self.a, np.zeros((count, count)), column) @ self.c
        response = np.concatenate([[feedthrough], later])
        numerator = np.convolve(denominator, response)[: len(denominator)]
        return np.trim_zeros(numerator, "f"), denominator

    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """Return A, B, C and D of the paths from all inputs."""
        return self.a, self.b, self.c[np.newaxis], self.d[np.newaxis]

    def without_delays(self) -> tuple[StateSpaceModel, tuple[int, ...]]:
        """Return the model of inputs that were delayed before, and their delays in samples.

        A state that is an input a sample before is a delay.
        """
        a, b, c, d, k = self.a, self.b.copy(), self.c, self.d.copy(), self.k
        lags = [0] * b.shape[1]
        for i in range(len(lags)):
            while d[i] == 0.0 and np.count_nonzero(b[:, i]) == 1:
                x = int(np.flatnonzero(b[:, i])[0])
                if b[x, i] != 1.0 or np.count_nonzero(b[x]) > 1 or a[x].any() or c[x] != 0.0:
                    break
                b[:, i] = a[:, x]
                kept = np.arange(len(a)) != x
                a, b, c, k = a[np.ix_(kept, kept)], b[kept], c[kept], k[kept]
                lags[i] += 1
        return replace(self, a=a, b=b, c=c, d=d, k=k), tuple(lags)


def states(a: Array, drive: Array, start: Array) -> Array:
    """Return x of ``x(t+1) = A x(t) + drive(t)``, by one recursive filter for each state.

    Parameters
    ----------
    a : ndarray, shape (n, n)
    drive : ndarray, shape (samples, n)
    start : ndarray, shape (n,)
        The first state.

    Returns
    -------
    ndarray, shape (samples, n)
    """
    if not drive.size:
        return np.zeros_like(drive)
    # In unitary coordinates in which each state depends only on those after it. Eigenvectors would
    # be simpler, but may not exist.
    triangle, directions = schur(a, output="complex")
    driven = np.vstack([start, drive[:-1]]) @ directions.conj()
    x = np.zeros_like(driven)
    for i in reversed(range(len(a))):
        others = x[:-1, i + 1 :] @ triangle[i, i + 1 :]
        x[:, i] = lfilter(
            [1.0], [1.0, -triangle[i, i]], driven[:, i] + np.concatenate([[0.0], others])
        )
    return (x @ directions.T).real


def free_responses(a: Array, c: Array, samples: int) -> Array:
    """Return ``C A^t``, one row for each sample t (samples, n)."""
    return states(a.T, np.zeros((samples, len(a))), c)
