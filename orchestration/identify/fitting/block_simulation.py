"""Simulation of a long record block by block, for the sake of memory.

A simulation with derivatives has a column for every state and output by every parameter, most of
which nobody reads: the derivatives of states serve those of what is measured alone. A block begins
with the states, and their derivatives, that the block before ended with.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.record import CompiledModel, Trajectory

LONGEST = 20_000  # samples that are simulated in one piece
_BLOCK = 8_192  # samples that are simulated at once of more


def simulate_in_blocks(
    model: CompiledModel,
    time: Array,
    inputs: Mapping[str, Array],
    parameters: Mapping[str, float],
    *,
    linear: bool | Collection[str],
    effort: float,
    tolerance: float,
    columns: slice | list[int],
    measured: Collection[str] | None = None,
) -> Trajectory:
    """Simulate a model of continuous states, as `CompiledModel.run` does in one piece.

    Parameters
    ----------
    model : CompiledModel
        Without discrete states: a block would begin in the middle of their sample period.
    time : ndarray, shape (n,)
        Seconds.
    inputs : Mapping of str to ndarray, shape (n,)
        SI.
    parameters : Mapping of str to float
        SI.
    linear : bool or collection of str
        Inputs that are interpolated between samples.
    effort : float
        Internal steps per sample of the whole record, of which any block may take what is left.
    tolerance : float
    columns : slice or list of int
        Which p of the model's parameters derivatives are kept by.
    measured : collection of str, optional
        Outputs and states of which derivatives are kept; all unless given.

    Returns
    -------
    Trajectory
        All signals, and the derivatives (n, p) of those that are measured.

    Raises
    ------
    UserError
        If the simulation fails.
    """
    n = len(time)
    layout = model.layout
    outputs = [o.name for o in layout.outputs]
    states = [s.name for s in layout.states]
    count = len(np.arange(len(model.names))[columns])
    signals = {name: np.empty(n) for name in [*outputs, *states]}
    kept = [name for name in signals if measured is None or name in measured]
    slopes = {name: np.empty((n, count)) for name in kept}
    begin = dict(parameters)
    left = effort * n
    first = 0
    while first < n - 1:
        last = min(first + _BLOCK, n - 1)  # where the next block begins
        rows = slice(first, last + 1)
        fed = {name: np.broadcast_to(values, n)[rows] for name, values in inputs.items()}
        ran = model.run(time[rows], fed, begin, linear, left / (last + 1 - first), tolerance)
        left -= ran.steps
        for name, values in signals.items():
            values[rows] = ran.signals[name]
        for name, derivatives in slopes.items():
            derivatives[rows] = ran.sensitivities[name][:, columns]
        for state in states:
            begin[layout.start_of[state]] = float(ran.signals[state][-1])
            for parameter, slope in zip(model.names, ran.sensitivities[state][-1], strict=True):
                begin[f"d({state})/d({parameter})_start"] = float(slope)
        first = last
    return Trajectory(signals, slopes, effort * n - left)
