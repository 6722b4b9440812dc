"""From a system and what is fed to it, to its members opened and the structure of who feeds whom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError, suggestion
from fmus.kit.storage import scratch
from orchestration.fmu.archive import unpack
from orchestration.fmu.instance import Fmu
from orchestration.fmu.signal import type_of
from orchestration.master.dependency_graph import Structure
from orchestration.master.instances import Instance
from orchestration.master.schedule import Settings
from orchestration.system.model import Port, System

Array = NDArray[np.float64]


def open_members(system: System, opened: ExitStack) -> list[Instance]:
    """Instantiate every member; an FMU that several members use is unzipped once.

    Raises
    ------
    UserError
        If one cannot be opened.
    """
    folders: dict[Path, str] = {}
    members: list[Instance] = []
    for member in system.members:
        path = member.fmu.resolve()
        if path not in folders:
            folders[path] = unpack(member.fmu)
            opened.callback(scratch.remove, folders[path])
        fmu = Fmu(member.fmu, member.parameters, member.name, folders[path])
        once = fmu.description.coSimulation.canBeInstantiatedOnlyOncePerProcess
        if once and any(other.fmu.path.resolve() == path for other in members):
            raise UserError(
                f"{member.name}: {path.name} can run once only (canBeInstantiatedOnlyOncePerProcess)"
            )
        try:
            members.append(Instance(member.name, opened.enter_context(fmu)))
        except UserError as error:
            raise UserError(f"{member.name}: {error}") from error
    return members


def check_abilities(members: Sequence[Instance], points: list[float], settings: Settings) -> None:
    """Refuse what a member says it cannot do.

    Raises
    ------
    UserError
        Member, what is asked of it, and the ability that it lacks.
    """
    sizes = np.diff(points)
    for member in members:
        slow = 1 / settings.rates.get(member.name, Fraction(1))
        uneven = np.ptp(sizes) > 1e-6 * sizes[0] or (slow > 1 and sizes.size % int(slow) != 0)
        if (uneven or settings.adaptive) and not member.can_vary_step:
            raise UserError(
                f"{member.name}: its steps must all be of one size (canHandleVariableCommunicationStepSize is false)"
            )
        if settings.adaptive and not member.can_restore:
            raise UserError(
                f"{member.name}: cannot restore its state (canGetAndSetFMUstate is false), which a tolerance needs"
            )
        if settings.adaptive and slow > 1:
            raise UserError(f"{member.name}: a rate below 1 does not go with a tolerance")


def external_values(
    system: System, inputs: Mapping[str, Array], points: int
) -> dict[Port, list[float]]:
    """Values from outside for each input of a member that receives some.

    Raises
    ------
    UserError
        If a name is neither an input of the system nor of a member, an input is fed twice, or values do not fit.
    """
    connected = {connection.target: connection.source for connection in system.connections}
    values_of: dict[Port, list[float]] = {}
    for name, values in inputs.items():
        if name not in system.inputs and "." not in name:
            raise UserError(
                f"system {system.name}: no input named {name!r}{suggestion(name, system.inputs)}"
            )
        column = _column(f"input {name}", values, points)
        for port in system.inputs.get(name) or (system.port(name),):
            if port in values_of:
                raise UserError(f"input {name}: {port} is fed by another input already")
            if port in connected:
                raise UserError(f"input {name}: {port} is fed by {connected[port]} already")
            values_of[port] = column
    return values_of


def disturbance_values(
    system: System, disturbances: Mapping[str, Array], points: int
) -> dict[Port, list[float]]:
    """What is added to each connected input that is disturbed.

    Raises
    ------
    UserError
        If a name is no connected input of a member, or values do not fit.
    """
    connected = {connection.target for connection in system.connections}
    values_of = {}
    for name, values in disturbances.items():
        port = system.port(name)
        if port not in connected:
            raise UserError(
                f"disturbance {name}: is no connected input; what nothing is connected to is driven"
            )
        values_of[port] = _column(f"disturbance {name}", values, points)
    return values_of


def _column(what: str, values: Array, points: int) -> list[float]:
    array = np.asarray(values, dtype=float)
    if array.shape != (points,):
        raise UserError(
            f"{what}: shape {array.shape} for {points} communication points; one value for each"
        )
    if not np.isfinite(array).all():
        k = int(np.argmin(np.isfinite(array)))
        raise UserError(f"{what}: {array[k]:g} at point {k} is no finite number")
    column: list[float] = array.tolist()
    return column


def structure(
    system: System,
    members: Sequence[Instance],
    fed: Sequence[Port],
    record: Sequence[str] | None,
    settings: Settings,
) -> tuple[Structure, list[Port]]:
    """Gather who feeds whom, and which variables are recorded.

    Parameters
    ----------
    system : System
    members : sequence of Instance
    fed : sequence of Port
        Inputs that receive values from outside.
    record : sequence of str, optional
        Variables to record; default every output that is no text.
    settings : Settings

    Returns
    -------
    Structure, list of Port

    Raises
    ------
    UserError
        If a variable does not exist, or one is fed that is no input.
    """
    by_name = {member.name: member for member in members}
    outputs = [
        Port(member.name, name)
        for member in members
        for name in member.fmu.outputs
        if type_of(member.fmu.variables[name]) != "string"
    ]
    recorded = (
        outputs if record is None else list(dict.fromkeys(system.port(text) for text in record))
    )
    watched = outputs if settings.adaptive else []
    sources = {connection.target: connection.source for connection in system.connections}
    for port in (*recorded, *sources, *sources.values(), *fed):
        known = by_name[port.member].fmu.variables
        if port.variable not in known:
            raise UserError(
                f"{port.member}: no variable named {port.variable!r}{suggestion(port.variable, known)}"
            )
        if (port in sources or port in fed) and known[port.variable].causality != "input":
            raise UserError(f"{port}: is {known[port.variable].causality or 'local'}, no input")
    receiving = {m.name: [p for p in (*sources, *fed) if p.member == m.name] for m in members}
    wanted = {
        m.name: [
            p for p in dict.fromkeys((*recorded, *watched, *sources.values())) if p.member == m.name
        ]
        for m in members
    }
    needs: dict[Port, tuple[Port, ...]] = {}
    assumed: set[Port] = set()
    for member in members:
        for port in wanted[member.name]:
            listed = member.dependencies(port.variable)
            needed = [p for p in receiving[member.name] if listed is None or p.variable in listed]
            needs[port] = tuple(needed) if settings.feedthrough else ()
            if listed is None:
                assumed.add(port)
    stateless = {member.name for member in members if not member.can_restore}
    return Structure(sources, receiving, wanted, needs, assumed, stateless), recorded
