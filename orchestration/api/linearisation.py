"""Linear models of components, FMUs and systems from Python: ``ppy.linearise``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from fmus.kit import Component
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, suggestion
from fmus.kit.extras import require
from fmus.kit.storage import scratch
from orchestration.api.declaration import takes
from orchestration.api.forms import optional_seconds, seconds
from orchestration.api.options import LineariseKeywords
from orchestration.api.simulation import Inputs, as_declared, inputs_over, values_of
from orchestration.api.sweeping import ranges_over
from orchestration.experiment.subjects import with_classes
from orchestration.experiment.system_model import system_model
from orchestration.fmu import Model, Value
from orchestration.fmu.signal import declared_signal, numeric, read_setting
from orchestration.fmu.simulation import source_of
from orchestration.linear import (
    Equations,
    ForeignSubject,
    LinearModel,
    OperatingPoint,
    TrimRequest,
    point_at,
    subject_of,
    trim,
)
from orchestration.reporting import option
from orchestration.sweeps import design
from orchestration.sweeps.fitted import read_fitted
from orchestration.system import NAMES, Member, System, library, ssp

_ENDINGS = ssp.ENDINGS
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
    with _subject(model) as subject:
        if isinstance(subject, ForeignSubject):
            return _linearise_without_equations(subject, stimulus or {}, options)
        return _linearise_equations(subject, stimulus or {}, options)


@contextmanager
def _subject(model: Any) -> Iterator[Equations | ForeignSubject]:
    """Yield equations, or what has a part without them; unpack an archive for it."""
    if isinstance(model, str | Path) and Path(model).suffix.lower() in _ENDINGS:
        with scratch.folder("ssp") as folder:
            yield _system_subject(ssp.read(Path(model), folder))
        return
    name = str(model) if isinstance(model, Path) else model
    if isinstance(name, str) and name in NAMES:
        name = library.system(name)
    if isinstance(name, System):
        yield _system_subject(name)
        return
    declared = as_declared(name)
    if declared.cls is None:
        step = source_of(declared).default_experiment[2] or 1e-3
        yield ForeignSubject(
            declared, System(declared.name, (Member("", declared.path),), (), step=step)
        )
    else:
        yield subject_of(declared.cls, declared.title)


def _system_subject(system: System) -> Equations | ForeignSubject:
    """Return the equations of a system, or its parts where laws of a member are not known."""
    known = with_classes(system)
    if all(member.cls is not None for member in known.members):
        return subject_of(known)
    return ForeignSubject(system_model(known), known)


# --- equations -----------------------------------------------------------------------------------


def _linearise_equations(
    subject: Equations, stimulus: Inputs, options: LineariseKeywords
) -> LinearModel:
    """Linearise equations about equilibria, or about what is reached in time."""
    model = _signals_of(subject)
    settings = values_of(model, options["settings"], options["preset"])
    constants, driven, points = _split_inputs(model, stimulus, options)
    known = numeric(settings) | constants
    step = _step(options) or 0.0
    begin = 0.0 if points is None else points[0]
    request = _trim_request(subject, model, options)

    def linear_at(time: float, changed: Mapping[str, float]) -> LinearModel:
        compiled = subject.compiled if time > begin else None
        reached: OperatingPoint = point_at(
            subject.graph, time, {**known, **changed}, driven, points, compiled
        )
        point = reached if request is None else trim(subject.graph, reached, request)
        if options["cut"] is not None:
            return subject.loop(point, options["cut"], step)
        return subject.linearise(point, options["inputs"], options["outputs"], step)

    return _at_all_points(linear_at, model, known, points if driven else None, options)


def _at_all_points(
    linear_at: Callable[[float, Mapping[str, float]], LinearModel],
    model: Model,
    known: Mapping[str, Value],
    points: Array | None,
    options: LineariseKeywords,
) -> LinearModel:
    """Return the models at every point in time, and variations of parameters at the first one.

    Parameters
    ----------
    linear_at : callable
        Takes a time, s, and values of parameters and inputs.
    model : Model
        With the signals that are varied.
    known : Mapping of str to float or str
        Settings.
    points : ndarray, shape (n,), optional
        Times of inputs that vary, s.
    options : LineariseKeywords
    """
    if options["cut"] is not None and (options["inputs"] or options["outputs"]):
        raise UserError(f"{option('cut', options['cut'])} has its own input and output")
    times = [seconds(time) for time in options["at"]] or [0.0]
    if points is not None and max(times) > points[-1]:
        raise UserError(
            f"{option('at', f'{max(times):g}')}: the inputs that vary end at {points[-1]:g} s"
        )
    first, *further = (linear_at(time, {}) for time in times)
    variations = tuple(
        replace(linear_at(times[0], case), case=case)
        for case in _band_cases(model, numeric(known), options)
    )
    return replace(first, further=tuple(further), variations=variations)


def _step(options: LineariseKeywords) -> float | None:
    """Return the communication step in s; None in continuous time."""
    step = optional_seconds(options["step"])
    if step is not None and not 0.0 < step < np.inf:
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
) -> tuple[dict[str, float], dict[str, Array], Array | None]:
    """Return constant inputs, varying inputs, and the times of these."""
    time = options["time"]
    points = None if time is None else np.asarray(time, dtype=float)
    varying = {name: values for name, values in stimulus.items() if _varies(values)}
    if varying and points is None:
        raise UserError(f"{', '.join(varying)}: inputs that vary need {option('time')}")
    constant = {name: value for name, value in stimulus.items() if name not in varying}
    arrays = inputs_over(model, constant, np.zeros(1))  # checks names and shapes
    driven = {} if points is None else inputs_over(model, varying, points)
    return {name: float(values[0]) for name, values in arrays.items()}, driven, points


def _varies(values: Any) -> bool:
    """Return whether an input is a function of time or has several values."""
    return callable(values) or np.ndim(values) > 0


def _trim_request(
    subject: Equations, model: Model, options: LineariseKeywords
) -> TrimRequest | None:
    """Return the conditions of an equilibrium; None if the operating point need not be one."""
    fixed = options["fix"] or {}
    if not options["trim"]:
        for name in ("fix", "free", "drift"):
            if options[name]:
                raise UserError(f"{option(name)} is of an equilibrium: add {option('trim', True)}")
        return None
    layout = subject.graph.layout
    signals = {v.name: declared_signal(v) for v in layout.variables}
    aliases = {alias: name for alias, name in subject.outputs.items() if alias not in signals}
    values = {}
    for name, value in fixed.items():
        signal = aliases.get(name, name)
        if signal not in signals:
            raise UserError(
                f"{subject.name}: {option('fix', {name: value})}: no signal named {name!r}"
                f"{suggestion(name, [*signals, *aliases])}"
            )
        amount = read_setting(str(value), signals[signal], option("fix", {name: value}))
        values[signal] = float(amount)
    return TrimRequest(values, tuple(options["free"]), tuple(options["drift"]))


def _band_cases(
    model: Model, known: Mapping[str, float], options: LineariseKeywords
) -> list[dict[str, float]]:
    """Return the values of parameters of each model of a band."""
    over = options["over"] or {}
    count = _DRAWS if options["samples"] is None else options["samples"]
    seed = options["seed"]
    if options["fitted"] is not None:
        if over:
            raise UserError(f"{option('fitted')} and {option('over')}: one of the two")
        drawn = read_fitted(Path(options["fitted"]), model).draws(count, seed)
        return [dict(zip(drawn, row, strict=True)) for row in zip(*drawn.values(), strict=True)]
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


# --- FMUs without equations ----------------------------------------------------------------------


def _linearise_without_equations(
    subject: ForeignSubject, stimulus: Inputs, options: LineariseKeywords
) -> LinearModel:
    """Linearise an FMU, or a system in which one is a member, about what is reached in time."""
    model = subject.model
    for name in ("trim", "fix", "free", "drift", "preset"):
        if options[name]:
            raise UserError(
                f"{_reason(subject)}; {option(name, options[name])} needs the equations of a"
                " component: an FMU without them is linearised at a time"
            )
    constants, driven, points = _split_inputs(model, stimulus, options)
    known = values_of(model, options["settings"]) | constants
    given = _step(options)
    step = given or subject.system.step
    signals = (options["inputs"], options["outputs"])
    drive = (np.zeros(1) if points is None else points, driven)

    def linear_at(time: float, changed: Mapping[str, float]) -> LinearModel:
        there = subject.at(time, {**known, **changed}, drive, signals, step)
        held = step if there.is_held else given or 0.0
        if options["cut"] is not None:
            found = there.loop(there.point, options["cut"], held)
        else:
            found = there.linearise(there.point, *signals, held)
        notes = (*model.notes, *found.notes, *there.remarks)
        if there.is_held and subject.system.connections:
            notes += (f"values are exchanged every {step:g} s, and act a step later (Jacobi)",)
        return replace(found, notes=notes)

    return _at_all_points(linear_at, model, known, points if driven else None, options)


def _reason(subject: ForeignSubject) -> str:
    """Return the part of a message that equations are unknown."""
    if subject.model.system is None:
        return subject.model.without_equations
    names = [member.name for member in subject.system.members if member.cls is None]
    return f"{subject.model.name}: equations of {', '.join(names)} are not known"
