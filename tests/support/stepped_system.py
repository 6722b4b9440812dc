"""A system of components in plain Python, with an emulated rig in the place of one of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from demonstrations.emulator.stepping import SteppedRig
from fmus.kit import Component
from fmus.kit.integrate import Integrator
from orchestration.system import System
from tests.support.sampled import outputs


def run_on_rig(
    system: System, place: str, rig: SteppedRig, time: np.ndarray, inputs: Mapping[str, Any]
) -> dict[str, np.ndarray]:
    """Commands of the rig, and its outputs with noise and without (`true_...`), after each point.

    Members act one after another, as in a Gauss-Seidel master; the rig is asked before them, with
    the new inputs, and goes on after them.
    """
    models: dict[str, Component] = {
        member.name: member.cls(**member.parameters)
        for member in system.members
        if member.name != place and member.cls is not None
    }
    integrators = {name: Integrator(model) for name, model in models.items()}
    values = {
        f"{name}.{output}": value
        for name, model in models.items()
        for output, value in outputs(model).items()
    }
    signals: dict[str, list[float]] = {}

    def receive(member: str) -> dict[str, float]:
        """Inputs of a member that have a value."""
        wired = {c.target: values[str(c.source)] for c in system.connections}
        given = {
            port: inputs[name][point] for name, ports in system.inputs.items() for port in ports
        }
        return {
            port.variable: value for port, value in (wired | given).items() if port.member == member
        }

    def measure() -> None:
        rig.command(receive(place))
        values.update({f"{place}.{name}": value for name, value in rig.measured().items()})

    values |= {f"{place}.{name}": value for name, value in rig.measured().items()}
    for point, now in enumerate(time[:-1]):
        measure()
        for name, model in models.items():
            for variable, value in receive(name).items():
                setattr(model, variable, value)
            integrators[name].advance(now, time[point + 1] - now)
            values |= {f"{name}.{output}": value for output, value in outputs(model).items()}
        measure()
        true = {f"true_{name}": value for name, value in rig.true().items()}
        for name, value in {**receive(place), **rig.measured(), **true}.items():
            signals.setdefault(name, []).append(value)
        rig.advance(time[point + 1] - now)
    return {name: np.array([*series, series[-1]]) for name, series in signals.items()}
