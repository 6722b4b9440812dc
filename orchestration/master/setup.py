"""Preparation of a run: members opened and checked, the system's structure, start values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path

import numpy as np

from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import UserError, error_context, find, suggestion
from fmus.kit.storage import scratch
from orchestration.fmu import Fmu, RemoteFmu, unpack
from orchestration.fmu.signal import type_of
from orchestration.master.dependency_graph import Structure
from orchestration.master.executor import Executor
from orchestration.master.instances import Instance
from orchestration.master.schedule import MasterSettings
from orchestration.system import Port, System

_SAME_SIZE = 1e-6  # relative difference of step sizes that counts as rounding

# --- members


def open_members(system: System, opened: ExitStack) -> list[Instance]:
    """Instantiate every member; an FMU that several members use is unzipped once.

    Of an FMU that can be instantiated only once per process, every further instance has a process
    of its own, also if it is another copy of the file.

    Parameters
    ----------
    system : System
    opened : ExitStack
        Closes the members.

    Returns
    -------
    list of Instance

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
        if fmu.runs_once and any(fmu.identity == other.fmu.identity for other in members):
            fmu = RemoteFmu(member.fmu, member.parameters, member.name, folders[path])
        with error_context(member.name):
            members.append(Instance(member.name, opened.enter_context(fmu)))
    return members


def check_capabilities(
    members: Sequence[Instance], points: list[float], settings: MasterSettings
) -> None:
    """Refuse a run that needs a capability which a member does not have.

    Raises
    ------
    UserError
        With the member, the requirement, and the capability flag.
    """
    sizes = np.diff(points)
    for member in members:
        system_steps = 1 / settings.rates.get(member.name, Fraction(1))  # in one of the member
        is_slow = system_steps > 1
        is_last_shorter = is_slow and sizes.size % int(system_steps) != 0
        is_uneven = np.ptp(sizes) > _SAME_SIZE * sizes[0] or is_last_shorter
        if (is_uneven or settings.adaptive) and not member.can_vary_step:
            raise UserError(
                f"{member.name}: its steps must all be of one size"
                " (canHandleVariableCommunicationStepSize is false)"
            )
        if settings.adaptive and not member.can_restore:
            raise UserError(
                f"{member.name}: cannot restore its state (canGetAndSetFMUstate is false), which a"
                " tolerance needs"
            )
        if settings.adaptive and is_slow:
            raise UserError(f"{member.name}: a rate below 1 does not go with a tolerance")


# --- values from outside


