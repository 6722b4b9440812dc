"""A record of a system: which signal of the system each column is.

A column is a signal of the system under any of its names: ``member.variable`` at either end of a connection, the name
of an input or output of the system, or the variable alone where all variables of that name are the same signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.records import Record, read_record
from orchestration.records.table import split_header_cell
from orchestration.system.check import interface
from orchestration.system.model import Port, System

Array = NDArray[np.float64]


def signal_names(system: System) -> dict[str, Port]:
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
    by_variable: dict[str, list[Port]] = {}
    for port in ports:
        by_variable.setdefault(port.variable, []).append(port)
    for variable, same in by_variable.items():
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


def read_system_record(
    path: Path, system: System, mapping: Mapping[str, str]
) -> tuple[Record, dict[Port, Array]]:
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
    known = signal_names(system)
    record = read_record(
        path, {name: _unit(system, port) for name, port in known.items()}, mapping=mapping
    )
    measured: dict[Port, Array] = {}
    for name, values in record.signals.items():
        if known[name] in measured:
            raise UserError(
                f"{path}: {name} is {known[name]}, and another column is too; leave out one of them"
            )
        measured[known[name]] = values
    return record, measured


def columns_of(
    system: System, record: Record, mapping: Mapping[str, str]
) -> dict[Port, tuple[str, str]]:
    """Which column of the file every port can be read from.

    Parameters
    ----------
    system : System
    record : Record
        As `read_system_record` returned it.
    mapping : Mapping of str to str
        Column to signal.

    Returns
    -------
    dict of Port to tuple of str
        The column, and the unit in brackets that the user says it is in; empty if the file tells.
    """
    known = signal_names(system)
    columns = {known[name]: (name, "") for name in record.signals}
    for column, target in mapping.items():
        name, unit = split_header_cell(target)
        if name in known:
            columns[known[name]] = column, f"[{unit}]" if unit else ""
    same = [(c.source, c.target) for c in system.connections if c.passes_on] + list(
        system.inputs.values()
    )
    for ports in same:
        there = [columns[port] for port in ports if port in columns]
        columns |= {port: there[0] for port in ports if port not in columns and there}
    return columns


def _unit(system: System, port: Port) -> str:
    model = interface(system.member(port.member))
    return (model.outputs.get(port.variable) or model.inputs[port.variable]).unit
