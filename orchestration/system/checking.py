"""Checks of a system: its connections exist and fit, and every input has a value.

An input without a connection stays at the start value that its FMU declares.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from fmus.kit import units
from fmus.kit.errors import UserError, error_context, find, suggestion
from orchestration.fmu import Archive, Model, Signal, find_model
from orchestration.fmu.signal import check_value
from orchestration.system.model import Connection, Member, Port, System

_IDENTITY = (1.0, 0.0)  # factor and offset


def interface(member: Member) -> Model:
    """Return the model of a member's FMU with its inputs, outputs and parameters.

    Raises
    ------
    UserError
        If the FMU is missing or cannot be read, naming the member.
    """
    with error_context(f"member {member.name}"):
        return _read_interface(*member.version)


@lru_cache(maxsize=64)
def _read_interface(path: Path, modified: int) -> Model:
    """Return the model of an FMU; `modified`, ns, makes the cache valid for this file only."""
    return find_model(str(path))


def variable(member: Member, name: str) -> Signal:
    """Return the parameter or input of a member with a name.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    model = interface(member)
    known = {**model.parameters, **model.inputs}
    if name not in known:
        role = "an output" if name in model.outputs else "no parameter or input of its FMU"
        raise UserError(
            f"member {member.name}: {name!r} is {role} and cannot be set{suggestion(name, known)}"
        )
    return known[name]


def signal_at(system: System, port: Port) -> Signal:
    """Return the output or input at a port of a system.

    Raises
    ------
    UserError
        If there is no such member.
    """
    model = interface(system.member(port.member))
    return model.outputs.get(port.variable) or model.inputs[port.variable]


def check(system: System) -> None:
    """Raise an error if a system cannot be run.

    Raises
    ------
    UserError
        If members have the same name, an FMU is missing, an end of a connection does not exist or
        has the wrong causality, types or units differ, an input has two sources, or none and no
        declared start value, or a value cannot be set.
    """
    with error_context(f"system {system.name}"):
        _check(system)


def _check(system: System) -> None:
    """Do the work of `check`, whose messages begin with the name of the system."""
    if not (0.0 < system.step < math.inf and 0.0 < system.duration < math.inf):
        raise UserError(
            f"step {system.step:g} s must be positive, and stop time {system.stop:g} s after start"
            f" time {system.start:g} s"
        )
    _check_names(system)
    models = {member.name: interface(member) for member in system.members}
    for member in system.members:
        for name, value in member.parameters.items():
            check_value(variable(member, name), value, f"member {member.name}: {name}")
    for connection in system.connections:
        with error_context(str(connection)):
            _check_connection(models, connection)
    for name, ports in system.inputs.items():
        _check_system_input(models, name, ports)
    for port in system.outputs.values():
        _find_end(models, port, "output")
    _check_sources(system)


def _check_names(system: System) -> None:
    """Raise UserError without members, or if a name is not valid or occurs twice."""
    if not system.members:
        raise UserError("it has no members")
    names_of = {
        "members": [member.name for member in system.members],
        "system connectors": [*system.inputs, *system.outputs],
    }
    for kind, names in names_of.items():
        for name in names:
            if names.count(name) > 1:
                raise UserError(f"two {kind} are named {name!r}")
            if not name or name != name.strip():
                raise UserError(f"{name!r} is no name for one of its {kind}: it is empty or padded")


def _find_end(models: Mapping[str, Model], port: Port, causality: str) -> Signal:
    """Return the signal at an end of a connection; UserError if it has another causality."""
    model = find(port.member, models, "no member")
    groups = {"input": model.inputs, "output": model.outputs, "parameter": model.parameters}
    candidates = groups[causality]
    if port.variable in candidates:
        return candidates[port.variable]
    for other, signals in groups.items():
        if port.variable in signals:
            article = "a" if other == "parameter" else "an"
            raise UserError(f"{port} is {article} {other} where an {causality} is needed")
    raise UserError(
        f"{port.member} has no {causality} named"
        f" {port.variable!r}{suggestion(port.variable, candidates)}"
    )


def _check_connection(models: Mapping[str, Model], connection: Connection) -> None:
    """Raise UserError if a connection does not join an output with an input that fits."""
    source, target = connection.source, connection.target
    output = _find_end(models, source, "output")
    input_ = _find_end(models, target, "input")
    if source.member == target.member:
        raise UserError("a member cannot be connected with itself")
    if output.type != input_.type and (output.type, input_.type) != ("integer", "real"):
        raise UserError(
            f"{source} is {output.type} and {target} is {input_.type}; types must be the same"
        )
    transformation = (connection.factor, connection.offset)
    if not all(map(math.isfinite, transformation)):
        raise UserError(f"factor {connection.factor} and offset {connection.offset} must be finite")
    if connection.passes_on:
        if output.declares_unit and input_.declares_unit:
            _check_units(connection, output.unit, input_.unit)
    elif (output.type == "real") == bool(connection.table):
        kinds = "integers and booleans" if connection.table else "real variables"
        change = "a mapping" if connection.table else _describe(transformation)
        raise UserError(f"{change} is for {kinds}, these are {output.type}")


