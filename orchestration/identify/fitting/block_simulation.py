"""Simulation of a long record block by block, for the sake of memory.

A simulation with derivatives has a column for every state and output by every parameter, most of
which nobody reads: the derivatives of states serve those of what is measured alone. A block begins
with the states, and their derivatives, that the block before ended with.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.record import CompiledModel, Trajectory

LONGEST = 20_000  # samples that are simulated in one piece
_BLOCK = 8_192  # samples that are simulated at once of more


class BlockwiseModel:
    """A compiled model that simulates a long record block by block.

    Parameters
    ----------
    model : CompiledModel
    names : sequence of str
        Those p of the model's parameters by which derivatives are kept, in this order.
    linear : bool or collection of str
        Inputs that are interpolated between samples.
    measured : collection of str, optional
        Outputs and states of which a simulation in blocks has derivatives; all unless given.
    """

    def __init__(
        self,
        model: CompiledModel,
        names: Sequence[str],
        linear: bool | Collection[str],
        measured: Collection[str] | None = None,
    ):
        self._model = model
        self._linear = linear
        self._measured = measured
        places = [model.names.index(name) for name in names]
        # the first of them, as they usually are, are not copied
        in_order = places == list(range(len(places)))
        self._columns: slice | list[int] = slice(len(places)) if in_order else places
        self._width = len(places)

    def run(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, float],
        effort: float,
        tolerance: float,
    ) -> Trajectory:
        """Simulate a record as `CompiledModel.run` does, with the derivatives that are wanted.

        With discrete states it is in one piece: a block would begin in the middle of their sample
        period.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Seconds.
        inputs : Mapping of str to ndarray, shape (n,)
            SI.
        parameters : Mapping of str to float
            SI.
        effort : float
            Internal steps per sample of the whole record.
        tolerance : float
            Accuracy of an internal step, if the component's own need not be reached.

        Returns
        -------
        Trajectory
            All signals, and derivatives (n, p).

        Raises
        ------
        UserError
            If the simulation fails.
        """
        if len(time) > LONGEST and not self._model.layout.discretes:
            return self.run_in_blocks(time, inputs, parameters, effort, tolerance)
        ran = self._model.run(time, inputs, parameters, self._linear, effort, tolerance)
        wanted = {name: slopes[:, self._columns] for name, slopes in ran.sensitivities.items()}
        return replace(ran, sensitivities=wanted)

    def run_in_blocks(
        self,
        time: Array,
        inputs: Mapping[str, Array],
        parameters: Mapping[str, float],
        effort: float,
        tolerance: float,
    ) -> Trajectory:
        """Simulate like `run`, however short the record is, with derivatives of what is measured.

        Any block may take the internal steps that those before it have left of the record's.
        """
        n = len(time)
        whole = self._empty(n)
        start = dict(parameters)
        left = effort * n
        for rows in _blocks(n):
            fed = {name: np.broadcast_to(values, n)[rows] for name, values in inputs.items()}
            share = left / (rows.stop - rows.start)
            ran = self._model.run(time[rows], fed, start, self._linear, share, tolerance)
            left -= ran.steps
            for name, values in whole.signals.items():
                values[rows] = ran.signals[name]
            for name, slopes in whole.sensitivities.items():
                slopes[rows] = ran.sensitivities[name][:, self._columns]
            start |= self._end_of(ran)
        return replace(whole, steps=effort * n - left)

    def _empty(self, n: int) -> Trajectory:
        """Return a trajectory of n samples, to be filled."""
        layout = self._model.layout
        names = [v.name for v in (*layout.outputs, *layout.states)]
        kept = [name for name in names if self._measured is None or name in self._measured]
        return Trajectory(
            {name: np.empty(n) for name in names},
            {name: np.empty((n, self._width)) for name in kept},
        )

    def _end_of(self, block: Trajectory) -> dict[str, float]:
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
