"""The system of a plant and its controller, which runs, and its files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit import Component, UserError, files
from fmus.kit.declare import ONCE
from fmus.kit.effects import unstack
from orchestration.experiment.subjects import find_system, with_classes
from orchestration.fmu import Model
from orchestration.fmu.model import built
from orchestration.linear.operating_point import OperatingPoint
from orchestration.system import Connection, Member, Port, System, checking, ssp

if TYPE_CHECKING:
    from orchestration.linear.feedback import ControllerDesign

_CONTROLLER = "controller"
_FILES = ("controller.py", "controller.fmu", "loop.ssp", "step.toml")


def closed_system(design: ControllerDesign) -> System:
    """Return the system of a plant at its operating point and the controller around it.

    Inputs that are zero at the operating point are inputs of the system, others are constant there;
    inputs of the controller that the loop has no use for keep their start values.

    Parameters
    ----------
    design : ControllerDesign

    Raises
    ------
    UserError
        If the plant was given as a linear model, which cannot be a member, or cannot be built.
    """
    if design.model is None:
        raise UserError("the plant is a linear model without an FMU: there is no system to join")
    plant = _plant_system(design)
    command, measured = design.plant.inputs[0], design.plant.outputs[0]
    name = _CONTROLLER
    while name in [member.name for member in plant.members]:
        name = f"outer_{name}"
    output = Port(name, design.designed.command)
    reference = Port(name, design.designed.reference)
    connections = list(plant.connections)
    for port in plant.inputs.get(command) or (plant.port(command),):
        connections.append(Connection(output, port))
    inputs = {n: ports for n, ports in plant.inputs.items() if n != command}
    for variable, signal in design.designed.signals.items():
        port = Port(name, variable)
        if signal in inputs:
            inputs[signal] = (*inputs[signal], port)
        else:
            connections.append(Connection(_source(plant, signal), port))
    at_rest = {n: value for n, value in design.plant.point.inputs.items() if value}
    free = {n: ports for n, ports in inputs.items() if n not in at_rest}
    # no longer than the plant's own, and a whole number of them in a sample
    steps = max(np.ceil(design.plant.period / plant.step), 1.0)
    joined = System(
        name="loop",
        members=(Member.of(name, design.controller), *plant.members),
        connections=tuple(connections),
        inputs={"reference": (reference,), **free},
        outputs={"command": output, **plant.outputs, "measured": _source(plant, measured)},
        doc=f"{plant.name} with a controller of {measured} by {command}",
        step=design.plant.period / steps,
        stop=float(design.time[-1]),
    )
    constant = {str(p): at_rest[n] for n in inputs.keys() & at_rest.keys() for p in inputs[n]}
    joined = joined.given(constant)
    unused = {str(p): s.start for p, s in checking.open_inputs(joined).items() if p.member == name}
    return joined.given({**unused, str(reference): design.point.inputs[reference.variable]})


def _source(plant: System, signal: str) -> Port:
    """Return the port of an output of a plant, or of a variable of a member."""
    return plant.outputs.get(signal) or plant.port(signal)


def _plant_system(design: ControllerDesign) -> System:
    """Return the system of a plant at its operating point; a model is a member of one."""
    model = design.model
    if isinstance(model, Model):
        fmu = built(model)
        plant = Member("plant", fmu.path, design.settings, model.cls)
        return System(
            name=model.name,
            members=(_at_point(plant, "", design.plant.point),),
            connections=(),
            inputs={name: (Port(plant.name, name),) for name in fmu.inputs},
            outputs={name: Port(plant.name, name) for name in fmu.outputs},
            step=np.inf,
        )
    system = with_classes(model if isinstance(model, System) else find_system(str(model)))
    members = (_at_point(one, f"{one.name}.", design.plant.point) for one in system.members)
    return replace(system, members=tuple(members))


def _at_point(member: Member, prefix: str, point: OperatingPoint) -> Member:
    """Return a member with the parameters and states of an operating point, if it has a class."""
    if member.cls is None:
        return member
    known = point.parameters | point.states | point.discretes
    anew = _begun_anew(member.cls)
    changed = dict(member.parameters)
    for parameter in member.cls.layout.parameters:
        value = known[prefix + (parameter.starts or parameter.name)]
        if parameter.type == "boolean":
            value = float(round(value))  # of an equilibrium, which is solved for
        if value != parameter.start and parameter.starts not in anew:
            changed[parameter.name] = value
    return replace(member, parameters=changed)


def _begun_anew(cls: type[Component]) -> set[str]:
    """Return what is relative to the start of a run: at rest it is as if it began there.

    It is what is sampled once, and the states of effects that do so.
    """
    sampled = cls.layout.sampled
    once = {z.name for clock, members in sampled if clock.period == ONCE for z in members}
    effects = [e for e in unstack(cls)[1] if once.intersection(z.name for z in e.layout.discretes)]
    return once.union(state.name for effect in effects for state in effect.layout.states)


def write_files(design: ControllerDesign, folder: Path) -> list[Path]:
    """Write a controller as source and as FMU, and the loop with an experiment of its step.

    Parameters
    ----------
    design : ControllerDesign
    folder : Path
        It is made if it does not exist.

    Returns
    -------
    list of Path
        ``controller.py``, ``controller.fmu``; ``loop.ssp`` and ``step.toml`` unless the plant is a
        linear model.

    Raises
    ------
    UserError
        If a file cannot be written, or the system cannot be built.
    """
    folder.mkdir(parents=True, exist_ok=True)
    source, fmu, loop, step = (folder / name for name in _FILES)
    files.write(source, design.designed.source.encode())
    files.write(fmu, Member.of(_CONTROLLER, design.controller).fmu.read_bytes())
    if design.model is None:
        return [source, fmu]
    ssp.write(design.system, loop)
    files.write(step, _experiment(design).encode())
    return [source, fmu, loop, step]


def _experiment(design: ControllerDesign) -> str:
    """Return the experiment of a step of the reference from the operating point, as TOML."""
    rest = design.point.inputs["reference"]
    return (
        f'title = "{design.plant.outputs[0]} after a step of its reference"\n'
        'system = "loop.ssp"\n'
        f"duration = {float(design.time[-1])!r}\n"
        f"step = {float(design.system.step)!r}\n\n"
        "[inputs.reference]\n"
        'kind = "steps"\n'
        "times = [0.0]\n"
        f"levels = [{rest + design.step_size!r}]\n"
        f"initial = {rest!r}\n"
    )
