"""Energy that a mechanical coupling of two members makes or loses in co-simulation.

Where one member gives a length and receives a force and another the reverse, work is transferred
from one to the other. Both sides account for it, each with the force and the motion it has itself.
They differ because one side moves under a force that is a step old; the difference is energy that
the coupling makes or loses, and needs no reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fmus.kit.arrays import Array, Signals
from orchestration.system import Connection, System, signal_at


class Mechanical(NamedTuple):
    """A mechanical coupling of two members: one sends a length, the other returns a force."""

    length: Connection
    force: Connection

    def __str__(self) -> str:
        return f"{self.length.source} <-> {self.force.source}"


@dataclass(frozen=True)
class Imbalance:
    """Energy that a mechanical coupling makes, in J.

    Attributes
    ----------
    energy : ndarray, shape (n,)
        From the start to each communication point: work that the receiver of the length accounts
        for, less that of the receiver of the force. Positive where the coupling makes energy.
    exchanged : float
        Work that was transferred in either direction.
    """

    energy: Array
    exchanged: float

    @property
    def relative(self) -> float:
        """Total energy made, in magnitude, relative to the work exchanged; 0 without exchange."""
        return float(abs(self.energy[-1])) / self.exchanged if self.exchanged > 0.0 else 0.0


def mechanical(system: System) -> list[Mechanical]:
    """Find the mechanical couplings: connections of a length, m, with those of a force, N, back.

    Several between the same two members are paired in the order in which they are connected.
    """

    def between(unit: str) -> dict[tuple[str, str], list[Connection]]:
        """Return the connections in a unit, by source and target member."""
        pairs: dict[tuple[str, str], list[Connection]] = {}
        for c in system.connections:
            if signal_at(system, c.source).unit == unit:
                pairs.setdefault((c.source.member, c.target.member), []).append(c)
        return pairs

    forces = between("N")
    return [
        Mechanical(length, force)
        for (one, other), lengths in between("m").items()
        for length, force in zip(lengths, forces.get((other, one), []), strict=False)
    ]


def imbalance(
    couplings: Sequence[Mechanical], signals: Signals, extrapolation: int = 0
) -> dict[str, Imbalance]:
    """Compute the energy that mechanical couplings make.

    The receiver of the force moves under its value at the beginning of a step, held or
    extrapolated over it. The receiver of the length has a spring, whose force changes in proportion
    to the length.

    Parameters
    ----------
    couplings : sequence of Mechanical
    signals : Mapping of str to ndarray, shape (n,)
        At the communication points, by ``member.variable``; see :class:`orchestration.master.Run`.
    extrapolation : {0, 1}
        The option of the run.

    Returns
    -------
    dict of str to Imbalance
    """
    return {str(c): _imbalance(c, signals, extrapolation) for c in couplings}


def _imbalance(coupling: Mechanical, signals: Signals, extrapolation: int) -> Imbalance:
    """Return the energy that a coupling makes and the work that it transfers, see `imbalance`.

    The works of both receivers in each step differ by the energy that the coupling makes.
    """
    length = signals[str(coupling.length.source)]
    force = signals[str(coupling.force.source)]
    received_force = coupling.force.factor * force + coupling.force.offset
    displacement = np.diff(length)  # in each step
    force_change = extrapolation * np.diff(received_force, prepend=received_force[0])[:-1]
    # change of the displacement from step to step: the acceleration times the squared step
    bend = 0.5 * (
        np.diff(displacement, prepend=displacement[:1])
        + np.diff(displacement, append=displacement[-1:])
    )
    # integral of a force that changes linearly, over a motion of constant acceleration
    mean_force = received_force[:-1] + 0.5 * force_change
    work_of_force = mean_force * displacement + force_change * bend / 12.0
    # integral of the spring's force over its length, by the trapezoidal rule
    work_of_length = 0.5 * (force[1:] + force[:-1]) * coupling.length.factor * displacement
    made = np.append(0.0, np.cumsum(work_of_length - work_of_force))
    return Imbalance(made, float(np.abs(work_of_length).sum()))
