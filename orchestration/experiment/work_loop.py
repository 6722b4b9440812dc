"""Work loops: periodic load and length of an actuator, and their tracking (thesis 5.4, 6.2).

A work loop is the closed path of force over length. Its area is the energy that the actuator
absorbs in a cycle; a negative area is energy that it delivers (section 5.1).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import Component, registry
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from fmus.kit.record import CompiledModel
from fmus.kit.units import convert
from orchestration import master
from orchestration.experiment import execution
from orchestration.experiment.model import UNITS_OF_LOOP
from orchestration.experiment.reading import read
from orchestration.reporting import pictures

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orchestration.experiment.model import WorkLoopTable
    from orchestration.system import System

# parameters of the system `work_loop` that switch its controllers on, by mode
MODES: Mapping[str, Mapping[str, float]] = {
    mode: {
        "feedforward.active": float("feedforward" in parts),
        "learning.learning": float("learning" in parts),
        "feedback.hold": float("feedback" not in parts),
    }
    for mode, parts in {
        "bare": (),
        "feedback": ("feedback",),
        "feedforward": ("feedforward",),
        "both": ("feedback", "feedforward"),
        "learning": ("feedforward", "learning"),
        "all": ("feedback", "feedforward", "learning"),
    }.items()
}
_CIRCUIT = ("R1", "R2", "C", "alpha")  # parameters that an actuator shares with its inverse
_POINTS = 40  # in a period: samples of a planned current, as many as of a learnt one
_CORRECTION = 0.8  # share of the error that a repetition removes on the nominal model
_SMOOTHING = (0.25, 0.5, 0.25)  # of errors, as in the learning controller
_REPETITIONS = 30  # simulations of a plan; with a lag of 1 s half of the error remains
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

    @classmethod
    def ellipse(
        cls,
        mean_force: float = 0.5,
        force_amplitude: float = 0.4,
        stiffness: float = 6300.0,
        charge_amplitude: float = -7e-5,
        period: float = 10.0,
    ) -> WorkLoop:
        """Return a loop about the line of a spring, with sines as in eqs. 5.13 and 5.17.

        Parameters
        ----------
        mean_force, force_amplitude : float
            In N; the force is ``mean + amplitude cos(2 pi phase)``.
        stiffness : float
            Of the spring, in N/m; by default that of the nominal actuator.
        charge_amplitude : float
            In m, of the sine that is added to the length of the spring. The actuator absorbs the
            energy ``pi force_amplitude charge_amplitude``; it delivers it where that is negative.
        period : float
            In s.
        """
        angle = 2.0 * np.pi * np.arange(1000) / 1000
        force = mean_force + force_amplitude * np.cos(angle)
        return cls(force, force / stiffness + charge_amplitude * np.sin(angle), period)

    def force_at(self, time: Array) -> Array:
        """Return the force in N at times in s."""
        return self._at(time, self.force)

    def length_at(self, time: Array) -> Array:
        """Return the length in m at times in s."""
        return self._at(time, self.length)

    def _at(self, time: Array, values: Array) -> Array:
        phases = np.arange(values.size) / values.size
        return np.interp(np.mod(time / self.period, 1.0), phases, values, period=1.0)

    def inputs(self, time: Array, sample_period: float) -> dict[str, Array]:
        """Return the inputs of the system ``work_loop`` at times in s.

        Parameters
        ----------
        time : ndarray, shape (n,)
        sample_period : float
            Sample period of the feedforward, in s.
        """
        return {
            "force": self.force_at(time),
            "reference": self.length_at(time),
            "next_force": self.force_at(time + sample_period),
            "next_reference": self.length_at(time + sample_period),
        }


@dataclass(frozen=True)
class Cycle:
    """Tracking error, energies and largest values of a cycle.

    Attributes
    ----------
    error : float
        Root mean square of the reference minus the length, in m.
    work : float
        Area of the loop, the integral of force over length, in J: energy that the actuator absorbs
        from the load.
    electrical_energy : float
        Integral of voltage times current over the cycle, in J.
    largest_current, largest_voltage : float
        Largest magnitudes, in A and V.
    """

    error: float
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
            work=float(np.trapezoid(self.loop.force_at(time), length)),
            electrical_energy=float(np.trapezoid(voltage * current, time)),
            largest_current=float(np.abs(current).max()),
            largest_voltage=float(np.abs(voltage).max()),
        )


def track(system: System, loop: WorkLoop, mode: str = "learning", cycles: int = 5) -> TrackedLoop:
    """Simulate the system ``work_loop``, or one with members of the same names, on a loop.

    Parameters
    ----------
    system : System
        Its member ``actuator`` tracks the loop.
    loop : WorkLoop
        The sample period of feedforward and learning becomes a fortieth of its period.
    mode : {"bare", "feedback", "feedforward", "both", "learning", "all"}
        Active controllers: none; feedback; feedforward; both of them; feedforward and learning;
        all three.
    cycles : int

    Raises
    ------
    UserError
        If there is no such mode, or an FMU fails.
    """
    if mode not in MODES:
        raise UserError(f"no mode named {mode!r}{suggestion(mode, MODES)}")
    sample_period = loop.period / _POINTS
    periods = {f"{name}.sample_period": sample_period for name in ("feedforward", "learning")}
    # controllers sample at communication points: the step divides their period
    step = sample_period / np.ceil(sample_period / system.step - _ROUNDING)
    time = step * np.arange(round(cycles * loop.period / step) + 1)
    run = master.run(
        system.given({**MODES[mode], **periods}),
        time,
        loop.inputs(time, sample_period),
        record=["actuator.displacement", "galvanostat.current", "actuator.voltage"],
    )
    return TrackedLoop(loop, time, *run.signals.values())


def planned_current(
    model: type[Component],
    loop: WorkLoop,
    cycles: int = 5,
    parameters: Mapping[str, float] | None = None,
    current_limit: float = 1.3,
    voltage_limit: float = 1.0,
) -> tuple[Array, Array]:
    """Compute the current with which a model follows a loop: a feedforward for any actuator.

    The inverse of a model with effects has no closed form. The error of a simulation is therefore
    corrected by the inverse of the model without effects, repeatedly: Newton's method with the
    derivative of the nominal model. Where a limit is active, the loop is not reached.

    Parameters
    ----------
    model : type[Component]
        A force-driven actuator, such as the `model` of a diagnosis.
    loop : WorkLoop
    cycles : int
    parameters : Mapping of str to float, optional
        Parameters that differ from their default, SI; also start values, such as ``charge_start``.
    current_limit : float
        In A.
    voltage_limit : float
        In V, of the circuit without effects, at any time and in either direction (section 1.4.2).

    Returns
    -------
    time, current : ndarray, shape (n,)
        In s and A, a fortieth of a period apart; the current is constant between them.

    Raises
    ------
    UserError
        If the model lacks a parameter of an actuator, or a limit or the number of cycles is not
        above zero.
    """
    _check_plan(model, cycles=cycles, current_limit=current_limit, voltage_limit=voltage_limit)
    start = dict(parameters or {})
    period = loop.period / _POINTS
    # one more cycle, as smoothing is wrong at the last point
    time: Array = period * np.arange((cycles + 1) * _POINTS + 1, dtype=np.float64)
    force, reference = loop.force_at(time), loop.length_at(time)
    compiled = CompiledModel(model)
    nominal: Any = model(**start)
    inverse: Any = registry.component("feedforward")(
        **{name: getattr(nominal, name) for name in _CIRCUIT},
        sample_period=period,
        current_limit=current_limit,
        voltage_limit=voltage_limit,
    )
    current = np.zeros(time.size)
    for _ in range(_REPETITIONS):
        run = compiled.run(time, {"current": current, "force": force}, start)
        error = _smooth(reference - run.signals["displacement"])
        inverse.charge = start.get("charge_start", 0.0)
        current = _correct(current, _CORRECTION * error, inverse)
    whole = slice(cycles * _POINTS + 1)
    return time[whole], current[whole]


def _check_plan(model: type[Component], **positive: float) -> None:
    """Raise UserError for a model without an actuator's circuit, and for values not above zero."""
    for name, value in positive.items():
        if not value > 0:
            raise UserError(f"{name} = {value:g}: must be above 0")
    lacking = {*_CIRCUIT} - {one.name for one in model.layout.parameters}
    if lacking:
        raise UserError(
            f"{model.name}: no actuator, as it has no parameter {', '.join(sorted(lacking))}"
        )


