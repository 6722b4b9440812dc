"""An FMU with what stands behind it, corrected, as a system: the original FMU, and a component of ours."""

from __future__ import annotations

from fmus.kit import Component, stack
from orchestration.discrepancy.foreign.component import behind
from orchestration.discrepancy.foreign.surrounding import Surrounded
from orchestration.fmu.signal import Value
from orchestration.system.model import Connection, Member, Port, System

_FMU, _CORRECTION = "fmu", "correction"


def corrected(around: Surrounded, component: type[Component]) -> System:
    """Connect an FMU, with the parameters that were found, to its correction.

    Parameters
    ----------
    around : Surrounded
    component : type[Component]
        What a diagnosis made of the component behind the FMU.

    Returns
    -------
    System
    """
    original, found = around.original, around.behind
    fitted = {p.name: p.start for p in component.layout.parameters}
    measured = [o for o in original.outputs if found.names.get(o) in {v.name for v in found.cls.layout.outputs}]
    stop, step = found.cls.experiment
    plain = behind(original, measured, (), stop, step)
    over = stack(plain.cls, *vars(component)["stacked"][1])
    own = {p.name for p in over.layout.parameters}
    made = stack(over, name=plain.cls.name, defaults={n: value for n, value in fitted.items() if n in own})
    members = (
        Member(_FMU, original.path, _parameters(around, fitted)),
        Member.of(_CORRECTION, made),
    )
    simulated = {v.name for v in made.layout.inputs}
    connections = tuple(
        Connection(Port(_FMU, o), Port(_CORRECTION, plain.simulated(o)))
        for o in original.outputs if o in plain.names and plain.simulated(o) in simulated
    )  # fmt: skip
    inputs = {
        i: (Port(_FMU, i), *([Port(_CORRECTION, plain.names[i])] if plain.names.get(i) in simulated else []))
        for i in original.inputs if i not in around.settings
    }  # fmt: skip
    outputs = {o: Port(_CORRECTION, plain.names[o]) for o in measured}
    doc = f"{original.path.name} with its outputs corrected"
    return System(f"{plain.cls.name}", members, connections, inputs, outputs, doc, step, stop)


def _parameters(around: Surrounded, fitted: dict[str, float]) -> dict[str, Value]:
    """Parameters of the FMU, each with the change that it had beside the correction."""
    values = dict(around.settings)
    for name, change in around.behind.fitted.items():
        declared = around.original.parameters[name]
        value = float(values.get(name, declared.start))
        moved = value + fitted[change] * (abs(value) or 1.0)
        values[name] = min(max(moved, declared.min), declared.max)
    return values
