"""Data that no fit has seen: what a model says of them is what it is worth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.evidence import Data, Evidence
from orchestration.discrepancy.noise import Noise
from orchestration.identify.damped import minimise
from orchestration.identify.problem import Problem
from orchestration.identify.residuals import normalised_rms

Array = NDArray[np.float64]
HELD_OUT = 1.0 / 3.0  # of a record, its end
_RUN_IN = 1.0 / 6.0  # of a record of its own: there the states at its start are estimated, and nothing is judged


@dataclass(frozen=True)
class Unseen:
    """The part of a record that is judged, and what a simulation of it begins with.

    Attributes
    ----------
    data : Data
        Simulated from its first sample on.
    first : int
        The sample from which on nothing was fitted to.
    continued : bool
        Whether it continues the record that was fitted to, or is one of its own, whose starting states are estimated on
        the samples before ``first``.
    """

    data: Data
    first: int
    continued: bool

    @classmethod
    def end_of(cls, data: Data) -> Unseen:
        """Hold out the end of a record."""
        return cls(data, round(len(data.time) * (1.0 - HELD_OUT)), True)

    @classmethod
    def another(cls, data: Data) -> Unseen:
        """Hold out a record of its own."""
        return cls(data, round(len(data.time) * _RUN_IN), False)

    def values(self, evidence: Evidence) -> dict[str, float]:
        """Parameters with which a fitted model is simulated here, start values included, SI."""
        values = evidence.problem.start | evidence.fitted.values
        if self.continued:
            return values
        layout, before = evidence.candidate.cls.layout, self.data.part(0, self.first)
        starts = [f"{state.name}_start" for state in layout.states]
        problem = Problem(evidence.candidate.cls, before.time, before.inputs, before.measured, starts, values)
        low, high = problem.bounds()

        def weighed(which: int, q: Array) -> Array:
            parts = problem.evaluate(q)[which]
            return np.concatenate([parts[o] / evidence.fitted.noise[o].deviation for o in parts])

        q = minimise(lambda q: weighed(0, q), lambda q: weighed(1, q), problem.position(problem.start), low, high)
        return values | problem.values(q)

    def simulated(self, evidence: Evidence) -> dict[str, Array]:
        """Outputs of a fitted model over the whole of the data, SI."""
        signals = evidence.problem.model.run(self.data.time, self.data.inputs, self.values(evidence)).signals
        return {o: signals[o] for o in self.data.measured}

    def errors(self, simulated: dict[str, Array]) -> dict[str, float]:
        """Normalised RMS error of every output, where nothing was fitted."""
        return {o: normalised_rms(y[self.first :], simulated[o][self.first :]) for o, y in self.data.measured.items()}

    def misfit(self, simulated: dict[str, Array], noise: dict[str, Noise]) -> float:
        """Sum of the squared innovations where nothing was fitted, in units of their variance."""
        total = 0.0
        for output, y in self.data.measured.items():
            present = np.isfinite(y)
            present[: self.first] = False
            total += float((noise[output].whiten((simulated[output] - y)[present], present) ** 2).sum())
        return total