def _smooth(error: Array) -> Array:
    """Smooth an error (n,), as a strain with a lag has the opposite phase at high frequencies."""
    return np.convolve(np.pad(error, 1, mode="edge"), _SMOOTHING, mode="valid")


def _correct(current: Array, change: Array, inverse: Any) -> Array:
    """Return the current that changes the length of a model, within the limits of its inverse.

    Parameters
    ----------
    current : ndarray, shape (n,)
        Current before the correction in A, constant from each time to the next.
    change : ndarray, shape (n,)
        Change of the length, in m.
    inverse : Component
        A ``feedforward`` with the charge at the start; its charge follows the corrected current.
    """
    # the charge after a sample period is q' = decay q + gain i, and the length is alpha q
    decay, gain = inverse.decay(), inverse.charge_per_current()
    corrected = current.copy()
    change_so_far = 0.0  # m
    for k in range(current.size - 1):
        demand = current[k] + (change[k + 1] - decay * change_so_far) / (inverse.alpha * gain)
        corrected[k] = inverse.limited_current(demand)
        change_so_far = decay * change_so_far + inverse.alpha * gain * (corrected[k] - current[k])
        inverse.charge = decay * inverse.charge + gain * corrected[k]
    return corrected


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


def _signal_of(data: xarray.Dataset, table: WorkLoopTable, key: str, prefix: str = "") -> Array:
    """Return the signal of a key of the table in SI; `prefix` is that of a variant."""
    array = data[prefix + getattr(table, key)]
    values: Array = convert(array.values, array.units, UNITS_OF_LOOP[key])
    return values


