"""The input of a simulation over a record, as all models that are fitted take it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit.arrays import Array, Signals


@dataclass(frozen=True)
class SimulationInput:
    """A stimulus, the parameters of a model, and the effort of its integrator.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs : Mapping of str to ndarray, shape (n,)
        SI; of an FMU in its own units, as are the parameters.
    parameters : Mapping of str to float
    effort : float
        Internal steps per sample, on average, beyond which the model has become too stiff.
    linear : bool
        Whether inputs go in straight lines between samples, or are held.
    """

    time: Array
    inputs: Signals
    parameters: Mapping[str, float]
    effort: float = 1e6
    linear: bool = False

    def over(self, rows: slice) -> SimulationInput:
        """Return the input over some of its samples."""
        n = len(self.time)
        inputs = {name: np.broadcast_to(values, n)[rows] for name, values in self.inputs.items()}
        return replace(self, time=self.time[rows], inputs=inputs)

    def with_input(self, name: str, course: Array) -> SimulationInput:
        """Return the same with another course (n,) of an input."""
        return replace(self, inputs={**self.inputs, name: course})
