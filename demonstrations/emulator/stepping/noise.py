"""Noise of sensors, drawn sample by sample."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

# standard deviations of the sensors of the bench, by the resolutions 0.001 N and 0.003 mm of thesis
# section 2.2.2; computed signals have no noise of their own
DEVIATIONS = {
    "voltage": 4e-3,
    "displacement": 3e-6,
    "force_measured": 1e-3,
    "position_measured": 3e-6,
    "tension": 1e-3,
}


class Noise:
    """Stationary AR(1) noise, independent for every output.

    Parameters
    ----------
    deviations : mapping of str to float
        Standard deviation by output, SI.
    seed : int
    colour : float
        Lag-one correlation, between -1 and 1.

    Attributes
    ----------
    values : dict of str to float
        Noise of the present sample by output.
    """

    def __init__(self, deviations: Mapping[str, float], seed: int, colour: float = 0.0):
        if not -1 < colour < 1:
            raise ValueError(f"noise colour {colour!r}: must lie between -1 and 1")
        self._deviations = dict(deviations)
        self._colour = colour
        self._fresh = float(np.sqrt(1 - colour**2))
        self._random = np.random.default_rng(seed)
        self._now = self._random.standard_normal(len(self._deviations))
        self.values = self._scaled()

    def sample(self) -> None:
        """Draw the next sample."""
        self._now = self._colour * self._now + self._fresh * self._random.standard_normal(
            self._now.size
        )
        self.values = self._scaled()

    def _scaled(self) -> dict[str, float]:
        return {
            name: float(d * z)
            for (name, d), z in zip(self._deviations.items(), self._now, strict=True)
        }
