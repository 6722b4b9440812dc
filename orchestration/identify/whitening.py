"""Residuals of all outputs in one column, white and weighted: their least squares are the likelihood's optimum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestration.identify.noise import Noise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Whitening:
    """A filter for the residuals of all outputs, and a weight for every innovation.

    Attributes
    ----------
    noise : Mapping of str to Noise
        By output.
    present : Mapping of str to ndarray of bool, shape (n,)
        Where an output was measured.
    weights : Mapping of str to ndarray, shape (m,)
    """

    noise: Mapping[str, Noise]
    present: Mapping[str, NDArray[np.bool_]]
    weights: Mapping[str, Array]

    @classmethod
    def of(
        cls, noise: Mapping[str, Noise], residual: Mapping[str, Array], present: Mapping[str, NDArray[np.bool_]]
    ) -> Whitening:
        """Weigh innovations by how likely the noise makes those of a residual."""
        return cls(noise, present, {o: n.weights(n.whiten(residual[o], present[o])) for o, n in noise.items()})

    def __call__(self, values: Mapping[str, Array]) -> Array:
        """Stack residuals (m,), or Jacobians (m, p), of all outputs."""
        rows = []
        for output, noise in self.noise.items():
            white = noise.whiten(values[output], self.present[output])
            weight = np.sqrt(self.weights[output])
            rows.append(white * (weight if white.ndim == 1 else weight[:, np.newaxis]))
        return np.concatenate(rows)
