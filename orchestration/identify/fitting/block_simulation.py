"""Simulation of a long record block by block, for the sake of memory.

A simulation with derivatives has a column for every state and output by every parameter, most of
which nobody reads: the derivatives of states serve those of measured outputs alone. A block begins
with the states, and their derivatives, that the block before ended with.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from fmus.kit.record import CompiledModel, Trajectory
from orchestration.identify.fitting.simulation_input import SimulationInput

LONGEST = 20_000  # samples that are simulated in one piece
_BLOCK = 8_192  # samples that are simulated at once of more


class BlockwiseModel:
    """A compiled model that simulates a long record block by block.

    Parameters
    ----------
    model : CompiledModel
    measured : collection of str, optional
        Outputs and states of which a simulation in blocks has derivatives; all unless given.
    """

    def __init__(self, model: CompiledModel, measured: Collection[str] | None = None):
        self._model = model
        self._measured = measured

    def run(self, given: SimulationInput) -> Trajectory:
        """Simulate a record as `CompiledModel.run` does.

        With discrete states it is in one piece: a block would begin in the middle of their sample
        period.

        Parameters
        ----------
        given : SimulationInput

        Returns
        -------
        Trajectory
            All signals, and derivatives (n, p).

        Raises
        ------
        UserError
            If the simulation fails.
        """
        if len(given.time) > LONGEST and not self._model.layout.discretes:
            return self.run_in_blocks(given)
        return self._simulate_piece(given)

    def run_in_blocks(self, given: SimulationInput) -> Trajectory:
        """Simulate like `run`, however short the record is, with derivatives of measured outputs.

        A block may take all internal steps of the record that those before it did not take.
        """
        n = len(given.time)
        whole = self._empty_trajectory(n)
        start = dict(given.parameters)
        steps_left = given.effort * n
        for rows in _blocks(n):
            effort = steps_left / (rows.stop - rows.start)
            ran = self._simulate_piece(replace(given.over(rows), parameters=start, effort=effort))
            steps_left -= ran.steps
            for name, values in whole.signals.items():
                values[rows] = ran.signals[name]
            for name, slopes in whole.sensitivities.items():
                slopes[rows] = ran.sensitivities[name]
            start |= self._end_as_start(ran)
        return replace(whole, steps=given.effort * n - steps_left)

    def _simulate_piece(self, given: SimulationInput) -> Trajectory:
        """Simulate in one piece, with derivatives by all parameters of the model."""
        return self._model.run(
            given.time, given.inputs, given.parameters, given.linear, effort=given.effort
        )

    def _empty_trajectory(self, n: int) -> Trajectory:
        """Return a trajectory of n samples, to be filled."""
        layout = self._model.layout
        names = [v.name for v in (*layout.outputs, *layout.states)]
        kept = [name for name in names if self._measured is None or name in self._measured]
        return Trajectory(
            {name: np.empty(n) for name in names},
            {name: np.empty((n, len(self._model.names))) for name in kept},
        )

    def _end_as_start(self, block: Trajectory) -> dict[str, float]:
        """Return the last states of a block and all their derivatives, as start values."""
        layout = self._model.layout
        end = {}
        for state in (s.name for s in layout.states):
            end[layout.start_of[state]] = float(block.signals[state][-1])
            for parameter, slope in zip(
                self._model.names, block.sensitivities[state][-1], strict=True
            ):
                end[f"d({state})/d({parameter})_start"] = float(slope)
        return end


def _blocks(n: int) -> Iterator[slice]:
    """Yield the samples of every block, the last of which is the first of the next block."""
    for first in range(0, n - 1, _BLOCK):
        yield slice(first, min(first + _BLOCK, n - 1) + 1)
