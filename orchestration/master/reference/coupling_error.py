"""Coupling error: how far co-simulation is from the fused system, and what its connections do to energy.

The inputs of members are held, or extrapolated, over a communication step. What that does is measured here at several
steps, against the fused system with the same inputs at the same communication points: only the exchange differs.

Where one member gives a length and receives a force and another the reverse, work goes from one to the other. Both
sides account for it, each with the force and the motion it has itself. They differ because the one side moves under a
force that is a step old; the difference is energy that the coupling makes or loses, and needs no reference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from fmus.kit.record.compiled import CompiledModel
from orchestration.master import run
from orchestration.master.reference.fused import fuse
from orchestration.system.check import interface
from orchestration.system.model import Connection, System

Array = NDArray[np.float64]


class Mechanical(NamedTuple):
    """A mechanical coupling: ``length`` goes one way and ``force`` back; as text, both sources."""

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
        From the start to each communication point: work that the receiver of the length accounts for, less what the
        receiver of the force does. Positive where the coupling makes energy.
    exchanged : float
        Work that went through it in either direction.
    """

    energy: Array
    exchanged: float

    @property
    def relative(self) -> float:
        """Magnitude of the energy made in all, over the work exchanged; 0 if nothing was exchanged."""
        return float(abs(self.energy[-1])) / self.exchanged if self.exchanged > 0.0 else 0.0


@dataclass(frozen=True)
class CouplingError:
    """Coupling error of a system over the communication step.

    Attributes
    ----------
    steps : ndarray, shape (m,)
        Communication steps in s.
    errors : dict of str to ndarray, shape (m,)
        For each signal the largest difference from the fused system, over the largest magnitude that it has there.
    imbalances : dict of str to ndarray, shape (m,)
        For each mechanical coupling, energy made over work exchanged.
    floor : float
        Errors below it are those of the integration.
    """

    steps: Array
    errors: dict[str, Array]
    imbalances: dict[str, Array]
    floor: float

    def order(self, name: str) -> float:
        """Observed order of a signal or mechanical coupling: slope of log error over log step, by least squares.

        NaN unless two errors at least are above the floor.
        """
        errors = (self.errors | self.imbalances)[name]
        seen = errors > self.floor
        if seen.sum() < 2:
            return float("nan")
        return float(np.polyfit(np.log(self.steps[seen]), np.log(errors[seen]), 1)[0])


def coupling_error(
    system: System,
    steps: Sequence[float],
    stop: float,
    inputs: Mapping[str, Callable[[Array], Array]],
    *,
    since: float = 0.0,
    **options: Any,
) -> CouplingError:
    """Run a system at several communication steps, and hold each run against the fused system.

    Parameters
    ----------
    system : System
        Of our own components; see :func:`.fuse`.
    steps : sequence of float
        Communication steps in s; the stop time is a multiple of each.
    stop : float
        Stop time in s; the start is at zero.
    inputs : Mapping of str to callable
        Values of inputs of the system at given times. Both sides hold them from each communication point to the next.
    since : float
        Errors are looked at from this time on. An order shows only where nothing jumps or kinks between communication
        points: sample instants must be such points, and tension must not come and go. Members that look at each other
        at the same sample instants must be in the order in which the master steps them.
    **options
        ``method``, ``extrapolation`` and others of :func:`orchestration.master.run`. Without ``feedthrough`` there are
        no imbalances: lengths and forces then belong to different points.

    Returns
    -------
    CouplingError

    Raises
    ------
    UserError
        If the stop time is no multiple of a step, the system cannot be fused, a member fails, or Ctrl-C was pressed.
    """
    graph = fuse(system)
    model = CompiledModel(graph)
    couplings = mechanical(system) if options.get("feedthrough", True) else []
    errors: dict[str, list[float]] = {}
    imbalances: dict[str, list[float]] = {}
    for step in steps:
        count = round(stop / step)
        if abs(count * step - stop) > 1e-9 * step:
            raise UserError(
                f"stop time {stop:g} s is no multiple of the communication step {step:g} s"
            )
        time = np.linspace(0.0, stop, count + 1)
        fed = {name: function(time) for name, function in inputs.items()}
        done = run(system, time, fed, **options)
        if not done.complete:
            raise UserError(done.message)
        coupled = done.signals
        exact = model.run(time, fed).signals
        window = time >= since
        for name, values in coupled.items():
            scale = np.abs(exact[name][window]).max() or 1.0
            errors.setdefault(name, []).append(
                float(np.abs(values - exact[name])[window].max() / scale)
            )
        for name, made in imbalance(couplings, coupled, options.get("extrapolation", 0)).items():
            imbalances.setdefault(name, []).append(made.relative)
    return CouplingError(
        np.array(steps),
        {name: np.array(values) for name, values in errors.items()},
        {name: np.array(values) for name, values in imbalances.items()},
        10.0 * graph.tolerance,
    )


def mechanical(system: System) -> list[Mechanical]:
    """Find the mechanical couplings: a length in m from one member to another, and a force in N back.

    Several between the same two members are paired in the order in which they are connected.
    """

    def between(unit: str) -> dict[tuple[str, str], list[Connection]]:
        pairs: dict[tuple[str, str], list[Connection]] = {}
        for c in system.connections:
            if interface(system.member(c.source.member)).outputs[c.source.variable].unit == unit:
                pairs.setdefault((c.source.member, c.target.member), []).append(c)
        return pairs

    forces = between("N")
    return [
        Mechanical(length, force)
        for (one, other), lengths in between("m").items()
        for length, force in zip(lengths, forces.get((other, one), []), strict=False)
    ]


def imbalance(
    couplings: Sequence[Mechanical], signals: Mapping[str, Array], extrapolation: int = 0
) -> dict[str, Imbalance]:
    """Account for the energy that mechanical couplings make.

    The receiver of the force moves under what it got at the beginning of a step, held or extrapolated over it. The
    receiver of the length has a spring, whose force changes in proportion to the length.

    Parameters
    ----------
    couplings : sequence of Mechanical
    signals : Mapping of str to ndarray, shape (n,)
        At the communication points, by ``member.variable``; see :class:`orchestration.master.Run`.
    extrapolation : {0, 1}
        Of the run.

    Returns
    -------
    dict of str to Imbalance
    """
    return {str(c): _imbalance(c, signals, extrapolation) for c in couplings}


def _imbalance(coupling: Mechanical, signals: Mapping[str, Array], extrapolation: int) -> Imbalance:
    length, force = signals[str(coupling.length.source)], signals[str(coupling.force.source)]
    received = coupling.force.factor * force + coupling.force.offset
    way, rise = np.diff(length), extrapolation * np.diff(received, prepend=received[0])[:-1]
    bend = 0.5 * (np.diff(way, prepend=way[:1]) + np.diff(way, append=way[-1:]))
    # the integral of a force that rises evenly, over a motion of constant acceleration
    given = (received[:-1] + 0.5 * rise) * way + rise * bend / 12.0
    taken = 0.5 * (force[1:] + force[:-1]) * coupling.length.factor * way
    return Imbalance(np.append(0.0, np.cumsum(taken - given)), float(np.abs(taken).sum()))
