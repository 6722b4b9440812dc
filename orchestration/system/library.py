"""Systems of the packages of components, and measurement noise in a system."""

from __future__ import annotations

from dataclasses import replace

from fmus.kit import registry
from fmus.kit.errors import find
from orchestration.system.model import Connection, Member, Port, System, connect
from orchestration.system.voltmeter import Voltmeter

# by system; its SSP files have these texts as descriptions
SUMMARIES = {name: declared.summary for name, declared in registry.systems().items()}
NAMES = tuple(SUMMARIES)


def system(name: str, runtime: str = "native") -> System:
    """Return a system of a package, with FMUs from the cache or newly built.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    runtime : {"native", "python"}
        Kind of build of its members.

    Raises
    ------
    UserError
        If there is no such system or runtime, or an FMU cannot be built.
    """
    return build(find(name, registry.systems(), "no system"), runtime)


def build(declared: registry.SystemDeclaration, runtime: str = "native") -> System:
    """Return a declared system, with FMUs from the cache or newly built.

    Parameters
    ----------
    declared : SystemDeclaration
    runtime : {"native", "python"}
        Kind of build of its members.

    Raises
    ------
    UserError
        If there is no such component, effect or runtime, or an FMU cannot be built.
    """
    outputs = [_port(text) for text in declared.outputs]
    return System(
        name=declared.name,
        members=tuple(
            Member.of(member_name, registry.member_class(member), member.values, runtime)
            for member_name, member in declared.members.items()
        ),
        connections=connect(*declared.connections),
        inputs={key: tuple(map(_port, targets)) for key, targets in declared.inputs.items()},
        outputs={port.variable: port for port in outputs},
        doc=declared.summary,
        step=declared.step,
        stop=declared.stop,
    )


def _port(text: str) -> Port:
    """Return the port of a text ``member.variable``."""
    member, _, variable = text.partition(".")
    return Port(member, variable)


def with_voltmeter(system: System, source: str, runtime: str = "native") -> System:
    """Return a system with a voltmeter in the connections from a voltage to its inputs.

    Parameters
    ----------
    system : System
    source : str
        Output ``member.variable``, in V; the inputs connected to it receive
        ``voltmeter.measured_voltage``.
    runtime : {"native", "python"}
        Kind of build of the voltmeter.

    Returns
    -------
    System
        The system with a further input ``voltage_error`` in V, 0 by default, for measurement noise.

    Raises
    ------
    UserError
        If there is no such member, or the voltmeter cannot be built.
    """
    port = system.port(source)
    measured = Port("voltmeter", "measured_voltage")
    connections = [
        replace(c, source=measured) if c.source == port else c for c in system.connections
    ]
    return replace(
        system,
        members=(*system.members, Member.of("voltmeter", Voltmeter, runtime=runtime)),
        connections=(*connections, Connection(port, Port("voltmeter", "voltage"))),
        inputs={**system.inputs, "voltage_error": (Port("voltmeter", "error"),)},
    )
