"""Linear models of components, FMUs and systems from Python: ``ppy.linearise``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from fmus.kit import Component
from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import UserError, find
from fmus.kit.extras import require
from orchestration.api.declaration import takes
from orchestration.api.forms import seconds
from orchestration.api.options import BandOptions, LineariseKeywords
from orchestration.api.simulation import Inputs, as_declared, inputs_over, values_of
from orchestration.api.sweeping import ranges_over
from orchestration.experiment.subjects import find_system, is_system, with_classes
from orchestration.experiment.system_model import system_model
from orchestration.fmu import Model, Value
from orchestration.fmu.signal import declared_signal, numeric, read_setting
from orchestration.fmu.simulation import source_of
from orchestration.linear import (
    Equations,
    ForeignSubject,
    LinearModel,
    LinearSubject,
    OperatingPoint,
    TrimRequest,
    point_at,
    subject_of,
    trim,
)
from orchestration.reporting import option
from orchestration.sweeps import design
from orchestration.sweeps.fitted import SweepFit, read_fitted
from orchestration.system import Member, System

LinearAt = Callable[[float, Mapping[str, Value]], LinearModel]  # of a time, s, and settings
_DRAWS = 50  # default number of models in a band


@takes(LineariseKeywords)
def linearise(
    model: System | Model | type[Component] | str | Path,
    stimulus: Inputs | None = None,
    **options: Unpack[LineariseKeywords],
) -> LinearModel:
    """Linearise a component, an FMU or a system about an operating point.

    Parameters
    ----------
    model : System, Model, type[Component], str or Path
        As in `simulate`; or a system, by its name or its file (``.ssp``, ``.ssd``).
    stimulus : Mapping of str to array_like, shape (n,), or callable of time, optional
        Inputs up to the operating point, at ``time`` if they vary; a number is constant.

    Returns
    -------
    LinearModel
        ``state_space`` (of `control`), ``poles()``, ``zeros()``, ``margins()``, ``response(f)``,
        ``plot("bode.png")``, ``to_mat("model.mat")``, with names, units and operating point. In
        continuous time, or with the common period of all samplers.

    Raises
    ------
    UserError
        If there is no such model or signal, no equilibrium, a component has no laws, or clocks have
        no common hyper-period.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> fast = ppy.linearise("ppy_actuator", inputs=["current"], outputs=["voltage"])
    >>> round(float(fast.poles()[0].real), 4)
    -0.1332
    >>> loop = ppy.linearise("dma_bench", {"force_reference": 1.0}, at=1.0,
    ...                      cut="bench.force_filtered")
    >>> round(loop.margins().phase, 1)
    70.2
    """
    require("control")
    if options["cut"] is not None and (options["inputs"] or options["outputs"]):
        raise UserError(f"{option('cut', options['cut'])} has its own input and output")
    subject = _subject(model)
    signals = _signals_of(subject) if isinstance(subject, Equations) else subject.model
    constants, points, driven = _split_inputs(signals, stimulus or {}, options)
    times = [seconds(time) for time in options["at"]] or [0.0]
    if driven and max(times) > points[-1]:
        raise UserError(
            f"{option('at', f'{max(times):g}')}: the inputs that vary end at {points[-1]:g} s"
        )
    if isinstance(subject, Equations):
        linear_at = _by_equations(subject, points, driven, options)
    else:
        linear_at = _by_interfaces(subject, points, driven, options)
    fit = fit_of(signals, options)
    given = values_of(signals, options["settings"], options["preset"]) | constants
    known = (fit.values if fit else {}) | given
    first, *further = (linear_at(time, known) for time in times)
    variations = tuple(
        replace(linear_at(times[0], {**known, **case}), case=case)
        for case in _band_cases(signals, fit, options)
    )
    return replace(first, further=tuple(further), variations=variations)


def _subject(model: Any) -> Equations | ForeignSubject:
    """Return equations, or the parts of what has a part without them."""
    if isinstance(model, str | Path) and is_system(str(model)):
        model = find_system(str(model))
    if isinstance(model, System):
        known = with_classes(model)
        if all(member.cls is not None for member in known.members):
            return subject_of(known)
        return ForeignSubject(system_model(known), known)
    declared = as_declared(model)
    if declared.cls is not None:
        return subject_of(declared.cls, declared.title)
    step = source_of(declared).default_experiment[2] or 1e-3
    alone = System(declared.name, (Member("", declared.path),), (), step=step)
    return ForeignSubject(declared, alone)


def _by_equations(
    subject: Equations, points: Array, driven: Signals, options: LineariseKeywords
) -> LinearAt:
    """Return the function that linearises equations about what is reached, or an equilibrium."""
    request = _trim_request(subject, options)
    step = _step(options)

    def linear_at(time: float, settings: Mapping[str, Value]) -> LinearModel:
        compiled = subject.compiled if time > points[0] else None
        point = point_at(subject.graph, time, numeric(settings), driven, points, compiled)
        if request is not None:
            point = trim(subject.graph, point, request)
        return _cut_or_whole(subject, point, options, step)

    return linear_at


def _by_interfaces(
    subject: ForeignSubject, points: Array, driven: Signals, options: LineariseKeywords
) -> LinearAt:
    """Return the function that linearises an FMU, or a system with one, about what is reached."""
    _refuse_equilibrium(subject, options)
    given = _step(options)
    step = given or subject.system.step
    asked = {*options["inputs"], *options["outputs"]}

    def linear_at(time: float, settings: Mapping[str, Value]) -> LinearModel:
        there = subject.at(time, settings, points, driven, asked, step)
        found = _cut_or_whole(there, there.point, options, step if there.is_held else given)
        notes = (*subject.model.notes, *found.notes, *there.remarks)
        if there.is_held and subject.system.connections:
            notes += (f"values are exchanged every {step:g} s, and act a step later (Jacobi)",)
        return replace(found, notes=notes)

    return linear_at


def _cut_or_whole(
    subject: LinearSubject, point: OperatingPoint, options: LineariseKeywords, step: float
) -> LinearModel:
    """Return the loop that is cut, or the model from inputs to outputs."""
    if options["cut"] is not None:
        return subject.loop(point, options["cut"], step)
    return subject.linearise(point, options["inputs"], options["outputs"], step)


def _refuse_equilibrium(subject: ForeignSubject, options: LineariseKeywords) -> None:
    """Raise UserError for options that need equations."""
    reason = subject.model.without_equations
    if subject.model.system is not None:
        names = [member.name for member in subject.system.members if member.cls is None]
        reason = f"{subject.model.name}: equations of {', '.join(names)} are not known"
    for name in ("trim", "fix", "free", "drift", "preset"):
        if options[name]:
            raise UserError(
                f"{reason}; {option(name, options[name])} needs the equations of a component: an"
                " FMU without them is linearised at a time"
            )


def _step(options: LineariseKeywords) -> float:
    """Return the communication step in s; 0 in continuous time."""
    if options["step"] is None:
        return 0.0
    step = seconds(options["step"])
    if not 0.0 < step < np.inf:
        raise UserError(f"{option('step', f'{step:g}')}: a time above 0 s")
    return step


def _signals_of(subject: Equations) -> Model:
    """Return a model with the variables of the equations, for settings with units."""
    layout = subject.graph.layout
    inputs, outputs, parameters = (
        {v.name: declared_signal(v) for v in group}
        for group in (layout.inputs, layout.measurable, layout.parameters)
    )
    return Model(subject.name, Path(), subject.cls, inputs, outputs, parameters)


def _split_inputs(
    model: Model, stimulus: Inputs, options: LineariseKeywords
) -> tuple[dict[str, float], Array, dict[str, Array]]:
    """Return constant inputs, the times of varying inputs, and these."""
    time = options["time"]
    points = np.zeros(1) if time is None else np.asarray(time, dtype=float)
    varying = {
        name: values for name, values in stimulus.items() if callable(values) or np.ndim(values)
    }
    if varying and time is None:
        raise UserError(f"{', '.join(varying)}: inputs that vary need {option('time')}")
    constant = {name: value for name, value in stimulus.items() if name not in varying}
    arrays = inputs_over(model, constant, np.zeros(1))  # checks names and shapes
    constants = {name: float(values[0]) for name, values in arrays.items()}
    return constants, points, inputs_over(model, varying, points)


def _trim_request(subject: Equations, options: LineariseKeywords) -> TrimRequest | None:
    """Return the conditions of an equilibrium; None if the operating point need not be one."""
    if not options["trim"]:
        for name in ("fix", "free", "drift"):
            if options[name]:
                raise UserError(f"{option(name)} is of an equilibrium: add {option('trim', True)}")
        return None
    signals = {v.name: declared_signal(v) for v in subject.graph.layout.variables}
    known = {alias: signals[name] for alias, name in subject.outputs.items()} | signals
    values = {}
    for name, value in (options["fix"] or {}).items():
        given = option("fix", {name: value})
        signal = find(name, known, f"{subject.name}: {given}: no signal")
        values[signal.name] = float(read_setting(str(value), signal, given))
    return TrimRequest(values, tuple(options["free"]), tuple(options["drift"]))


def fit_of(model: Model, options: BandOptions) -> SweepFit | None:
    """Return the fit from which parameters of a model are taken, if one is given."""
    path = options["fitted"]
    return None if path is None else read_fitted(Path(path), model)


def _band_cases(
    model: Model, fit: SweepFit | None, options: LineariseKeywords
) -> list[dict[str, float]]:
    """Return the values of parameters of each model of a band."""
    over = options["over"] or {}
    count = _DRAWS if options["samples"] is None else options["samples"]
    seed = options["seed"]
    if fit is not None:
        if over:
            raise UserError(f"{option('fitted')} and {option('over')}: one of the two")
        drawn = fit.draws(count, seed)
        rows = np.column_stack([*drawn.values()]).tolist()
        return [dict(zip(drawn, row, strict=True)) for row in rows]
    if not over:
        if options["samples"] is not None:
            raise UserError(
                f"{option('samples', count)}: nothing is drawn without {option('over')} or"
                f" {option('fitted')}"
            )
        return []
    ranges = ranges_over(over, model)
    counted = [one.name for one in ranges if one.counted]
    if counted and len(counted) < len(ranges):
        raise UserError(
            f"{option('over')}: {', '.join(counted)} has its values, and others are drawn: write"
            " all with a count, as in 4e3..8e3:5, or none"
        )
    chosen = design(ranges) if counted else design(ranges, "latin-hypercube", count, seed)
    return [dict(zip(chosen.names, row.tolist(), strict=True)) for row in chosen.cases]
