"""Work loops: periodic load and length of an actuator (thesis 5.4).

A work loop is the closed path of force over length. Its area is the energy that the actuator
absorbs in a cycle; a negative area is energy that it delivers (section 5.1).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError
from fmus.kit.units import convert
from orchestration.experiment.model import UNITS_OF_LOOP

if TYPE_CHECKING:
    import xarray

    from orchestration.experiment.model import WorkLoopTable

_ROUNDING = 1e-9  # relative, of times that are multiples of others


@dataclass(frozen=True)
class WorkLoop:
    """A reference loop: force and length over the phase of a cycle.

    Attributes
    ----------
    force, length : ndarray, shape (n,)
        In N and m, at phases k / n; linearly interpolated in between, and periodic.
    period : float
        In s.

    Raises
    ------
    UserError
        If force and length differ in shape, have no or not finite values, or the period is not
        above zero and finite.
    """

    force: Array
    length: Array
    period: float = 10.0

    def __post_init__(self) -> None:
        if np.shape(self.force) != np.shape(self.length) or np.ndim(self.force) != 1:
            raise UserError(
                f"force has the shape {np.shape(self.force)}, length {np.shape(self.length)}:"
                " a value of each at every phase is needed"
            )
        if not np.size(self.force) or not np.isfinite([self.force, self.length]).all():
            raise UserError("force and length: finite values are needed, and one at least")
        if not 0.0 < self.period < np.inf:
            raise UserError(f"period = {self.period:g} s: must be above 0, and finite")
        for name in ("force", "length"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=float))

    def force_at(self, time: Array) -> Array:
        """Return the force in N at times in s."""
        return self._at(time, self.force)

    def length_at(self, time: Array) -> Array:
        """Return the length in m at times in s."""
        return self._at(time, self.length)

    def _at(self, time: Array, values: Array) -> Array:
        phases = np.arange(values.size) / values.size
        return np.interp(np.mod(time / self.period, 1.0), phases, values, period=1.0)


@dataclass(frozen=True)
class Cycle:
    """Tracking error, energies and largest values of a cycle.

    Attributes
    ----------
    error, error_about_rest : float
        Root mean square of the reference minus the length, in m, and of that without its mean over
        the cycle: about the rest length of films that creep.
    work : float
        Area of the loop, the integral of force over length, in J: energy that the actuator absorbs
        from the load.
    electrical_energy : float
        Integral of voltage times current over the cycle, in J.
    largest_current, largest_voltage : float
        Largest magnitudes, in A and V.
    """

    error: float
    error_about_rest: float
    work: float
    electrical_energy: float
    largest_current: float
    largest_voltage: float


@dataclass(frozen=True)
class TrackedLoop:
    """Length, current and voltage of an actuator that tracks a work loop.

    Attributes
    ----------
    loop : WorkLoop
        The reference.
    time : ndarray, shape (n,)
        In s, equally spaced, over whole cycles.
    length, current, voltage : ndarray, shape (n,)
        In m, A and V.
    """

    loop: WorkLoop
    time: Array
    length: Array
    current: Array
    voltage: Array

    def cycles(self) -> list[Cycle]:
        """Return the figures of each whole cycle."""
        count = int(self.time[-1] / self.loop.period + _ROUNDING)
        starts = np.arange(count + 1) * self.loop.period
        edges = np.searchsorted(self.time, starts - _ROUNDING * self.loop.period)
        return [self._cycle(slice(begin, end + 1)) for begin, end in itertools.pairwise(edges)]

    def _cycle(self, part: slice) -> Cycle:
        time, length = self.time[part], self.length[part]
        current, voltage = self.current[part], self.voltage[part]
        error = self.loop.length_at(time) - length
        return Cycle(
            error=float(np.sqrt(np.mean(error**2))),
            error_about_rest=float(np.std(error)),
            work=float(np.trapezoid(self.loop.force_at(time), length)),
            electrical_energy=float(np.trapezoid(voltage * current, time)),
            largest_current=float(np.abs(current).max()),
            largest_voltage=float(np.abs(voltage).max()),
        )


def tracked_loops(data: xarray.Dataset, table: WorkLoopTable) -> dict[str, TrackedLoop]:
    """Return the work loops of an experiment's result, by variant.

    Parameters
    ----------
    data : Dataset
        Result of an experiment.
    table : WorkLoopTable
        Period and signals of the loop. Force and reference of the first period are the reference
        loop.
    """
    time = data.time.values
    count = round(table.period / data.attrs["step"])
    phases = table.period * np.arange(count) / count
    force, reference = (
        np.interp(phases, time, _signal_of(data, table, key)) for key in ("force", "reference")
    )
    loop = WorkLoop(force, reference, table.period)
    variants = [v.attrs["variant"] for v in data.values() if "variant" in v.attrs]
    prefixes = {variant: f"{variant}." for variant in variants} or {"run": ""}
    loops = {}
    for variant, prefix in prefixes.items():
        signals = [_signal_of(data, table, key, prefix) for key in ("length", "current", "voltage")]
        loops[variant] = TrackedLoop(loop, time, *signals)
    return loops


def works_of_charge(
    data: xarray.Dataset, table: WorkLoopTable, reaction: float
) -> tuple[float, float]:
    """Return the work of the charge on the load in the last cycle, and what the current pays, J.

    The charge Q lengthens the films by x under the load F, which does the work ``-F dx`` on it. A
    voltage ``reaction F`` takes ``reaction F dQ`` from the current.

    Parameters
    ----------
    data : Dataset
        Result of a run.
    table : WorkLoopTable
        With a coupling.
    reaction : float
        In V/N; zero for a one-way coupling.
    """
    last = data.isel(time=data.time.values >= data.time.values[-1] - table.period)
    force, length, charge = (
        _signal_of(last, table, key) for key in ("force", "charge_length", "charge")
    )
    return -float(np.trapezoid(force, length)), reaction * float(np.trapezoid(force, charge))


def overtaken(loops: Mapping[str, TrackedLoop]) -> Iterator[str]:
    """Yield a line for each mode whose error was the smallest of all and is no longer.

    It names the modes with a smaller one, and the cycle from which on it is smaller.
    """
    modes = list(loops)
    cycles = [loop.cycles() for loop in loops.values()]
    for field, title in (("error", "error"), ("error_about_rest", "error about the rest length")):
        errors = np.array([[getattr(cycle, field) for cycle in of_mode] for of_mode in cycles])
        for mode in np.unique(errors.argmin(axis=0)):
            better = errors < errors[mode]
            passing = [
                f"of {modes[other]} from cycle {np.flatnonzero(~better[other])[-1] + 2} on"
                for other in np.flatnonzero(better[:, -1])
            ]
            if passing:
                yield f"{modes[mode]}: {title} no longer smaller than that {', '.join(passing)}"


def _signal_of(data: xarray.Dataset, table: WorkLoopTable, key: str, prefix: str = "") -> Array:
    """Return the signal of a key of the table in SI; `prefix` is that of a variant."""
    array = data[prefix + table.signals[key]]
    values: Array = convert(array.values, array.units, UNITS_OF_LOOP[key])
    return values


def figures(loops: Mapping[str, TrackedLoop]) -> dict[str, Any]:
    """Return the fields of `Cycle` of every cycle, by mode, for JSON."""
    return {mode: [asdict(cycle) for cycle in loop.cycles()] for mode, loop in loops.items()}