def figures(loops: Mapping[str, TrackedLoop]) -> dict[str, Any]:
    """Return the fields of `Cycle` of every cycle, by mode, for JSON."""
    return {mode: [asdict(cycle) for cycle in loop.cycles()] for mode, loop in loops.items()}


def picture(
    loops: Mapping[str, TrackedLoop],
    title: str = "Work loops: the last cycle, and figures of each",
) -> Figure:
    """Draw the last cycle of loops, the loop of fig. 5-9, and error, work and energy of all cycles.

    Parameters
    ----------
    loops : Mapping of str to TrackedLoop
        By mode, with the same reference.
    title : str, optional
    """
    figure, axes = pictures.mosaic(
        [["loop", "thesis"], ["loop", "thesis"], ["error", "energy"], ["work", "energy"]], title
    )
    _draw_thesis_loop(axes["thesis"])
    reference = next(iter(loops.values())).loop
    closed = np.append(np.arange(reference.length.size), 0)
    axes["loop"].plot(
        1e3 * reference.length[closed], reference.force[closed], "k--", label="reference"
    )
    for mode, tracked in loops.items():
        last = tracked.time >= tracked.time[-1] - tracked.loop.period
        force = tracked.loop.force_at(tracked.time[last])
        axes["loop"].plot(1e3 * tracked.length[last], force, label=pictures.plain(mode))
        _draw_cycles([axes[name] for name in ("error", "work", "energy")], tracked.cycles())
    axes["loop"].set_xlabel("length [mm]")
    axes["loop"].legend(fontsize=8)
    pictures.logarithmic_values(axes["error"])
    pictures.label(axes["loop"], "force", "N")
    pictures.label(axes["error"], "error, rms", "um")
    pictures.label(axes["work"], "work taken up", "uJ")
    pictures.label(axes["energy"], "electrical energy", "J")
    return figure


def _draw_thesis_loop(axis: Axes) -> None:
    """Draw the experiment of fig. 5-9 with and without its current, as it is printed."""
    for name, settings in {"with current": [], "without": ["inputs.current.amplitude=0"]}.items():
        result = execution.run(read("fig_5_9", settings))
        force = result["tension"].values
        axis.plot(1e3 * result["length_change"].values, force, label=f"fig. 5-9, {name}")
    axis.set_xlabel("length change [mm]")
    axis.legend(fontsize=8)
    pictures.label(axis, "tension", "N")


def _draw_cycles(axes: Sequence[Any], cycles: Sequence[Cycle]) -> None:
    """Draw error, work and electrical energy of a mode over the cycles."""
    numbers = np.arange(1, len(cycles) + 1)
    axes[0].plot(numbers, [1e6 * cycle.error for cycle in cycles], "o-")
    axes[1].plot(numbers, [1e6 * cycle.work for cycle in cycles], "o-")
    axes[2].plot(numbers, [cycle.electrical_energy for cycle in cycles], "o-")
    for axis in axes:
        axis.set_xlabel("cycle")
        pictures.whole_numbers(axis)
