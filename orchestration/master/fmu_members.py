"""Members of a packed system that are FMUs without equations: their variables and archives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from fmus.kit import UserError, units
from fmus.kit.build import toolchain
from fmus.kit.declare import (
    Declaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    name_declaration,
)
from fmus.kit.errors import find
from fmus.kit.layout import Layout
from fmus.kit.symbolic.packing import FmuMember
from orchestration.fmu import Signal
from orchestration.fmu.archive import Archive, read_description
from orchestration.fmu.signal import read_signal, type_of
from orchestration.system import Member, System

_D = TypeVar("_D", bound=Declaration)


def fmu_members(system: System, names: Sequence[str]) -> dict[str, FmuMember]:
    """Return members without equations as the packed system has them, by name.

    Parameters
    ----------
    system : System
    names : sequence of str

    Raises
    ------
    UserError
        If one is not for co-simulation of FMI 2.0, asks for asynchronous steps, passes texts on, or
        is used more often than a process can have instances of it.
    """
    folders: dict[Path, str] = {}
    found = {}
    for name in names:
        member = system.member(name)
        path = member.fmu.resolve()
        is_first = path not in folders
        folder = folders.setdefault(path, f"members/{len(folders)}")
        found[name] = _fmu_member(member, _fed_variables(system, name), _read(system, name), folder)
        if found[name].runs_once and not is_first:
            raise UserError(
                f"member {name} cannot be packed: a process can have one instance of {path.name}"
                " only (canBeInstantiatedOnlyOncePerProcess)"
            )
    return found


def common_platforms(
    fmus: Mapping[str, FmuMember], wanted: Sequence[str] | None
) -> Sequence[str] | None:
    """Return the platforms for which all members have binaries.

    Parameters
    ----------
    fmus : Mapping of str to FmuMember
    wanted : sequence of str, optional
        By default those that an installed compiler can serve.

    Returns
    -------
    sequence of str, optional
        `wanted` without members that are FMUs.

    Raises
    ------
    UserError
        If a member has no binary for one that is wanted, or there is none in common.
    """
    if not fmus:
        return wanted
    common = list(wanted or toolchain.available_platforms())
    for name, fmu in fmus.items():
        missing = [target for target in common if target not in fmu.platforms]
        common = [target for target in common if target in fmu.platforms]
        if not common or (wanted and missing):
            has = ", ".join(fmu.platforms) or "none"
            raise UserError(
                f"member {name} cannot be packed for {', '.join(missing)}: its FMU has binaries for"
                f" {has}"
            )
    return common


def _fed_variables(system: System, name: str) -> list[str]:
    """Return the inputs of a member that receive values."""
    ports = [connection.target for connection in system.connections]
    ports += [port for _, port in system.fed_ports]
    return list(dict.fromkeys(port.variable for port in ports if port.member == name))


def _read(system: System, name: str) -> list[str] | None:
    """Return what the system reads of a member, in order; None if that is every output."""
    sources = [connection.source for connection in system.connections]
    ports = [*sources, *system.outputs.values()]
    read = list(dict.fromkeys(port.variable for port in ports if port.member == name))
    return read if system.outputs else None


def _fmu_member(
    member: Member, fed: Sequence[str], read: Sequence[str] | None, folder: str
) -> FmuMember:
    """Return a member without equations; UserError if it cannot be packed."""
    refused = f"member {member.name} cannot be packed: {member.fmu.name}"
    with Archive(member.fmu) as archive:
        if archive.version != 2 or archive.implementation != "CoSimulation":
            raise UserError(
                f"{refused} has no equations, and is not for co-simulation of FMI 2.0; run the"
                " system as .ssp"
            )
        files = {name: archive.read(name) for name in archive.names}
        platforms = archive.platforms
    unreadable = [name for name, contents in files.items() if contents is None]
    if unreadable:
        raise UserError(f"{refused}: {unreadable[0]} is damaged or too large")
    description = read_description(member.fmu)
    can = description.coSimulation
    if can.canRunAsynchronuously:
        raise UserError(f"{refused} may return before its step is done (canRunAsynchronuously)")
    variables = {variable.name: variable for variable in description.modelVariables}
    for name in (*fed, *(read or ())):
        if type_of(find(name, variables, f"{member.name}: no variable")) == "string":
            raise UserError(f"{refused} passes on {name}, which is a text")
    layout = _layout(variables, list(member.parameters), read)
    texts = {
        variables[name].valueReference: value
        for name, value in member.parameters.items()
        if isinstance(value, str)
    }
    return FmuMember(
        name=description.modelName,
        layout=layout,
        tolerance=float(getattr(description.defaultExperiment, "tolerance", None) or 0.0),
        references=[variables[v.name].valueReference for v in layout.variables],
        texts=texts,
        identifier=can.modelIdentifier,
        guid=description.guid,
        folder=folder,
        files={name: contents for name, contents in files.items() if contents is not None},
        platforms=platforms,
        needs_execution_tool=bool(can.needsExecutionTool),
        varies_step=bool(can.canHandleVariableCommunicationStepSize),
        runs_once=bool(can.canBeInstantiatedOnlyOncePerProcess),
    )


def _layout(
    variables: Mapping[str, Any],
    given: Sequence[str],
    read: Sequence[str] | None,
) -> Layout:
    """Return the variables that a system has of an FMU: what it can set, and what it reads."""
    signals = {
        name: signal
        for name, variable in variables.items()
        if (signal := read_signal(variable)).type != "string"
    }

    def of(causality: str) -> list[str]:
        return [name for name in signals if variables[name].causality == causality]

    inputs = of("input")
    constants = [name for name in of("parameter") if signals[name].declares_start]
    constants += [name for name in given if name in signals and name not in (*inputs, *constants)]
    outputs = of("output") if read is None else [name for name in read if name in signals]
    return Layout(
        tuple(_declared(ParameterDeclaration, signals[name], start=True) for name in constants),
        tuple(_declared(InputDeclaration, signals[name], start=True) for name in inputs),
        (),
        (),
        tuple(_declared(OutputDeclaration, signals[name]) for name in outputs),
    )


def _declared(kind: type[_D], signal: Signal, start: bool = False) -> _D:
    """Return a declaration of a variable of an FMU.

    A unit that is unknown here stands in the description, and the display unit is left out.
    """
    is_known = _is_unit(signal.unit)
    more: dict[str, Any] = {"start": signal.start} if start else {"law": no_law}
    if kind is ParameterDeclaration:
        more["tunable"] = signal.is_tunable
    declared = kind(
        unit=signal.unit if is_known else "1",
        doc=signal.doc if is_known else f"{signal.doc} [{signal.unit}]".strip(),
        min=signal.min,
        max=signal.max,
        type=signal.type,
        **more,
    )
    return name_declaration(declared, signal.name)


def _is_unit(text: str) -> bool:
    try:
        units.base_unit(text)
    except UserError:
        return False
    return True


def no_law(whole: Any) -> float:
    """Stand in for the law of an output that no Python computes."""
    raise NotImplementedError