def _check_units(connection: Connection, unit: str, to: str) -> None:
    """Raise UserError if units differ at the ends of a connection without factor and offset."""
    source, target = connection.source, connection.target
    needed = conversion(unit, to)
    if needed is None:
        raise UserError(f"unit {unit!r} of {source} cannot become {to!r} of {target}")
    if needed != _IDENTITY:
        raise UserError(
            f"{source} is in {unit!r} and {target} in {to!r}; it needs {_describe(needed)}"
        )


def conversion(unit: str, to: str) -> tuple[float, float] | None:
    """Return the factor and the offset that convert values in a unit to another one.

    None if the dimensions of the units differ or a unit is unknown.
    """
    if unit == to:
        return _IDENTITY
    try:
        offset = float(units.convert(0.0, unit, to))
        return float(units.convert(1.0, unit, to)) - offset, offset
    except UserError:
        return None


def _describe(transformation: tuple[float, float]) -> str:
    """Return a factor and an offset as text, without an offset of 0."""
    factor, offset = transformation
    return f"factor {factor:.12g}" + (f" and offset {offset:.12g}" if offset else "")


def _check_system_input(models: Mapping[str, Model], name: str, ports: Sequence[Port]) -> None:
    """Raise UserError if a system input feeds inputs that differ in type or unit."""
    signals = [_find_end(models, port, "input") for port in ports]
    for port, signal in zip(ports[1:], signals[1:], strict=True):
        for attribute in ("type", "unit"):
            first = getattr(signals[0], attribute)
            other = getattr(signal, attribute)
            if first != other:
                raise UserError(
                    f"input {name} feeds {ports[0]} of {attribute} {first!r} and {port} of"
                    f" {attribute} {other!r}"
                )


def _check_sources(system: System) -> None:
    """Raise UserError if an input has several sources, or neither a source nor a value."""
    sources: dict[Port, str] = {}
    pairs = [(str(connection.source), connection.target) for connection in system.connections]
    pairs += [(f"system input {name}", port) for name, port in system.fed_ports]
    for source, target in pairs:
        if target in sources:
            raise UserError(f"{target} has two sources, {sources[target]} and {source}")
        sources[target] = source
    for port, signal in open_inputs(system).items():
        if not signal.declares_start:
            raise UserError(
                f"{port} is not connected, no input of the system feeds it, and it is given no"
                " value, nor does its FMU declare a start value"
            )


def open_inputs(system: System) -> dict[Port, Signal]:
    """Return the inputs of members without a connection and without a value in the system."""
    fed = {connection.target for connection in system.connections}
    fed |= {port for _, port in system.fed_ports}
    return {
        Port(member.name, name): signal
        for member in system.members
        for name, signal in interface(member).inputs.items()
        if Port(member.name, name) not in fed and name not in member.parameters
    }


def describe_open_input(name: str, signal: Signal) -> str:
    """Return a line about an input without a connection, with its start value."""
    start = units.format_value(signal.start, signal)
    return f"nothing feeds {name}; it stays at {start}, the start value of its FMU"


def _unit_warnings(system: System, connection: Connection) -> Iterator[str]:
    """Yield a warning if factor and offset of a connection are not those of its units."""
    source = connection.source
    target = connection.target
    output, input_ = signal_at(system, source), signal_at(system, target)
    unit, to = output.unit, input_.unit
    if output.declares_unit != input_.declares_unit:
        without, other = (target, unit) if output.declares_unit else (source, to)
        if other != "1":
            yield f"{connection}: {without} has no unit; it is taken in {other!r}"
        return
    needed = conversion(unit, to)
    actual = (connection.factor, connection.offset)
    if needed is not None and unit != to and not _are_close(needed, actual):
        yield (
            f"{connection}: from {unit!r} to {to!r}"
            f" the units ask for {_describe(needed)}, given is {_describe(actual)}"
        )


def warnings(system: System) -> list[str]:
    """List warnings about a system that passes :func:`check`.

    Returns
    -------
    list of str
        One line for each FMU that cannot be run on this machine, factor that is not that of the
        units, system input that feeds nothing, and input without a connection.
    """
    lines = []
    for member in system.members:
        with Archive(member.fmu) as archive:
            if archive.host_platform not in archive.platforms:
                available = ", ".join(archive.platforms) or "none"
                lines.append(
                    f"{member.name}: {member.fmu.name} has no binary for {archive.host_platform};"
                    f" it has {available}"
                )
    for connection in system.connections:
        lines += _unit_warnings(system, connection)
    lines += [
        f"system input {name} feeds nothing" for name, ports in system.inputs.items() if not ports
    ]
    lines += [
        describe_open_input(str(port), signal) for port, signal in open_inputs(system).items()
    ]
    return lines


def _are_close(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return all(
        math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-300) for a, b in zip(one, other, strict=True)
    )
