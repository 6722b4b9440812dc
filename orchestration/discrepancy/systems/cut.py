"""Cutting a system open at its measured signals: what each member is fed, and what of it can be judged.

A column of a record is a signal of the system under any of its names: ``member.variable`` at either end of a
connection, the name of an input or output of the system, or the variable alone where all variables of that name are
the same signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.records import Record, read_record
from orchestration.system.check import interface
from orchestration.system.model import Member, Port, System

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InputSource:
    """What an input of a member gets while it is judged.

    Attributes
    ----------
    source : str
        Where it is from, for people; empty if nothing says what it was.
    values : ndarray, shape (n,), or None
        Measured, in the unit of the input; None if it stays at a value.
    value : float or None
        At which it stays.
    smooth : bool
        Whether it may change between samples, so that holding and interpolating differ.
    """

    source: str
    values: Array | None = None
    value: float | None = None
    smooth: bool = False


@dataclass(frozen=True)
class IsolatedMember:
    """A member by itself.

    Attributes
    ----------
    member : Member
    inputs : dict of str to InputSource
    outputs : dict of str to ndarray, shape (n,)
        What was measured of its real outputs, in their units; NaN where nothing was.
    missing : dict of str to str
        Inputs that nothing is known of, each with the signal to measure.
    """

    member: Member
    inputs: dict[str, InputSource]
    outputs: dict[str, Array]
    missing: dict[str, str]

    @property
    def obstacle(self) -> str:
        """Why it cannot be judged; empty if it can."""
        if self.missing:
            pairs = [f"{name} is not measured (measure {signal})" for name, signal in self.missing.items()]
            return "; ".join(pairs)
        return "" if self.outputs else "none of its outputs is measured"


def names(system: System) -> dict[str, Port]:
    """Names under which a record may have a signal, and the port each means.

    Parameters
    ----------
    system : System
    """
    models = {member.name: interface(member) for member in system.members}
    ports = [
        Port(name, v) for name, m in models.items() for v in (*m.outputs, *m.inputs)
    ]  # outputs first: where a signal has both ends, the output gives its unit
    known = {str(port): port for port in ports}
    for name, fed in system.inputs.items():
        if fed:
            known.setdefault(name, fed[0])
    for name, port in system.outputs.items():
        known.setdefault(name, port)
    nets = _nets(system)
    alone: dict[str, list[Port]] = {}
    for port in ports:
        alone.setdefault(port.variable, []).append(port)
    for variable, same in alone.items():
        if len({nets.get(port, str(port)) for port in same}) == 1:
            known.setdefault(variable, same[0])
    return known


def _nets(system: System) -> dict[Port, str]:
    """Ports at which the same number is seen, by what they are connected to."""
    nets = {port: f"input {name}" for name, ports in system.inputs.items() for port in ports}
    for connection in system.connections:
        if connection.passes_on:
            nets[connection.source] = nets[connection.target] = str(connection.source)
    return nets


def read(path: Path, system: System, mapping: Mapping[str, str]) -> tuple[Record, dict[Port, Array]]:
    """Read a record of a system.

    Parameters
    ----------
    path : Path
    system : System
    mapping : Mapping of str to str
        Column to signal, see `orchestration.records.parse_mapping`.

    Returns
    -------
    Record
    dict of Port to ndarray, shape (n,)
        What was measured, in the units of the ports.

    Raises
    ------
    UserError
        If the file is refused, or two columns are one signal.
    """
    known = names(system)
    record = read_record(path, {name: _unit(system, port) for name, port in known.items()}, mapping=mapping)
    measured: dict[Port, Array] = {}
    for name, values in record.signals.items():
        if known[name] in measured:
            raise UserError(f"{path}: {name} is {known[name]}, and another column is too; leave out one of them")
        measured[known[name]] = values
    return record, measured


def _unit(system: System, port: Port) -> str:
    model = interface(system.member(port.member))
    return (model.outputs.get(port.variable) or model.inputs[port.variable]).unit


def cut(system: System, measured: Mapping[Port, Array], given: Mapping[Port, float]) -> list[IsolatedMember]:
    """Cut a system open at its measured signals.

    Parameters
    ----------
    system : System
    measured : Mapping of Port to ndarray, shape (n,)
    given : Mapping of Port to float
        Values of inputs that are known to have stayed where they were.

    Returns
    -------
    list of Cut
        One for each member.
    """
    everywhere = dict(measured)
    for c in system.connections:  # an output that was measured where it arrives
        if c.source not in everywhere and c.target in everywhere and c.factor:
            everywhere[c.source] = (everywhere[c.target] - c.offset) / c.factor
    for ports in system.inputs.values():
        there = [everywhere[port] for port in ports if port in everywhere]
        everywhere |= {port: there[0] for port in ports if port not in everywhere and there}
    return [_alone(system, member, everywhere, given) for member in system.members]


def _alone(
    system: System, member: Member, measured: Mapping[Port, Array], given: Mapping[Port, float]
) -> IsolatedMember:
    model = interface(member)
    arriving = {c.target: c for c in system.connections}
    outer = {port: name for name, ports in system.inputs.items() for port in ports}
    inputs, missing = dict[str, InputSource](), dict[str, str]()
    for name, signal in model.inputs.items():
        port = Port(member.name, name)
        connection, smooth = arriving.get(port), signal.type == "real"
        if port in measured:
            found = InputSource("measured", measured[port], smooth=smooth)
        elif connection is not None and connection.source in measured:
            values = connection.factor * measured[connection.source] + connection.offset
            found = InputSource(str(connection.source), values, smooth=smooth)
        elif port in given:
            found = InputSource("setting", value=given[port])
        elif connection is None and port not in outer:
            value = member.parameters.get(name, signal.start)
            found = InputSource("value in the system", value=float(value))
        else:
            missing[name] = str(connection.source) if connection else outer[port]
            continue
        if found.values is not None and not np.isfinite(found.values).all():
            missing[name] = f"{found.source if found.source != 'measured' else port} without holes"
            continue
        inputs[name] = found
    real = [name for name, signal in model.outputs.items() if signal.type == "real"]
    outputs = {name: measured[p] for name in real if (p := Port(member.name, name)) in measured}
    return IsolatedMember(member, inputs, {n: y for n, y in outputs.items() if np.isfinite(y).any()}, missing)
