"""Whether a system makes sense: what is connected exists and fits, and nothing that is needed is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import fmpy

from fmus.kit import units
from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.archive import Archive
from orchestration.fmu.model import Model, find_model
from orchestration.fmu.signal import Signal, check_value
from orchestration.system.model import Connection, Member, Port, System

_IDENTITY = (1.0, 0.0)


def interface(member: Member) -> Model:
    """Variables of a member's FMU.

    Raises
    ------
    UserError
        If the FMU is missing or cannot be read, naming the member.
    """
    path = member.fmu.absolute()
    try:
        return _interface(path, path.stat().st_mtime_ns if path.is_file() else 0)
    except UserError as error:
        raise UserError(f"member {member.name}: {error}") from error


@lru_cache(maxsize=64)
def _interface(path: Path, written: int) -> Model:
    return find_model(str(path))


def variable(member: Member, name: str) -> Signal:
    """Variable of a member that can be given a value: a parameter, or an input that nothing else feeds.

    Raises
    ------
    UserError
        If there is none of that name.
    """
    model = interface(member)
    known = {**model.parameters, **model.inputs}
    if name not in known:
        what = "an output" if name in model.outputs else "no parameter or input of its FMU"
        raise UserError(
            f"member {member.name}: {name!r} is {what} and cannot be set{suggestion(name, known)}"
        )
    return known[name]


def check(system: System) -> None:
    """Refuse a system that cannot be run as it is written.

    Raises
    ------
    UserError
        In one line, with both ends where two things do not fit together: members of one name, a missing FMU, an end of
        a connection that does not exist or has the wrong causality, types or units that differ, two sources for one
        input, an input that has none, a value that cannot be set.
    """
    try:
        _check(system)
    except UserError as error:
        where = f"system {system.name}: "
        raise UserError(
            str(error) if str(error).startswith(where) else where + str(error)
        ) from error


def _check(system: System) -> None:
    if not (
        math.isfinite(system.step)
        and math.isfinite(system.stop)
        and system.step > 0.0
        and system.stop > 0.0
    ):
        raise UserError(
            f"step {system.step:g} s and stop time {system.stop:g} s must both be positive"
        )
    _check_names(system)
    models = {member.name: interface(member) for member in system.members}
    for member in system.members:
        for name, value in member.parameters.items():
            check_value(variable(member, name), value, f"member {member.name}: {name}")
    for connection in system.connections:
        _check_connection(system, models, connection)
    for name, ports in system.inputs.items():
        _check_system_input(system, models, name, ports)
    for port in system.outputs.values():
        _end(system, models, port, "output")
    _check_sources(system, models)


def _check_names(system: System) -> None:
    if not system.members:
        raise UserError("it has no members")
    for kind, names in (
        ("members", [member.name for member in system.members]),
        ("system connectors", [*system.inputs, *system.outputs]),
    ):
        for name in names:
            if names.count(name) > 1:
                raise UserError(f"two {kind} are named {name!r}")
            if not name or name != name.strip() or (kind == "members" and "." in name):
                raise UserError(
                    f"{name!r} is no name for one of its {kind}: it is empty, padded, or has a dot"
                )


def _end(system: System, models: Mapping[str, Model], port: Port, causality: str) -> Signal:
    """Signal at an end of a connection."""
    model = models[system.member(port.member).name]
    groups = {"input": model.inputs, "output": model.outputs, "parameter": model.parameters}
    if port.variable in (wanted := groups[causality]):
        return wanted[port.variable]
    for other, signals in groups.items():
        if port.variable in signals:
            article = "a" if other == "parameter" else "an"
            raise UserError(f"{port} is {article} {other} where an {causality} is needed")
    raise UserError(
        f"{port.member} has no {causality} named {port.variable!r}{suggestion(port.variable, wanted)}"
    )


def _check_connection(system: System, models: Mapping[str, Model], connection: Connection) -> None:
    source, target = connection.source, connection.target
    where = f"{source} -> {target}"
    try:
        gives, takes = _end(system, models, source, "output"), _end(system, models, target, "input")
    except UserError as error:
        raise UserError(f"{where}: {error}") from error
    if source.member == target.member:
        raise UserError(f"{where}: a member cannot be connected with itself")
    if gives.type != takes.type:
        raise UserError(
            f"{where}: {source} is {gives.type} and {target} is {takes.type}; types must be the same"
        )
    transformation = (connection.factor, connection.offset)
    if not all(map(math.isfinite, transformation)):
        raise UserError(
            f"{where}: factor {connection.factor} and offset {connection.offset} must be finite"
        )
    if connection.passes_on:
        needed = conversion(gives.unit, takes.unit)
        if needed is None:
            raise UserError(
                f"{where}: unit {gives.unit!r} of {source} cannot become {takes.unit!r} of {target}"
            )
        if needed != _IDENTITY:
            by = _words(needed)
            raise UserError(
                f"{where}: {source} is in {gives.unit!r} and {target} in {takes.unit!r}; it needs {by}"
            )
    elif gives.type != "real":
        raise UserError(
            f"{where}: {_words(transformation)} is for real variables, these are {gives.type}"
        )


def conversion(unit: str, to: str) -> tuple[float, float] | None:
    """Factor and offset with which a value in one unit becomes one in another; None if it cannot."""
    if unit == to:
        return _IDENTITY
    try:
        offset = float(units.convert(0.0, unit, to))
        return float(units.convert(1.0, unit, to)) - offset, offset
    except UserError:
        return None


def _words(transformation: tuple[float, float]) -> str:
    factor, offset = transformation
    return f"factor {factor:.12g}" + (f" and offset {offset:.12g}" if offset else "")


def _check_system_input(
    system: System, models: Mapping[str, Model], name: str, ports: tuple[Port, ...]
) -> None:
    """All that one input of the system feeds gets the same number, so it must be of one type and unit."""
    signals = [_end(system, models, port, "input") for port in ports]
    for port, signal in zip(ports[1:], signals[1:], strict=True):
        for what, one, other in (
            ("type", signals[0].type, signal.type),
            ("unit", signals[0].unit, signal.unit),
        ):
            if one != other:
                raise UserError(
                    f"input {name} feeds {ports[0]} of {what} {one!r} and {port} of {what} {other!r}"
                )


def _check_sources(system: System, models: Mapping[str, Model]) -> None:
    sources: dict[Port, str] = {}
    pairs = [(str(connection.source), connection.target) for connection in system.connections]
    pairs += [
        (f"system input {name}", port) for name, ports in system.inputs.items() for port in ports
    ]
    for source, target in pairs:
        if target in sources:
            raise UserError(f"{target} has two sources, {sources[target]} and {source}")
        sources[target] = source
    for member in system.members:
        for name in models[member.name].inputs:
            port = Port(member.name, name)
            if port not in sources and name not in member.parameters:
                raise UserError(
                    f"{port} is not connected, no input of the system feeds it, and it is given no value"
                )


def warnings(system: System) -> list[str]:
    """What is odd about a system that passes :func:`check`, a line each.

    Returns
    -------
    list of str
        FMUs that cannot be run on this machine, factors that are not those of the units, inputs that feed nothing.
    """
    lines = []
    for member in system.members:
        with Archive(member.fmu) as archive:
            if fmpy.platform not in archive.platforms:
                there = ", ".join(archive.platforms) or "none"
                lines.append(
                    f"{member.name}: {member.fmu.name} has no binary for {fmpy.platform}; it has {there}"
                )
    for connection in system.connections:
        gives = interface(system.member(connection.source.member)).outputs[
            connection.source.variable
        ]
        takes = interface(system.member(connection.target.member)).inputs[
            connection.target.variable
        ]
        needed, given = conversion(gives.unit, takes.unit), (connection.factor, connection.offset)
        if needed is not None and gives.unit != takes.unit and not _close(needed, given):
            lines.append(
                f"{connection.source} -> {connection.target}: from {gives.unit!r} to {takes.unit!r} the units ask for "
                f"{_words(needed)}, given is {_words(given)}"
            )
    lines += [
        f"system input {name} feeds nothing" for name, ports in system.inputs.items() if not ports
    ]
    return lines


def _close(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return all(
        math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-300) for a, b in zip(one, other, strict=True)
    )
