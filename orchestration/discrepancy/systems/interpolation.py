"""What inputs do between samples, which no record shows: held or linear, as the measured outputs tell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from orchestration.discrepancy.systems.member import MemberSimulation

_NO_DIFFERENCE = 1e-3  # of the logarithm of sizes


def choose_interpolation(simulation: MemberSimulation, values: Mapping[str, float]) -> None:
    """Choose which inputs are held between samples: those with which the outputs move as they were measured to.

    Parameters
    ----------
    simulation : MemberSimulation
        Its inputs are changed.
    values : Mapping of str to float
        Parameters.
    """
    inputs = simulation.inputs
    inputs.held = set()
    best = _roughness(simulation, values)
    for name in inputs.linear:
        inputs.held.add(name)
        held = _roughness(simulation, values)
        if (
            held < best + _NO_DIFFERENCE
        ):  # where it makes no difference, nothing happens between samples
            best = min(best, held)
        else:
            inputs.held.discard(name)


def _roughness(simulation: MemberSimulation, values: Mapping[str, float]) -> float:
    """Logarithm of the size of the steps that residuals make from sample to sample, summed over outputs."""
    simulated = simulation.simulate(values)
    steps = [np.diff(y - simulated[o]) for o, y in simulation.isolated.outputs.items()]
    return float(sum(np.log(np.sqrt(np.nanmean(s**2)) + np.finfo(float).tiny) for s in steps))
