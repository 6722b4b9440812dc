"""Records of systems: assignment of the columns of a file to the signals of a system.

A column is a signal of the system under any of its names: ``member.variable`` at either end of a
connection, the name of an input or output of the system, or the variable alone where all variables
of that name are the same signal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.records import Record, Source, read_record
from orchestration.records.tables import split_header_cell
from orchestration.system.checking import interface, signal_at
from orchestration.system.model import Port, System


def signal_names(system: System) -> dict[str, Port]:
    """Return the names under which a record may have a signal, and the port that each means.

    Parameters
    ----------
    system : System
    """
    models = {member.name: interface(member) for member in system.members}
    # outputs first: where a signal has both ends, the output gives its unit
    ports = [Port(name, v) for name, m in models.items() for v in (*m.outputs, *m.inputs)]
    known = {str(port): port for port in ports}
    unambiguous = _unambiguous_variables(system, ports)
    for name, port in (*system.fed_ports, *system.outputs.items(), *unambiguous.items()):
        known.setdefault(name, port)
    return known


def _unambiguous_variables(system: System, ports: Sequence[Port]) -> dict[str, Port]:
    """Return a port by the name of its variable, if all variables of that name are one signal."""
    nets = _nets(system)
    by_variable: dict[str, list[Port]] = {}
    for port in ports:
        by_variable.setdefault(port.variable, []).append(port)
    unambiguous = {}
    for variable, namesakes in by_variable.items():
        signals = {nets.get(port, str(port)) for port in namesakes}
        if len(signals) == 1:
            unambiguous[variable] = namesakes[0]
    return unambiguous


def _nets(system: System) -> dict[Port, str]:
    """Name the net of every port that is connected; ports of a net have the same value."""
    nets = {port: f"input {name}" for name, port in system.fed_ports}
    for connection in system.connections:
        if connection.passes_on:
            nets[connection.source] = str(connection.source)
            nets[connection.target] = str(connection.source)
    return nets


def read_system_record(
    source: Source | Record, system: System, mapping: Mapping[str, str]
) -> tuple[Record, dict[Port, Array]]:
    """Read a record of a system.

    Parameters
    ----------
    source : Source or Record
        A record that was read before; its signals must have names of the system's signals.
    system : System
    mapping : Mapping of str to str
        Column to signal, see `orchestration.records.parse_mapping`.

    Returns
    -------
    Record
    dict of Port to ndarray, shape (n,)
        Measured values, in the units of the ports.

    Raises
    ------
    UserError
        If the file is refused, two columns are one signal, or the system lacks a signal.
    """
    known = signal_names(system)
    if isinstance(source, Record):
        record = source
    else:
        units = {name: signal_at(system, port).unit for name, port in known.items()}
        record = read_record(source, units, mapping=mapping)
    measured: dict[Port, Array] = {}
    for name, values in record.signals.items():
        if name not in known:
            raise UserError(f"{record.source}: {system.name} has no signal {name!r}")
        if known[name] in measured:
            raise UserError(
                f"{record.source}: {name} is {known[name]}, and another column is too; leave out"
                " one of them"
            )
        measured[known[name]] = values
    return record, measured


def columns_of(
    system: System, record: Record, mapping: Mapping[str, str]
) -> dict[Port, tuple[str, str]]:
    """Return the column of the file from which every port can be read.

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
        The column, and the unit in brackets that the user gives it; empty if the file has one.
    """
    known = signal_names(system)
    columns = {known[name]: (name, "") for name in record.signals}
    for header, target in mapping.items():
        name, unit = split_header_cell(target)
        if name in known:
            columns[known[name]] = (header, f"[{unit}]" if unit else "")
    # ports that carry one signal are read from the column of any of them
    connected = [(c.source, c.target) for c in system.connections if c.passes_on]
    for ports in (*connected, *system.inputs.values()):
        column = next((columns[port] for port in ports if port in columns), None)
        if column is not None:
            columns |= {port: column for port in ports if port not in columns}
    return columns
