"""Prediction errors as functions of F, C and D alone, by variable projection.

Given F, C and D, the errors are linear in A, B, the offset and the free responses, which are at
their optimum wherever errors are evaluated (Golub and Pereyra: SIAM J. Numerical Analysis 10,
1973). Slopes are those of Kaufman (BIT 15, 1975): of the errors by F, C and D, less the part
that linear parameters can undo.

Coordinates are the inverse hyperbolic tangents of reflection coefficients, so that every point is
a model whose F, C and D are stable (Monahan: Biometrika 71, 1984), and none ends at the edge of
the admissible set because it went straight there.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from fmus.kit.arrays import Array
from orchestration.identify.black_box.polynomials import (
    filtered,
    from_reflections,
    reflections,
    stabilised,
    triangle,
)
from orchestration.identify.black_box.prediction_error import PredictionError

_LARGEST = 1.0 - 1e-7  # reflection coefficient; beyond it is rounding
# singular value, relative to the largest, that is zero: free responses of equal paths are collinear
_UNDETERMINED = 1e-12


class _Projection(NamedTuple):
    """The optimum of the linear parameters, at one point.

    Attributes
    ----------
    theta : ndarray, shape (p,)
        All parameters.
    errors : ndarray, shape (samples,)
    regressors : ndarray, shape (q, samples)
        Derivatives of the errors by the linear parameters, each row of length one.
    weights : ndarray, shape (r, q)
        Their combinations that are orthonormal.
    slopes : ndarray, shape (k, size)
        Derivatives of the coefficients of F, C and D by coordinates.
    """

    theta: Array
    errors: Array
    regressors: Array
    weights: Array
    slopes: Array


class ReducedPredictionError:
    """Prediction errors as functions of the coordinates of F, C and D.

    Parameters
    ----------
    problem : PredictionError
    """

    def __init__(self, problem: PredictionError):
        n = problem.orders
        self.problem = problem
        self._counts = (*n.nf, n.nc, n.nd)
        # Noise whose time constant exceeds the record looks like a random walk, and a predictor
        # of such a memory like one that is unstable: poles and zeros of the noise
        # model keep that much inside the unit circle (decision 57). A path of such a time constant
        # shows in the response to its input.
        within_record = exp(-1.0 / max(problem.samples, 1))
        self._radii = (*(1.0 for _ in n.nf), within_record, within_record)
        self._last: tuple[bytes, _Projection] | None = None

    @property
    def size(self) -> int:
        """The number of coordinates."""
        return sum(self._counts)

    def blocks(self, x: Array) -> list[Array]:
        """Divide coordinates into those of every F, C and D."""
        return np.split(x, np.cumsum(self._counts)[:-1])

    def coordinates(self, polynomials: Sequence[Array]) -> Array:
        """Return the coordinates of every F, C and D, given as monic polynomials.

        Lower orders are filled up with zeros; roots outside of the admissible region are reflected.
        """
        blocks = []
        for polynomial, count, radius in zip(polynomials, self._counts, self._radii, strict=True):
            scaled = polynomial / radius ** np.arange(len(polynomial))
            filled = np.pad(stabilised(scaled), (0, count + 1 - len(scaled)))
            k = np.clip(reflections(filled) / _LARGEST, -_LARGEST, _LARGEST)
            blocks.append(np.arctanh(k))
        return np.concatenate(blocks)

    def polynomials(self, x: Array) -> list[Array]:
        """Return every F, C and D at a point."""
        return [polynomial for polynomial, _ in self._polynomials_and_slopes(x)]

    def _polynomials_and_slopes(self, x: Array) -> list[tuple[Array, Array]]:
        """Return every F, C and D, and the derivatives of their coefficients by coordinates."""
        shapes = []
        for block, radius in zip(self.blocks(x), self._radii, strict=True):
            k = np.tanh(block)
            scale = radius ** np.arange(len(k) + 1)
            polynomial, slopes = from_reflections(_LARGEST * k)
            by_coordinates = scale[:, np.newaxis] * slopes * _LARGEST * (1.0 - k**2)
            shapes.append((scale * polynomial, by_coordinates[1:]))
        return shapes

    def theta(self, x: Array) -> Array:
        """Return all parameters (p,), the linear ones at their optimum."""
        return self._projection_at(x).theta

    def errors(self, x: Array) -> Array:
        """Return the prediction errors (samples,)."""
        return self._projection_at(x).errors

    def jacobian(self, x: Array) -> Array:
        """Return the derivatives (samples, size) of the errors by the coordinates.

        They are projected onto the complement of the span of the linear parameters.
        """
        projection = self._projection_at(x)
        parts = self.problem.coefficients(projection.theta)
        rows = projection.slopes.T @ self.problem.nonlinear_slopes(parts)
        regressors, weights = projection.regressors, projection.weights
        undone = rows @ regressors.T @ weights.T @ weights
        return (rows - undone @ regressors).T

    def _projection_at(self, x: Array) -> _Projection:
        """Return the optimum of the linear parameters at a point, and keep it for the next call."""
        key = x.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = (key, self._project(x))
        return self._last[1]

    def _project(self, x: Array) -> _Projection:
        """Compute the optimum of the linear parameters at a point."""
        problem = self.problem
        polynomials, slopes = zip(*self._polynomials_and_slopes(x), strict=True)
        theta = np.zeros(problem.size)
        theta[~problem.linear] = np.concatenate([monic[1:] for monic in polynomials])
        regressors, length = _normalised(problem.linear_slopes(problem.coefficients(theta)))
        c, d = polynomials[-2:]
        without_linear = filtered(d, c, problem.present_output)
        solution, weights = _least_squares(regressors, without_linear)
        theta[problem.linear] = solution / length
        errors = without_linear + solution @ regressors
        return _Projection(theta, errors, regressors, weights, block_diag(*slopes))


def _normalised(rows: Array) -> tuple[Array, Array]:
    """Scale rows (p, n) to unit length in place; return rows and lengths (p,), 1 for zeros."""
    length = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    length[length == 0.0] = 1.0
    rows /= length[:, np.newaxis]
    return rows, length


def _least_squares(regressors: Array, unprojected: Array) -> tuple[Array, Array]:
    """Return the weights of regressors with which errors are least.

    Parameters
    ----------
    regressors : ndarray, shape (q, n)
    unprojected : ndarray, shape (n,)
        The errors without them.

    Returns
    -------
    solution : ndarray, shape (q,)
    weights : ndarray, shape (r, q)
        Combinations of the regressors that are orthonormal.
    """
    count = len(regressors)
    reduced = triangle(np.vstack([regressors, unprojected]))
    u, s, v = np.linalg.svd(reduced[:count, :count])
    kept = s > _UNDETERMINED * s.max(initial=0.0)
    weights = v[kept] / s[kept, np.newaxis]
    return -(u[:, kept].T @ reduced[:count, count]) @ weights, weights
