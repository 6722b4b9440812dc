"""Work loops: load and length of an actuator over a gait, and what tracks them (thesis 5.4, 6.2).

A work loop is the closed path of force over length. Its area is the energy that the actuator takes
up in a cycle, and gives where it is negative (section 5.1).
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

# what is switched on, by mode, in the system `work_loop`
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
_POINTS = 40  # in a period, at which a planned current changes, as often as a learnt one
_CORRECTION = 0.8  # share of the error that a repetition takes off a plan on the nominal model
_SMOOTHING = (0.25, 0.5, 0.25)  # of errors, as learning has it
_REPETITIONS = 30  # simulations of a plan; half of an error is left where strain lags by a second


@dataclass(frozen=True)
class WorkLoop:
    """A reference loop, as force and length over the phase of a cycle.

    Attributes
    ----------
    force, length : ndarray, shape (n,)
        In N and m, at phases k / n; in between they go straight on, and round after the last.
    period : float
        In s.

    Raises
    ------
    UserError
        If force and length do not have a finite value each at every phase, or there is no period.
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
            Of the spring, in N/m; that of the nominal actuator, unless given.
        charge_amplitude : float
            In m, of the length beside that of the spring, a sine. The loop takes up the energy
            ``pi force_amplitude charge_amplitude``; below zero it gives it.
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
            Of the feedforward, in s.
        """
        return {
            "force": self.force_at(time),
            "reference": self.length_at(time),
            "next_force": self.force_at(time + sample_period),
            "next_reference": self.length_at(time + sample_period),
        }


@dataclass(frozen=True)
class Cycle:
    """Error, energies and largest values of a cycle.

    Attributes
    ----------
    error : float
        Root mean square of reference less length, in m.
    work : float
        Area of the loop, the integral of force over length, in J: energy that the actuator takes up
        from the load.
    electrical_energy : float
        Integral of voltage times current over the cycle, in J.
    largest_current, largest_voltage : float
        In A and V, magnitudes.
    """

    error: float
    work: float
    electrical_energy: float
    largest_current: float
    largest_voltage: float


@dataclass(frozen=True)
class TrackedLoop:
    """A loop as it was tracked.

    Attributes
    ----------
    loop : WorkLoop
        The reference.
    time : ndarray, shape (n,)
        In s, evenly, over whole cycles.
    length, current, voltage : ndarray, shape (n,)
        In m, A and V.
    """

    loop: WorkLoop
    time: Array
    length: Array
    current: Array
    voltage: Array

    def cycles(self) -> list[Cycle]:
        """Return each cycle's figures."""
        count = int(self.time[-1] / self.loop.period + 1e-9)
        marks = np.arange(count + 1) * self.loop.period
        edges = np.searchsorted(self.time, marks - 1e-9 * self.loop.period)
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
    """Run the system ``work_loop``, or one with other members by the same names, round a loop.

    Parameters
    ----------
    system : System
        Its member ``actuator`` is what is to go round.
    loop : WorkLoop
        The sample period of feedforward and learning becomes a fortieth of its period.
    mode : {"bare", "feedback", "feedforward", "both", "learning", "all"}
        What is switched on: nothing; one of them, or both; feedforward and learning; all three.
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
    step = sample_period / np.ceil(sample_period / system.step - 1e-9)
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
    """Return the current by which a model goes round a loop: the feedforward of any actuator.

    The inverse of a model with effects has no closed form. Here the errors of a simulation go
    through the inverse of the model without effects, again and again: Newton's method with that
    model's derivative. Where a limit holds, the loop is not reached.

    Parameters
    ----------
    model : type[Component]
        A force-driven actuator, such as the `model` of a diagnosis.
    loop : WorkLoop
    cycles : int
    parameters : Mapping of str to float, optional
        Those that are not at their default, SI; also starting states, as ``charge_start``.
    current_limit : float
        In A.
    voltage_limit : float
        In V, of the circuit without effects, at any time and in either direction (section 1.4.2).

    Returns
    -------
    time, current : ndarray, shape (n,)
        In s and A, a fortieth of a period apart; each is held to the next.

    Raises
    ------
    UserError
        If the model is no actuator by its parameters, or a limit or the number of cycles is not
        above zero.
    """
    _check_plan(model, cycles=cycles, current_limit=current_limit, voltage_limit=voltage_limit)
    start = dict(parameters or {})
    period = loop.period / _POINTS
    # a cycle more than is wanted, as errors are smoothed over an end that has no error behind it
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
        error = _smoothed(reference - run.signals["displacement"])
        inverse.charge = start.get("charge_start", 0.0)
        current = _corrected(current, _CORRECTION * error, inverse)
    wanted = slice(cycles * _POINTS + 1)
    return time[wanted], current[wanted]


def _check_plan(model: type[Component], **positive: float) -> None:
    """Refuse a model without the circuit of an actuator, and values that are not above zero."""
    for name, value in positive.items():
        if not value > 0:
            raise UserError(f"{name} = {value:g}: must be above 0")
    lacking = {*_CIRCUIT} - {one.name for one in model.layout.parameters}
    if lacking:
        raise UserError(
            f"{model.name}: no actuator, as it has no parameter {', '.join(sorted(lacking))}"
        )


def _smoothed(error: Array) -> Array:
    """Smooth an error (n,): a strain that lags answers high frequencies with the opposite sign."""
    return np.convolve(np.pad(error, 1, mode="edge"), _SMOOTHING, mode="valid")


def _corrected(current: Array, change: Array, inverse: Any) -> Array:
    """Return the current by which the length of a model changes, within the limits of its inverse.

    Parameters
    ----------
    current : ndarray, shape (n,)
        In A, held from each time to the next.
    change : ndarray, shape (n,)
        Wanted of the length, in m.
    inverse : Component
        A ``feedforward`` with the charge at the start; its charge follows the corrected current.
    """
    decay, gained = inverse.decay(), inverse.charge_per_current()
    corrected = current.copy()
    changed = 0.0  # m, of the length so far
    for k in range(current.size - 1):
        needed = current[k] + (change[k + 1] - decay * changed) / (inverse.alpha * gained)
        corrected[k] = inverse.limited_current(needed)
        changed = decay * changed + inverse.alpha * gained * (corrected[k] - current[k])
        inverse.charge = decay * inverse.charge + gained * corrected[k]
    return corrected


def tracked_loops(data: xarray.Dataset, table: WorkLoopTable) -> dict[str, TrackedLoop]:
    """Return the loops of an experiment's result, by variant.

    Parameters
    ----------
    data : Dataset
        Of an experiment.
    table : WorkLoopTable
        Which of its signals are those of the loop. Force and reference are inputs of one period;
        the reference is taken from the first.
    """
    time = data.time.values
    count = round(table.period / data.attrs["step"])
    phases = table.period * np.arange(count) / count
    force, reference = (
        np.interp(phases, time, _of_loop(data, table, key)) for key in ("force", "reference")
    )
    loop = WorkLoop(force, reference, table.period)
    variants = {
        v.attrs["variant"]: f"{v.attrs['variant']}." for v in data.values() if "variant" in v.attrs
    }
    keys = ("length", "current", "voltage")
    return {
        variant: TrackedLoop(loop, time, *(_of_loop(data, table, key, before) for key in keys))
        for variant, before in (variants or {"run": ""}).items()
    }


def _of_loop(data: xarray.Dataset, table: WorkLoopTable, key: str, before: str = "") -> Array:
    """Return the signal of a key of the table, by the prefix of a variant, in SI."""
    array = data[before + getattr(table, key)]
    values: Array = convert(array.values, array.units, UNITS_OF_LOOP[key])
    return values


def figures(loops: Mapping[str, TrackedLoop]) -> dict[str, Any]:
    """Return the figures of every cycle by mode, for JSON: SI, as `Cycle` has them."""
    return {mode: [asdict(cycle) for cycle in loop.cycles()] for mode, loop in loops.items()}


def picture(
    loops: Mapping[str, TrackedLoop],
    title: str = "Work loops: the last cycle, and figures of each",
) -> Figure:
    """Draw loops of the last cycle beside that of fig. 5-9, and error, work and energy of cycles.

    Parameters
    ----------
    loops : Mapping of str to TrackedLoop
        By mode, of one reference.
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
    """Draw the experiment of fig. 5-9 with its current and without, as it is printed."""
    for name, settings in {"with current": [], "without": ["inputs.current.amplitude=0"]}.items():
        path = execution.run(read("fig_5_9", settings))
        force = path["tension"].values
        axis.plot(1e3 * path["length_change"].values, force, label=f"fig. 5-9, {name}")
    axis.set_xlabel("length change [mm]")
    axis.legend(fontsize=8)
    pictures.label(axis, "tension", "N")


def _draw_cycles(axes: Sequence[Any], cycles: Sequence[Cycle]) -> None:
    """Draw error, work and electrical energy of a mode over the number of the cycle."""
    numbers = np.arange(1, len(cycles) + 1)
    axes[0].plot(numbers, [1e6 * cycle.error for cycle in cycles], "o-")
    axes[1].plot(numbers, [1e6 * cycle.work for cycle in cycles], "o-")
    axes[2].plot(numbers, [cycle.electrical_energy for cycle in cycles], "o-")
    for axis in axes:
        axis.set_xlabel("cycle")
        pictures.whole_numbers(axis)
