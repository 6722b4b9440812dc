"""Signals that a law may depend on: all that a simulation knows, and what is remembered of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.corrections import SignalTerm
from orchestration.discrepancy.laws.linear import Sides, SimulatedCourse, continuous
from orchestration.identify import autoregression

LAGS = 4  # time constants that are tried, from a few samples to a fraction of the record
_SHORTEST = 4.0  # samples
_LONGEST = 0.25  # of the record
_SAME = 1.0 - 1e-5  # correlation, above which a signal tells what another one tells
_STILL = 1e-9  # of its size, below which a signal does not move
_EVEN = 1e-9  # difference of decays, below which steps are the same


@dataclass(frozen=True)
class LawSignal:
    """A function of time that a law may depend on.

    Attributes
    ----------
    name : str
        Input, state or law; ``time``.
    memory : {"", "lagged", "leading", "heat", "integrated", "throughput"}
        What is remembered of it: behind a lag of first order, itself less that, its square behind a
        lag, which begins at zero, integrated, or integrated in modulus.
    constant : float
        Time constant of a lag, s.
    """

    name: str
    memory: str = ""
    constant: float = 0.0

    @property
    def label(self) -> str:
        """Name for people."""
        return SignalTerm(self.name, self.memory, self.constant).label


def current_signals(
    course: SimulatedCourse, values: Mapping[str, Sides], passed_over: Collection[str]
) -> dict[LawSignal, Sides]:
    """Return the signals that move: inputs, states, values of laws, and the time.

    Parameters
    ----------
    course : SimulatedCourse
        Of n samples.
    values : Mapping of str to Sides, of shape (n,)
        Of the laws, SI.
    passed_over : collection of str
        Laws among them, and states, that are left out.

    Returns
    -------
    dict of Signal to Sides, of shape (n,)
        SI; none that stands still or is no number somewhere.
    """
    laws = {name: sides for name, sides in values.items() if name not in passed_over}
    states = {name: sides for name, sides in course.states.items() if name not in passed_over}
    known = {**course.inputs, **states, **laws, "time": continuous(course.time)}
    return {LawSignal(name): sides for name, sides in known.items() if _moves(sides.begin)}


def is_new(sides: Sides, shapes: list[Array]) -> bool:
    """Return whether a signal moves, and other than in proportion to one before it.

    Parameters
    ----------
    sides : Sides, of shape (n,)
    shapes : list of ndarray, shape (n,)
        Those before, without mean and of unit length; if the signal is new, it is added.
    """
    values = sides.begin
    if not _moves(values):
        return False
    shape = values - values.mean()
    shape = shape / np.linalg.norm(shape)
    if any(abs(float(shape @ other)) > _SAME for other in shapes):
        return False
    shapes.append(shape)
    return True


def _moves(values: Array) -> bool:
    return bool(np.isfinite(values).all()) and float(np.ptp(values)) > _STILL * float(
        np.abs(values).max()
    )


def remembered_signals(
    course: SimulatedCourse, signals: Mapping[LawSignal, Sides], rates: Collection[str] = ()
) -> Iterator[tuple[LawSignal, Sides]]:
    """Yield signals remembered in all ways, lags with several time constants.

    Parameters
    ----------
    course : SimulatedCourse
        Of n samples.
    signals : Mapping of Signal to Sides, of shape (n,)
        SI; the time among them is passed over.
    rates : collection of str
        Signals among them that are rates of states, of which nothing is remembered: a lag of one is
        what its state is ahead of its own lag, and its integral the state.

    Yields
    ------
    tuple of Signal and Sides, of shape (n,)
        SI, integrals in the unit of the signal times s.
    """
    steps = np.diff(course.time)
    shortest = _SHORTEST * float(np.median(steps))
    longest = _LONGEST * float(course.time[-1] - course.time[0])
    constants = [float(constant) for constant in np.geomspace(shortest, longest, LAGS)]
    memories = [
        (memory, constant) for memory in ("lagged", "leading", "heat") for constant in constants
    ]
    for signal, sides in signals.items():
        if signal.name == "time" or signal.name in rates:
            continue
        for memory, constant in (*memories, ("integrated", 0.0), ("throughput", 0.0)):
            one = LawSignal(signal.name, memory, constant)
            yield one, _memory(one, sides, steps)


def signal_along(signal: LawSignal, course: SimulatedCourse, laws: Mapping[str, Sides]) -> Sides:
    """Return a signal over a run.

    Parameters
    ----------
    signal : LawSignal
    course : SimulatedCourse
        Of n samples.
    laws : Mapping of str to Sides, of shape (n,)
        Values of laws, SI; an input or a state of the same name goes before.

    Returns
    -------
    Sides, of shape (n,)
        SI.

    Raises
    ------
    KeyError
        If there is no such signal.
    """
    known = {"time": continuous(course.time), **laws, **course.states, **course.inputs}
    return _memory(signal, known[signal.name], np.diff(course.time))


def _memory(signal: LawSignal, sides: Sides, steps: Array) -> Sides:
    if signal.memory == "lagged":
        return lagged(sides, steps, signal.constant)
    if signal.memory == "leading":
        behind = lagged(sides, steps, signal.constant)
        return Sides(sides.begin - behind.begin, sides.end - behind.end)
    if signal.memory == "heat":
        return lagged(Sides(sides.begin**2, sides.end**2), steps, signal.constant, 0.0)
    if signal.memory == "integrated":
        return integrated(sides, steps)
    if signal.memory == "throughput":
        return integrated(Sides(np.abs(sides.begin), np.abs(sides.end)), steps)
    return sides


def lagged(sides: Sides, steps: Array, constant: float, start: float | None = None) -> Sides:
    """Return the first-order lag of a signal that is straight within each step.

    Parameters
    ----------
    sides : Sides, of shape (n,)
    steps : ndarray, shape (n - 1,)
        Seconds.
    constant : float
        Its time constant, s.
    start : float, optional
        Its value at the start; in equilibrium unless given.

    Returns
    -------
    Sides, of shape (n,)
        In the unit of the signal.
    """
    first = sides.begin[0] if start is None else start
    z = steps / constant
    decay = np.exp(-z)
    settled = -np.expm1(-z)
    late = 1.0 - settled / z  # weight of what the signal is at the end of a step
    drive = (settled - late) * sides.begin[:-1] + late * sides.end[:-1]
    if len(steps) and np.ptp(decay) < _EVEN:
        return continuous(autoregression([1.0, -decay[0]], np.append(first, drive)))
    values = np.empty(len(sides.begin))
    values[0] = first
    for k, (kept, more) in enumerate(zip(decay, drive, strict=True)):
        values[k + 1] = kept * values[k] + more
    return continuous(values)


def integrated(sides: Sides, steps: Array) -> Sides:
    """Return the integral from the start of a signal that is straight within each step.

    Parameters
    ----------
    sides : Sides, of shape (n,)
    steps : ndarray, shape (n - 1,)
        Seconds.

    Returns
    -------
    Sides, of shape (n,)
        In the unit of the signal times s.
    """
    return continuous(np.append(0.0, np.cumsum(0.5 * (sides.begin[:-1] + sides.end[:-1]) * steps)))
