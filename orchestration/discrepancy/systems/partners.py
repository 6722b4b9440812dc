"""Which members hold a member in its loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from orchestration.discrepancy.systems.in_loop import Partner
from orchestration.discrepancy.systems.member import MemberSimulation
from orchestration.discrepancy.systems.verdict import MemberDiagnosis
from orchestration.system.model import Connection, System


def loop_members(system: System, name: str) -> list[str]:
    """Members that feed a member and are fed by it.

    Parameters
    ----------
    system : System
    name : str
        Of the member.
    """
    fed = {c.target.member for c in system.connections if c.source.member == name}
    feeding = {c.source.member for c in system.connections if c.target.member == name}
    return [m.name for m in system.members if m.name in fed & feeding]


def connections_between(system: System, name: str, others: Sequence[str]) -> list[Connection]:
    """Connections from a member to some others, and from these to it."""
    ends = {(name, other) for other in others} | {(other, name) for other in others}
    return [c for c in system.connections if (c.source.member, c.target.member) in ends]


def partners_of(
    system: System,
    name: str,
    simulations: Mapping[str, MemberSimulation],
    diagnoses: Mapping[str, MemberDiagnosis],
) -> list[Partner]:
    """Partners of a member, if all of them follow what they are fed and were measured without gaps where they feed it.

    Parameters
    ----------
    system : System
    name : str
        Of the member.
    simulations : Mapping of str to MemberSimulation
        Of members that can be simulated.
    diagnoses : Mapping of str to MemberDiagnosis
        Of all members by themselves.

    Returns
    -------
    list of Partner
        Empty if any of them cannot be relied on.
    """
    others = loop_members(system, name)
    for other in others:
        if other not in simulations or not diagnoses[other].assessable:
            return []
        measured = simulations[other].isolated.outputs
        sources = {
            c.source.variable
            for c in system.connections
            if (c.source.member, c.target.member) == (other, name)
        }
        if not all(
            source in measured and np.isfinite(measured[source]).all() for source in sources
        ):
            return []
    return [
        Partner(simulations[n], {p: a.value for p, a in diagnoses[n].parameters.items()})
        for n in others
    ]