def external_values(system: System, inputs: Signals, points: int) -> dict[Port, Sequence[float]]:
    """Return the values from outside for each input of a member that receives some.

    Parameters
    ----------
    system : System
    inputs : Mapping of str to ndarray, shape (points,)
        By input of the system, or by ``member.variable``.
    points : int

    Raises
    ------
    UserError
        If a name is neither an input of the system nor of a member, an input is fed twice, or
        values do not fit.
    """
    connected = {connection.target: connection.source for connection in system.connections}
    values_of: dict[Port, Sequence[float]] = {}
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
    system: System, disturbances: Signals, points: int
) -> dict[Port, Sequence[float]]:
    """Return the values that are added to each connected input that is disturbed.

    Parameters
    ----------
    system : System
    disturbances : Mapping of str to ndarray, shape (points,)
        By ``member.variable``.
    points : int

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
                f"disturbance {name}: is no connected input; one without a connection is driven"
            )
        values_of[port] = _column(f"disturbance {name}", values, points)
    return values_of


def _column(name: str, values: Array, points: int) -> Sequence[float]:
    """Return values as they are in memory; UserError unless they are finite, one for each point.

    Whoever moves a parameter of a run in real time writes those ahead.
    """
    array = np.asarray(values, dtype=float)
    if array.shape != (points,):
        raise UserError(
            f"{name}: shape {array.shape} for {points} communication points; one value for each"
        )
    if not np.isfinite(array).all():
        k = int(np.argmin(np.isfinite(array)))
        raise UserError(f"{name}: {array[k]:g} at point {k} is no finite number")
    return np.ascontiguousarray(array).data


# --- structure


def make_structure(
    system: System,
    members: Sequence[Instance],
    fed: Sequence[Port],
    record: Sequence[str] | None,
    settings: MasterSettings,
) -> tuple[Structure, list[Port]]:
    """Gather the connections and dependencies of the members, and the recorded variables.

    Parameters
    ----------
    system : System
    members : sequence of Instance
    fed : sequence of Port
        Inputs that receive values from outside.
    record : sequence of str, optional
        Variables to record; default every output that is no text.
    settings : MasterSettings

    Returns
    -------
    Structure, list of Port

    Raises
    ------
    UserError
        If a variable does not exist, or one is fed that is no input.
    """
    outputs = [
        Port(member.name, name)
        for member in members
        for name in member.fmu.outputs
        if type_of(member.fmu.variables[name]) != "string"
    ]
    recorded = outputs if record is None else list(dict.fromkeys(map(system.port, record)))
    compared = outputs if settings.adaptive else []  # by step doubling
    sources = {connection.target: connection.source for connection in system.connections}
    fed_inputs = (*sources, *fed)
    _check_variables(members, (*recorded, *sources, *sources.values(), *fed), set(fed_inputs))
    read = list(dict.fromkeys((*recorded, *compared, *sources.values())))
    fed_by_member = _by_member(members, fed_inputs)
    read_by_member = _by_member(members, read)
    feedthrough, assumed = _feedthrough(members, fed_by_member, read_by_member)
    structure = Structure(
        sources=sources,
        fed=fed_by_member,
        wanted=read_by_member,
        feedthrough=feedthrough if settings.feedthrough else dict.fromkeys(feedthrough, ()),
        assumed=assumed,
        stateless={member.name for member in members if not member.can_restore},
    )
    return structure, recorded


def _by_member(members: Sequence[Instance], ports: Sequence[Port]) -> dict[str, list[Port]]:
    """Return the ports of each member by its name."""
    result: dict[str, list[Port]] = {member.name: [] for member in members}
    for port in ports:
        result[port.member].append(port)
    return result


def _feedthrough(
    members: Sequence[Instance],
    fed: Mapping[str, Sequence[Port]],
    read: Mapping[str, Sequence[Port]],
) -> tuple[dict[Port, tuple[Port, ...]], set[Port]]:
    """Return the inputs that each variable depends on without delay.

    Parameters
    ----------
    members : sequence of Instance
    fed, read : Mapping of str to sequence of Port
        By member, its inputs that receive values, and its variables that are read.

    Returns
    -------
    feedthrough : dict of Port to tuple of Port
    assumed : set of Port
        Variables whose dependencies the FMU does not state: they are taken to be all inputs.
    """
    feedthrough: dict[Port, tuple[Port, ...]] = {}
    assumed: set[Port] = set()
    for member in members:
        for port in read[member.name]:
            stated = member.dependencies(port.variable)
            if stated is None:
                assumed.add(port)
            feedthrough[port] = tuple(
                p
                for p in fed[member.name]
                if stated is None
                or p.variable in stated
                or member.is_tunable(p.variable)  # of which nothing is stated
            )
    return feedthrough, assumed


def _check_variables(
    members: Sequence[Instance], ports: Sequence[Port], fed_inputs: set[Port]
) -> None:
    """Refuse ports that do not exist, and fed ports that are neither inputs nor tunable."""
    members_by_name = {member.name: member for member in members}
    for port in ports:
        member = members_by_name[port.member]
        known = member.fmu.variables
        causality = find(port.variable, known, f"{port.member}: no variable").causality
        is_fed = port in fed_inputs and not member.is_tunable(port.variable)
        if is_fed and causality != "input":
            raise UserError(f"{port}: is {causality or 'local'}, no input")


# --- initialization


def enter_initialization(members: Sequence[Instance], start: float, stop: float) -> None:
    """Set the parameters of all members and enter their initialization mode.

    Raises
    ------
    UserError
        If a member refuses.
    """
    for member in members:
        with error_context(member.name):
            member.fmu.enter_initialization(start, stop)


def initialize(executor: Executor) -> list[str]:
    """Propagate start values until they no longer change, and end the initialization.

    Returns
    -------
    list of str
        Remarks on the initialization.

    Raises
    ------
    UserError
        If a member refuses.
    """
    notes = []
    # one exchange for each member that a start value may pass, two more to see that none changes
    for _ in range(len(executor.members) + 2):
        before = executor.inputs.values.copy()
        _propagate(executor)
        is_same = np.isclose(before, executor.inputs.values, rtol=1e-9, atol=1e-12)
        if is_same.all():
            break
    else:
        unsettled = ", ".join(str(port) for port, i in executor.inputs.at.items() if not is_same[i])
        notes.append(
            f"start values depend on each other in a circle and do not settle: {unsettled}"
        )
    _exit_initialization(executor)
    executor.read_early()
    return notes


def _propagate(executor: Executor) -> None:
    """Exchange all values once in the initialization mode.

    Raises
    ------
    UserError
        If a member fails; with the error of a parameter that a member refuses, if there is one.
    """
    try:
        executor.read_early()
        executor.exchange(executor.complete.stages, 0)
    except UserError:
        # Bad parameters are the likely reason, and FMUs check them when they exit initialization:
        # that error, if it is raised here, is reported instead.
        _exit_initialization(executor)
        raise


def _exit_initialization(executor: Executor) -> None:
    """Exit the initialization mode of all members; UserError if one refuses."""
    for member in executor.members:
        with error_context(member.name):
            member.fmu.exit_initialization()
