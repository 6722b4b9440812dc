"""A record linearised about an unknown input, whitened and free of the model's own parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

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
        seen = strength > 1e-7 * strength.max()
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

    def within_reach(self, curve: Curve, columns: Array) -> tuple[Curve, Array]:
        """Return a curve, and the step (p,) of the own parameters beside it, within their bounds.

        Parameters
        ----------
        curve : Curve
            The likeliest without bounds.
        columns : ndarray, shape (m, k)
            Responses of the whitened outputs to its hat functions.
        """
        unbounded = -self._back @ (self._whole - columns @ curve.values)
        bounded_curve = curve
        step = np.clip(unbounded, self._least, self._most)
        if not np.array_equal(step, unbounded):
            bounded_curve, step = self._bounded(curve, columns)
        remaining = self._whole - columns @ bounded_curve.values + self._slopes @ step
        fall = float(self.residual @ self.residual - remaining @ remaining)
        gain = min(curve.gain, fall - curve.complexity)
        return replace(bounded_curve, gain=gain), step

    def left(self, curve: Curve) -> float:
        """Return the squares of what a curve leaves, with the price of its bends."""
        return float(self.residual @ self.residual) - curve.gain

    def _bounded(self, curve: Curve, columns: Array) -> tuple[Curve, Array]:
        """Solve for curve and step together, the steps within their bounds."""
        values, axes = np.linalg.eigh(curve.prior)
        root = axes * np.sqrt(np.clip(values, 0.0, None))
        count = len(self._least)
        rows = np.hstack([self._slopes, -columns @ root])
        whole = np.vstack([rows, np.diag(np.append(np.sqrt(self._prior), np.ones(len(root))))])
        sizes = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        q, r = np.linalg.qr(whole / sizes)
        free = np.full(len(root), np.inf)
        bounds = (np.append(self._least, -free) * sizes, np.append(self._most, free) * sizes)
        target = -q[: len(rows)].T @ self._whole
        solution = lsq_linear(r, target, bounds, method="bvls").x / sizes
        return replace(curve, values=root @ solution[count:]), solution[:count]

    def own(self, columns: Array) -> Array:
        """Return the part of columns that parameters can make, in an orthonormal basis."""
        return np.asarray(self._own.T @ columns)

    def free(self, columns: Array) -> Array:
        """Return columns without the part that parameters can make."""
        return np.asarray(columns - self._own @ self.own(columns))

    def __call__(self, responses: Mapping[str, Array]) -> Array:
        """Return the whitened responses of outputs where they were measured."""
        return np.asarray(self._whitened(responses))
