"""A record as it is about a free course: whitened, and free of what the model's own parameters can do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from orchestration.discrepancy.laws.evidence import Curve
from orchestration.discrepancy.laws.linear.course import FreeCourse
from orchestration.identify.noise.model import Noise, Whitening

Array = NDArray[np.float64]
_DRAWS, _SEED = (
    39,
    14,
)  # of noise, by which is told what the best of so many entries gains by chance


class LinearisedRecord:
    """What is to be explained, whitened, and free of what the model's own parameters can do."""

    def __init__(
        self,
        course: FreeCourse,
        prior: Array,
        present: Mapping[str, NDArray[np.bool_]],
        noise: Mapping[str, Noise],
        reach: tuple[Array, Array],
    ):
        residual, slopes = course.residual, course.slopes
        # an outlier is what no course explains, and not what a model lacks
        self._whitened = Whitening.of(noise, course.left, present)
        columns = self._whitened(slopes)
        sizes = np.linalg.norm(columns, axis=0)
        kept = sizes > 0.0
        # rows for the prior, so that a parameter that it holds takes nothing away
        whole = np.vstack([columns, np.diag(np.sqrt(prior))])[:, kept] / sizes[kept]
        left, strength, right = np.linalg.svd(whole, full_matrices=False)
        seen = strength > 1e-7 * strength.max()
        self._own = left[:, seen][: len(columns)]
        self._back = np.zeros((len(sizes), len(columns)))
        self._back[kept] = (right[seen].T / strength[seen]) @ self._own.T / sizes[kept, None]
        self._whole, self._slopes = self._whitened(residual), columns
        # how far a parameter of the model may go: what a course makes of its trace is not what is there without
        self._prior = prior
        least, most = reach
        self._least, self._most = (
            np.where(prior > 0.0, least, -np.inf),
            np.where(prior > 0.0, most, np.inf),
        )
        self.residual = self.free(self._whole)
        self.samples = len(self.residual)
        self.noise = np.random.default_rng(_SEED).normal(size=(self.samples, _DRAWS))

    def within_reach(self, curve: Curve, columns: Array) -> tuple[Curve, Array]:
        """Curve, and step (p,) of the model's own parameters beside it, where the step may not be as far as it would.

        Parameters
        ----------
        curve : Curve
            The likeliest where it may.
        columns : ndarray, shape (m, k)
            What its hat functions do to the whitened outputs.
        """
        would = -self._back @ (self._whole - columns @ curve.values)
        step = np.clip(would, self._least, self._most)
        if not np.array_equal(step, would):
            curve, step = self._bounded(curve, columns)
        left = self._whole - columns @ curve.values + self._slopes @ step
        fall = float(self.residual @ self.residual - left @ left)
        return replace(curve, gain=min(curve.gain, fall - curve.complexity)), step

    def _bounded(self, curve: Curve, columns: Array) -> tuple[Curve, Array]:
        """With steps as far as they may go the curve is another one, and so are the other steps."""
        values, axes = np.linalg.eigh(curve.prior)
        root = axes * np.sqrt(np.clip(values, 0.0, None))
        count = len(self._least)
        rows = np.hstack([self._slopes, -columns @ root])
        whole = np.vstack([rows, np.diag(np.append(np.sqrt(self._prior), np.ones(len(root))))])
        sizes = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
        q, r = np.linalg.qr(whole / sizes)
        free = np.full(len(root), np.inf)
        ends = (
            np.append(end, far) * sizes for end, far in ((self._least, -free), (self._most, free))
        )
        found = lsq_linear(r, -q[: len(rows)].T @ self._whole, tuple(ends), method="bvls").x / sizes
        return replace(curve, values=root @ found[count:]), found[:count]

    def own(self, columns: Array) -> Array:
        """What parameters can do of columns, in coordinates of its own."""
        return np.asarray(self._own.T @ columns)

    def free(self, columns: Array) -> Array:
        """Take away what parameters can do."""
        return np.asarray(columns - self._own @ self.own(columns))

    def __call__(self, responses: Mapping[str, Array]) -> Array:
        """Whiten responses of outputs where they were measured."""
        return np.asarray(self._whitened(responses))
