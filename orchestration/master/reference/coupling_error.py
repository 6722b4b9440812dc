"""Coupling error: the difference of co-simulation from the fused system, and its energy error.

The inputs of members are held, or extrapolated, over a communication step. The effect of that is
measured here at several steps, against the fused system with the same inputs at the same
communication points: only the exchange differs.

Where one member gives a length and receives a force and another the reverse, work is transferred
from one to the other. Both sides account for it, each with the force and the motion it has itself.
They differ because one side moves under a force that is a step old; the difference is energy that
the coupling makes or loses, and needs no reference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Mask
from fmus.kit.record import CompiledModel
from orchestration.master.reference.fused import fuse
from orchestration.master.simulation import run
from orchestration.system import Connection, System, interface


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


@dataclass(frozen=True)
class CouplingError:
    """Coupling error of a system over the communication step.

    Attributes
    ----------
    steps : ndarray, shape (m,)
        Communication steps in s.
    errors : dict of str to ndarray, shape (m,)
        For each signal the largest difference from the fused system, relative to its largest
        magnitude there.
    imbalances : dict of str to ndarray, shape (m,)
        For each mechanical coupling, energy made relative to work exchanged.
    floor : float
        Errors below it are those of the integration.
    """

    steps: Array
    errors: dict[str, Array]
    imbalances: dict[str, Array]
    floor: float

    def order(self, name: str) -> float:
        """Return the observed order of the error of a signal or mechanical coupling.

        It is the slope of log error over log step by least squares; NaN unless at least two errors
        are above the floor.
        """
        errors = (self.errors | self.imbalances)[name]
        above_floor = errors > self.floor
        if above_floor.sum() < 2:
            return float("nan")
        log_steps = np.log(self.steps[above_floor])
        return float(np.polyfit(log_steps, np.log(errors[above_floor]), 1)[0])


def coupling_error(
    system: System,
    steps: Sequence[float],
    stop: float,
    inputs: Mapping[str, Callable[[Array], Array]],
    *,
    since: float = 0.0,
    **options: Any,
) -> CouplingError:
    """Run a system at several communication steps, and compare each run with the fused system.

    Parameters
    ----------
    system : System
        A system of components of this project; see :func:`.fuse`.
    steps : sequence of float
        Communication steps in s; the stop time is a multiple of each.
    stop : float
        Stop time in s; the start is at zero.
    inputs : Mapping of str to callable
        Values of inputs of the system at given times. Both sides hold them from each communication
        point to the next.
    since : float
        Time in s from which errors are compared. An order shows only where signals are smooth
        between communication points: sample instants must be such points, and tension must not come
        and go. Members that sample each other at the same instants must be in the order in which
        the master steps them.
    **options
        ``method``, ``extrapolation`` and others of :func:`orchestration.master.run`. Without
        ``feedthrough`` there are no imbalances: lengths and forces then belong to different points.

    Returns
    -------
    CouplingError

    Raises
    ------
    UserError
        If the stop time is no multiple of a step, the system cannot be fused, a member fails, or
        Ctrl-C was pressed.
    """
    graph = fuse(system)
    model = CompiledModel(graph)
    couplings = mechanical(system) if options.get("feedthrough", True) else []
    errors = []
    imbalances = []
    for step in steps:
        time = _communication_points(stop, step)
        input_values = {name: function(time) for name, function in inputs.items()}
        result = run(system, time, input_values, **options)
        if not result.complete:
            raise UserError(result.message)
        exact = model.run(time, input_values).signals
        errors.append(_relative_errors(result.signals, exact, time >= since))
        made = imbalance(couplings, result.signals, options.get("extrapolation", 0))
        imbalances.append({name: energy.relative for name, energy in made.items()})
    return CouplingError(
        np.array(steps), _by_name(errors), _by_name(imbalances), floor=10.0 * graph.tolerance
    )


def _relative_errors(
    signals: Mapping[str, Array], exact: Mapping[str, Array], compared: Mask
) -> dict[str, float]:
    """Return the largest error of each signal, relative to its largest magnitude, where compared.

    Parameters
    ----------
    signals, exact : Mapping of str to ndarray, shape (n,)
    compared : ndarray of bool, shape (n,)
    """
    errors = {}
    for name, values in signals.items():
        largest = np.abs(exact[name][compared]).max() or 1.0
        errors[name] = float(np.abs(values - exact[name])[compared].max() / largest)
    return errors


def _by_name(rows: Sequence[Mapping[str, float]]) -> dict[str, Array]:
    """Return the values of every name over the rows, all of which have the same names."""
    names = rows[0] if rows else ()
    return {name: np.array([row[name] for row in rows]) for name in names}


def _communication_points(stop: float, step: float) -> Array:
    count = round(stop / step)
    if abs(count * step - stop) > 1e-9 * step:
        raise UserError(f"stop time {stop:g} s is no multiple of the communication step {step:g} s")
    return np.linspace(0.0, stop, count + 1)


def mechanical(system: System) -> list[Mechanical]:
    """Find the mechanical couplings: connections of a length, m, with those of a force, N, back.

    Several between the same two members are paired in the order in which they are connected.
    """

    def between(unit: str) -> dict[tuple[str, str], list[Connection]]:
        """Return the connections in a unit, by source and target member."""
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


def _imbalance(coupling: Mechanical, signals: Mapping[str, Array], extrapolation: int) -> Imbalance:
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
