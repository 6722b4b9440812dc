"""The system of a plant and its controller, which runs, and its files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit import Component, UserError, files
from orchestration.experiment.subjects import with_classes
from orchestration.experiment.system_model import find_system
from orchestration.fmu import Model, Value
from orchestration.fmu.model import built
from orchestration.linear.operating_point import OperatingPoint
from orchestration.system import Connection, Member, Port, System, ssp

if TYPE_CHECKING:
    from orchestration.linear.feedback import ControllerDesign

_PLANT = "plant"
_CONTROLLER = "controller"


def closed_system(design: ControllerDesign) -> System:
    """Return the system of a plant at its operating point and the controller around it.

    Inputs that are zero at the operating point are inputs of the system, others are constant there.

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
    plant = _plant_system(design.model)
    command, measured = design.plant.inputs[0], design.plant.outputs[0]
    driven = plant.inputs.get(command) or (plant.port(command),)
    source = plant.outputs.get(measured) or plant.port(measured)
    controller = Member.of(_name(plant), design.controller)
    point = design.plant.point
    members = tuple(_at_point(member, point) for member in plant.members)
    others = {name: ports for name, ports in plant.inputs.items() if name != command}
    constant = {
        str(port): point.inputs[name]
        for name, ports in others.items()
        for port in ports
        if point.inputs.get(name)
    }
    free = {name: ports for name, ports in others.items() if not point.inputs.get(name)}
    output = Port(controller.name, "command")
    # no longer than the plant's own, and a whole number of them in a sample
    steps = max(np.ceil(design.plant.period / plant.step), 1.0)
    joined = System(
        name="loop",
        members=(controller, *members),
        connections=(
            *plant.connections,
            *(Connection(output, port) for port in driven),
            Connection(source, Port(controller.name, "measured")),
        ),
        inputs={"reference": (Port(controller.name, "reference"),), **free},
        outputs={"command": output, **plant.outputs, "measured": source},
        doc=f"{plant.name} with a controller of {measured} by {command}",
        step=design.plant.period / steps,
        stop=float(design.time[-1]),
    )
    return joined.given(constant | dict(design.settings))


def _plant_system(model: Model | System | str) -> System:
    """Return the system of a plant; a model is the member ``plant`` of one."""
    if isinstance(model, str):
        model = find_system(model)
    if isinstance(model, System):
        return with_classes(model)
    with_fmu = built(model)
    return System(
        name=model.name,
        members=(Member(_PLANT, with_fmu.path, {}, model.cls),),
        connections=(),
        inputs={name: (Port(_PLANT, name),) for name in with_fmu.inputs},
        outputs={name: Port(_PLANT, name) for name in with_fmu.outputs},
        step=np.inf,
    )


def _name(plant: System) -> str:
    """Return a name for the controller that no member of the plant has."""
    name = _CONTROLLER
    while name in {member.name for member in plant.members}:
        name = f"{name}_{_CONTROLLER}"
    return name


def _at_point(member: Member, point: OperatingPoint) -> Member:
    """Return a member with the parameters and states of an operating point, if it has a class."""
    if member.cls is None:
        return member
    moved = dict(_differences(member, member.cls, point))
    return replace(member, parameters={**member.parameters, **moved})


def _differences(
    member: Member, cls: type[Component], point: OperatingPoint
) -> Iterator[tuple[str, Value]]:
    """Yield parameters, start values among them, that differ from those of a class."""
    layout = cls.layout
    states = point.states | point.discretes
    starts = {parameter: state for state, parameter in layout.start_of.items()}
    for parameter in layout.parameters:
        if parameter.name in starts:
            value = _value(states, member.name, starts[parameter.name])
        else:
            value = _value(point.parameters, member.name, parameter.name)
        if value is not None and value != parameter.start:
            yield parameter.name, value


def _value(values: Mapping[str, float], member: str, name: str) -> float | None:
    """Return a value by its name in a system, else by that in a component alone."""
    return values.get(f"{member}.{name}", values.get(name) if member == _PLANT else None)


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
    member = Member.of(_CONTROLLER, design.controller)
    contents = {
        "controller.py": design.source.encode(),
        "controller.fmu": member.fmu.read_bytes(),
    }
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, content in contents.items():
        files.write(folder / name, content)
        written.append(folder / name)
    if design.model is not None:
        ssp.write(design.system, folder / "loop.ssp")
        files.write(folder / "step.toml", _experiment(design).encode())
        written += [folder / "loop.ssp", folder / "step.toml"]
    return written


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
