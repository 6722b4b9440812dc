"""An actuator under a controller of its displacement, sample by sample."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from fmus.kit import Component
from fmus.kit.integrate import Integrator


def drive(
    controller: Component, actuator: Component, references: Iterable[float]
) -> dict[str, np.ndarray]:
    """Signals of the loop by name.

    Displacement and charge are those at the samples, the voltage is that after each sample and
    before the next one (two columns), where it is largest.
    """
    sampler: Any = controller
    plant: Any = actuator
    period = sampler.sample_period
    integrators = Integrator(controller), Integrator(actuator)
    given = {variable.name for variable in controller.layout.inputs}
    rows = []
    for k, reference in enumerate(references):
        measured = {
            "reference": float(reference),
            "displacement": float(plant.displacement()),
            "voltage": float(plant.voltage()),
            "current": plant.current,
            "force": plant.force,
        }
        for name in given & set(measured):
            setattr(controller, name, measured[name])
        integrators[0].advance(k * period, period)
        plant.current = float(sampler.command())
        after = float(plant.voltage())
        integrators[1].advance(k * period, period)
        voltages = (after, float(plant.voltage()))
        rows.append((measured["displacement"], plant.charge, plant.current, voltages))
    names = ("displacement", "charge", "current", "voltage")
    columns = zip(*rows, strict=True)
    return {name: np.array(values) for name, values in zip(names, columns, strict=True)}


def worst(found: dict[str, np.ndarray], name: str) -> float:
    """Largest magnitude of a signal."""
    return float(np.abs(found[name]).max())
