"""Work loops that an actuator tracks: by its controllers, or by a planned current (thesis 6.2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fmus.kit import Component, registry
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from fmus.kit.record import CompiledModel
from orchestration import master
from orchestration.experiment import Experiment
from orchestration.experiment.preparation import prepare
from orchestration.experiment.subjects import open_subject
from orchestration.experiment.work_loop import TrackedLoop, WorkLoop
from orchestration.system import System, library

# parameters of the system `work_loop` that switch its controllers on, by mode
MODES: dict[str, Mapping[str, float]] = {
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
_WITHOUT_CREEP = {"b1": 1e18, "k2": 1e15}
# about the rest length of films that creep: what is learnt has no mean, the feedforward no creep
MODES["recentred"] = {
    **MODES["learning"],
    "learning.recentring": 1.0,
    **{f"feedforward.{name}": value for name, value in _WITHOUT_CREEP.items()},
}
LIMITS = {"charge": 2.5 / 1.5, "voltage": 1.0, "current": 1.3, "displacement": 7e-3}
"""Largest magnitudes in SI: of the estimated charge, voltage and current as the controllers limit
them by default, of the displacement as the films do (thesis table 2-1)."""
_FARTHEST = 1.5  # charges that are looked at, per limit
_CIRCUIT = ("R1", "R2", "C", "alpha")  # parameters that an actuator shares with its inverse
_POINTS = 40  # in a period: samples of a planned current, as many as of a learnt one
_CORRECTION = 0.8  # share of the error that a repetition removes on the nominal model
_SMOOTHING = (0.25, 0.5, 0.25)  # of errors, as in the learning controller
_REPETITIONS = 30  # simulations of a plan; with a lag of 1 s half of the error remains
_ROUNDING = 1e-9  # relative, of times that are multiples of others


def ellipse(
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
    return WorkLoop(force, force / stiffness + charge_amplitude * np.sin(angle), period)


def inputs(loop: WorkLoop, time: Array, sample_period: float) -> dict[str, Array]:
    """Return the inputs of the system ``work_loop`` at times in s.

    Parameters
    ----------
    loop : WorkLoop
    time : ndarray, shape (n,)
    sample_period : float
        Sample period of the feedforward, in s.
    """
    return {
        "force": loop.force_at(time),
        "reference": loop.length_at(time),
        "next_force": loop.force_at(time + sample_period),
        "next_reference": loop.length_at(time + sample_period),
    }


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
        inputs(loop, time, sample_period),
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


def endurance(
    model: type[Component],
    loop: WorkLoop,
    cycles: int = 3000,
    parameters: Mapping[str, float] | None = None,
    recentred: bool = False,
    limits: Mapping[str, float] = LIMITS,
) -> dict[str, float]:
    """Predict how many cycles of a loop each limit allows.

    At a length that is held the charge makes up for the creep, and its peak grows from cycle to
    cycle. About the rest length its mean is zero, and the length creeps to its limit. Elongation is
    taken at rest: what a lag of the strain needs is not in the figures, nor effects of the circuit.

    Parameters
    ----------
    model : type[Component]
        As for `planned_current`.
    loop : WorkLoop
    cycles : int
        Number of cycles that are looked at.
    parameters : Mapping of str to float, optional
        Parameters that differ from their default, SI.
    recentred : bool
        Whether the loop moves with the rest length, as in the mode of that name.
    limits : Mapping of str to float
        Largest magnitudes, as `LIMITS`.

    Returns
    -------
    dict of str to float
        Whole cycles before the one in which a limit is exceeded, by limit, the fewest first, which
        is the limit that binds; infinite if none is.

    Raises
    ------
    UserError
        If the model lacks a parameter of an actuator, or a limit or the number of cycles is not
        above zero.
    """
    _check_plan(model, cycles=cycles, **limits)
    time: Array = loop.period / _POINTS * np.arange(cycles * _POINTS, dtype=np.float64)
    load = {"force": loop.force_at(time)}
    bare = CompiledModel(model).run(time, load, parameters).signals["displacement"]
    length = loop.length_at(time)
    if recentred:
        by_cycle = np.reshape([time, bare - length], (2, cycles, _POINTS))
        length = length + np.interp(time, *by_cycle.mean(axis=2))
    nominal: Any = model(**(parameters or {}))
    charges = limits["charge"] * np.linspace(-_FARTHEST, _FARTHEST, 1001)
    elongations = np.array([nominal.charge_elongation(charge) for charge in charges])
    order = np.argsort(elongations)  # falling where alpha is negative
    charge = np.interp(length - bare, elongations[order], charges[order])
    rate = np.gradient(charge, time)
    voltage = nominal.R1 * rate + charge / nominal.C
    signals = {
        "charge": charge,
        "voltage": voltage,
        "current": rate + voltage / nominal.R2,
        "displacement": length,
    }
    allowed = {}
    for name, limit in limits.items():
        beyond = np.abs(signals[name]) > limit
        allowed[name] = int(np.argmax(beyond)) // _POINTS if beyond.any() else np.inf
    return dict(sorted(allowed.items(), key=lambda pair: pair[1]))


def forecast(experiment: Experiment, where: str) -> dict[str, dict[str, float]]:
    """Predict how many cycles of an experiment's work loop each limit allows, before it is run.

    Parameters
    ----------
    experiment : Experiment
        On a system, with the table of a work loop and without variants.
    where : str
        Its name, for messages.

    Returns
    -------
    dict of str to dict
        `endurance` at a length that is ``held``, and of a loop that is ``recentred``.

    Raises
    ------
    UserError
        If there is no work loop of a system, it does not fit the system, or the loop's member has
        no equations of an actuator.
    """
    table = experiment.work_loop
    if table is None or experiment.system is None:
        raise UserError(f"{where}: cycles are those of a system with a work loop")
    with open_subject(experiment, where) as subject:
        prepared = prepare(experiment, subject, where, lambda line: None)
    prefix, dot, _ = table.length.partition(".")
    model = library.system(experiment.system).member(prefix).cls
    if model is None:
        raise UserError(f"{where}: {prefix} has no equations that are known")
    parameters = {
        name.removeprefix(prefix + dot): float(value)
        for name, value in prepared.settings.items()
        if name.startswith(prefix + dot)
    }
    period = prepared.time < prepared.time[0] + table.period * (1.0 - _ROUNDING)
    force, length = (prepared.inputs[name][period] for name in (table.force, table.reference))
    loop = WorkLoop(force, length, table.period)
    return {
        way: endurance(model, loop, parameters=parameters, recentred=way == "recentred")
        for way in ("held", "recentred")
    }


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
