"""Stiff components over a record: the chosen integrator against the FMUs' Runge-Kutta method."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from unittest.mock import patch

import numpy as np

from fmus import component
from fmus.kit.record.compiled import CompiledModel, Trajectory
from fmus.kit.record.linearisation import Linearisation
from orchestration.discrepancy.diagnosis import searched_parameters
from orchestration.experiment.waveforms import multilevel

from .tables import Cell, Table, Topic
from .timing import take_turns

_STEP = 0.01  # s
_SEED = 1
_INPUTS: dict[str, dict[str, list[float]]] = {
    "ppy_actuator": {"current": [-0.9, 0.0, 0.9], "force": [0.5, 1.0, 2.75]},
    "galvanostat": {"current_command": [-0.9, 0.0, 0.9]},
    "voice_coil_dma": {"force_reference": [0.5, 1.0, 2.0], "tension": [0.5, 1.5]},
}
_SETTINGS = {"galvanostat": {"response_time": 1e-4}}


def measure(quick: bool = False) -> Topic:
    """Simulate each with the sensitivities that a diagnosis needs, by either integrator."""
    samples, rounds = (300, 2) if quick else (60_000, 5)
    rows: list[list[Cell]] = []
    for name in _INPUTS:
        explicit = _simulation(name, samples, True)
        chosen = _simulation(name, samples, False)
        times = take_turns({"explicit": explicit, "chosen": chosen}, rounds)
        ratio = times.median_ratio("explicit", "chosen")
        parameters = len(searched_parameters(component(name)))
        rows.append(
            [name, parameters, times.best("explicit") * 1e3, times.best("chosen") * 1e3, ratio]
        )
    text = (
        f"{samples:,} samples at {1.0 / _STEP:g} Hz, inputs held at changing levels, sensitivities"
        " included; the galvanostat with a lag of 0.1 ms."
    )
    columns = ["", "parameters", "Runge-Kutta, ms", "as chosen, ms", "gain, median"]
    return Topic("Stiff components", [text, Table(columns, rows)])


def _simulation(name: str, samples: int, explicit: bool) -> Callable[[], Trajectory]:
    time = _STEP * np.arange(samples)
    inputs = {
        n: multilevel(time, levels, (0.1, 0.5), _SEED + i)
        for i, (n, levels) in enumerate(_INPUTS[name].items())
    }
    model = CompiledModel(component(name), searched_parameters(component(name)))

    def run() -> Trajectory:
        never = (
            patch.object(Linearisation, "ladder", return_value=None) if explicit else nullcontext()
        )
        with never:
            return model.run(time, inputs, _SETTINGS.get(name))

    return run
