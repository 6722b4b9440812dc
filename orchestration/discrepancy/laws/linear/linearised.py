"""A record linearised about an unknown input, whitened and free of the model's own parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear

from fmus.kit.arrays import Array, Mask
from orchestration.discrepancy.laws.evidence import Curve
from orchestration.discrepancy.laws.linear.unknown_input import UnknownInput
from orchestration.identify.noise import Noise, Whitening

# of noise, which show what the best of many entries gains by chance
_DRAWS = 39
_SEED = 14


class LinearisedRecord:
    """Residuals to be explained, whitened, and free of what the model's own parameters can do.

    Parameters
    ----------
    course : UnknownInput
    prior : ndarray, shape (p,)
        Precision of the model's own coordinates.
    present : Mapping of str to ndarray of bool, shape (n,)
        Samples at which an output was measured.
    noise : Mapping of str to Noise
    reach : tuple of ndarray, shape (p,)
        Least and largest steps of the coordinates.
    """

    def __init__(
        self,
        course: UnknownInput,
        prior: Array,
        present: Mapping[str, Mask],
        noise: Mapping[str, Noise],
        reach: tuple[Array, Array],
    ):
        # an outlier is what no course explains, and not what a model lacks
        self._whitened = Whitening.of(noise, course.unexplained, present)
        columns = self._whitened(course.slopes)
        sizes = np.linalg.norm(columns, axis=0)
        kept = sizes > 0.0
        # rows for the prior, so that a parameter that it holds takes nothing away
        whole = np.vstack([columns, np.diag(np.sqrt(prior))])[:, kept] / sizes[kept]
        u, strength, right = np.linalg.svd(whole, full_matrices=False)
        seen = strength > 1e-7 * strength.max(initial=0.0)
        self._own = u[:, seen][: len(columns)]
        self._back = np.zeros((len(sizes), len(columns)))
        self._back[kept] = (right[seen].T / strength[seen]) @ self._own.T / sizes[kept, None]
        self._whole = self._whitened(course.residual)
        self._slopes = columns
        # how far a parameter of the model may go: what a course makes of its trace is not what is
        # there without
        self._prior = prior
        least, most = reach
        self._least = np.where(prior > 0.0, least, -np.inf)
        self._most = np.where(prior > 0.0, most, np.inf)
        self.residual = self.free(self._whole)
        self.samples = len(self.residual)
        self.noise = np.random.default_rng(_SEED).normal(size=(self.samples, _DRAWS))

    def within_reach(self, curves: Sequence[Curve], columns: Array) -> list[tuple[Curve, Array]]:
        """Return curves, and the steps (p,) of the own parameters beside each, within their bounds.

        Parameters
        ----------
        curves : sequence of Curve
            The likeliest without bounds, s of them, each by itself.
        columns : ndarray, shape (s, k, m)
            Responses of the whitened outputs to the hat functions of each.
        """
        values = np.array([curve.values for curve in curves]).reshape(columns.shape[:2])
        unbounded = (_effects(values, columns) - self._whole) @ self._back.T
        steps = np.clip(unbounded, self._least, self._most)
        bounded = list(curves)
        for i in np.flatnonzero((steps != unbounded).any(axis=1)).tolist():
            bounded[i], steps[i] = self._bounded(curves[i], columns[i].T)
            values[i] = bounded[i].values
        remaining = self._whole - _effects(values, columns) + steps @ self._slopes.T
        falls = float(self.residual @ self.residual) - np.sum(remaining**2, axis=1)
        gains = (
            min(curve.gain, fall - curve.complexity)
            for curve, fall in zip(bounded, falls.tolist(), strict=True)
        )
        return [
            (replace(curve, gain=gain), step)
            for curve, gain, step in zip(bounded, gains, steps, strict=True)
        ]

    def left(self, curve: Curve) -> float:
        """Return the squares of what a curve leaves, with the price of its bends."""
        return float(self.residual @ self.residual) - curve.gain

    def _bounded(self, curve: Curve, columns: Array) -> tuple[Curve, Array]:
        """Solve for curve and step together, the steps within their bounds."""
        values, axes = np.linalg.eigh(curve.prior)
        root = axes * np.sqrt(np.clip(values, 0.0, None))
        count = len(self._least)
        matrix, target = self._reduced(-columns @ root)
        sizes = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
        free = np.full(len(root), np.inf)
        bounds = (np.append(self._least, -free) * sizes, np.append(self._most, free) * sizes)
        solution = lsq_linear(matrix / sizes, target, bounds, method="bvls").x / sizes
        return replace(curve, values=root @ solution[count:]), solution[:count]

    def _reduced(self, effect: Array) -> tuple[Array, Array]:
        """Return the least squares of steps and curve as so many rows (p + k) as coordinates.

        The columns of the steps are the first for all curves, and decomposed once.

        Parameters
        ----------
        effect : ndarray, shape (m, k)
            Of the coordinates of a curve, whose prior is of unit size.
        """
        samples, width = effect.shape
        own, triangle = self._steps
        count = triangle.shape[1]
        beside = np.vstack([effect, np.zeros((count, width))])  # rows of the prior of the steps
        along = own.T @ beside
        q, r = np.linalg.qr(np.vstack([beside - own @ along, np.eye(width)]))
        matrix = np.block([[triangle, along], [np.zeros((width, count)), r]])
        target = np.append(own[:samples].T @ self._whole, q[:samples].T @ self._whole)
        return matrix, -target

    @cached_property
    def _steps(self) -> tuple[Array, Array]:
        """Decomposition of the steps' columns with their prior, (m + p, p) and (p, p)."""
        whole = np.vstack([self._slopes, np.diag(np.sqrt(self._prior))])
        sizes = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        own, triangle = np.linalg.qr(whole / sizes)
        return own, triangle * sizes

    def own(self, columns: Array) -> Array:
        """Return the part of columns that parameters can make, in an orthonormal basis."""
        return np.asarray(self._own.T @ columns)

    def free(self, columns: Array) -> Array:
        """Return columns without the part that parameters can make."""
        return np.asarray(columns - self._own @ self.own(columns))

    def __call__(self, responses: Mapping[str, Array]) -> Array:
        """Return the whitened responses of outputs where they were measured."""
        return np.asarray(self._whitened(responses))


def _effects(values: Array, columns: Array) -> Array:
    """Return the effects (s, m) of curves (s, k), from the responses (s, k, m) to their hats."""
    return np.asarray((values[:, None] @ columns)[:, 0])
