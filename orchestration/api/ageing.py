"""Ageing of an actuator from Python: ``ppy.age``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import NamedTuple, Unpack

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, find
from orchestration.api.batch import named_records
from orchestration.api.declaration import takes
from orchestration.api.forms import rows_per_second, seconds
from orchestration.api.options import AgeKeywords
from orchestration.api.records import Records, listed, matching_runs
from orchestration.api.simulation import AnyModel, as_measured, simulate, values_of
from orchestration.fmu import Model
from orchestration.fmu.model import built
from orchestration.fmu.signal import Signal, numeric
from orchestration.identify import Fit, comparison
from orchestration.identify.ageing import FEWEST, Ageing, Course, Derating, forecast_life
from orchestration.identify.spectral import parts_of_ratio, unit_of_ratio
from orchestration.identify.uncertainty import Estimate
from orchestration.linear import point_at, subject_of
from orchestration.records import Record, record_labels
from orchestration.reporting import option

_ESTIMATOR = "degradation_estimator"  # the registered component that lowers the voltage limit
_WATCHED = ("current", "voltage")  # its inputs
_REST = 60.0  # s between records, in which the estimator is at rest; longer than its timeout


@takes(AgeKeywords)
def age(records: Records, model: AnyModel | None = None, **options: Unpack[AgeKeywords]) -> Ageing:
    """Follow the ageing of an actuator over a record or several, and forecast its life.

    Parameters are fitted window by window; the life ends when the impedance of the fitted model, or
    a parameter, has risen by a share. The clock is the time of operation: records follow each other
    without the rests between them. The degradation estimator runs over the same records.

    Parameters
    ----------
    records : Record, str, Path, DataFrame or Mapping of str to array_like, or sequence of these
        In the order of use; a folder stands for its files, by name.
    model : Model, System, type[Component], str or Path, optional
        As in `compare`.

    Returns
    -------
    Ageing
        ``courses`` of parameters with intervals, ``forecast``, ``derating``; ``to_frame()``,
        ``report("page.html")``.

    Raises
    ------
    UserError
        If a record or the model cannot be used, or a name is unknown.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> from demonstrations.records import draw, write
    >>> write(draw(None, seed=1, duration=60.0), "clean.csv")
    >>> aged = ppy.age("clean.csv", window="20s", fit=["R1", "R2", "C", "charge_start"])
    >>> len(aged.time), aged.forecast is None
    (3, True)
    """
    declared = as_measured(model).with_options(options)
    measure = _measure(declared, options)
    sources = named_records(listed(records)).values()
    runs = [run for one in sources for run in matching_runs(one, declared, options)]
    windows = [*_windows(runs, seconds(options["window"]))]
    courses = _courses(declared, windows, measure, options)
    time = np.array([one.middle for one in windows])
    forecast = None
    if time.size >= FEWEST:
        forecast = forecast_life(time, courses[options["of"]].value, options["rise"] / 100.0)
    return Ageing(
        declared.title,
        tuple(dict.fromkeys(run.source for run in runs)),
        options["of"],
        time,
        tuple(one.label for one in windows),
        courses,
        forecast,
        *_derated(runs, options),
    )


class _Window(NamedTuple):
    """A part of a record: its middle in s of operation, and the label of the record."""

    middle: float
    label: str
    record: Record


def _windows(runs: Sequence[Record], length: float) -> Iterator[_Window]:
    """Divide each record into equal windows of about a length in s."""
    if not 0.0 < length < inf:
        raise UserError(f"{option('window', f'{length:g}')}: a time above 0 s")
    begin = 0.0
    for run, label in zip(runs, record_labels(runs), strict=True):
        time = run.time - run.time[0]
        count = max(round(float(time[-1]) / length), 1)
        ends = np.searchsorted(time, np.linspace(0.0, time[-1], count + 1)[1:-1])
        for inside in np.split(np.arange(time.size), ends):
            if inside.size:
                signals = {name: values[inside] for name, values in run.signals.items()}
                part = replace(run, time=run.time[inside], signals=signals)
                yield _Window(begin + float(time[inside].mean()), label, part)
        begin += float(time[-1])


def _courses(
    model: Model,
    windows: Sequence[_Window],
    measure: Callable[[Mapping[str, float]], float],
    options: AgeKeywords,
) -> dict[str, Course]:
    """Fit the windows, and return the course of each parameter and of what ends the life."""
    given = values_of(model, options["settings"])
    subject = built(model)
    fits: list[Fit] = []
    for k, one in enumerate(windows):
        options["progress"](f"window {k + 1} of {len(windows)}")
        data = comparison.fit_data(subject, one.record)
        fits.append(comparison.fit_model(subject, [data], options["fit"], given))
    courses = {
        name: Course.of([fit.estimates[name] for fit in fits], declared)
        for name, declared in fits[0].declared.items()
    }
    if options["of"] not in courses:
        rising = [_with_interval(fit, measure) for fit in fits]
        courses[options["of"]] = Course.of(rising, _signal(options["of"], model))
    return courses


def _measure(model: Model, options: AgeKeywords) -> Callable[[Mapping[str, float]], float]:
    """Return the quantity that ends the life, as a function of fitted values.

    It is the magnitude of a ratio of two signals of the linearised model, such as eq. 4.10.
    """
    of = options["of"]
    if "/" not in of:
        name = find(
            of, {name: name for name in options["fit"]}, f"{option('of')}: nothing is fitted"
        )
        return lambda values: values[name]
    output, driven = parts_of_ratio(of)
    if model.cls is None:
        raise UserError(
            f"{option('of', of)}: {model.name} has no equations; name a fitted parameter"
        )
    find(output, model.outputs, f"{option('of', of)}: {model.name} has no output")
    find(driven, model.inputs, f"{option('of', of)}: {model.name} has no input")
    frequency = rows_per_second(options["frequency"])
    subject = subject_of(model.cls, model.title)
    known = numeric(values_of(model, options["settings"]))

    def magnitude(values: Mapping[str, float]) -> float:
        point = point_at(subject.graph, 0.0, known | dict(values))
        linear = subject.linearise(point, [driven], [output])
        return float(np.abs(linear.response(np.array([frequency]), driven, output)).item())

    return magnitude


def _with_interval(fit: Fit, measure: Callable[[Mapping[str, float]], float]) -> Estimate:
    """Return a quantity at fitted values, with an interval by differences over standard errors."""
    values = fit.values
    value = measure(values)
    moves = [
        measure(values | {name: one.interval[1]}) - value if np.isfinite(one.interval[1]) else inf
        for name, one in fit.estimates.items()
    ]
    half = inf
    if np.isfinite(moves).all():
        half = float(np.sqrt(moves @ fit.correlation_matrix @ moves))
    return Estimate(value, value, (value - half, value + half), "")


def _signal(of: str, model: Model) -> Signal:
    """Return the declaration of a ratio of an output and an input."""
    output, driven = parts_of_ratio(of)
    unit = unit_of_ratio(model.outputs[output].unit, model.inputs[driven].unit)
    return Signal(of, "real", unit, unit, 0.0, 0.0, inf)


def _derated(
    runs: Sequence[Record], options: AgeKeywords
) -> tuple[Derating | None, tuple[str, ...]]:
    """Run the degradation estimator over the records."""
    lacking = [name for name in _WATCHED if any(name not in run.signals for run in runs)]
    if lacking:
        return None, (f"no derating: the records have no {' and no '.join(lacking)}",)
    step = float(np.median(np.concatenate([np.diff(run.time) for run in runs])))
    clock, operation, *watched = np.hstack([*_joined(runs, step)])
    settings = {"sample_period": step} | dict(options["derating"] or {})
    signals = dict(zip(_WATCHED, watched, strict=True))
    found = simulate(_ESTIMATOR, signals, time=clock, settings=settings)
    valid = np.maximum.accumulate(found["estimate_valid"]) > 0.5
    change = np.where(valid, found["impedance_change"], np.nan)
    used = np.isfinite(operation)
    return Derating(operation[used], found["voltage_limit"][used], change[used]), ()


def _joined(runs: Sequence[Record], step: float) -> Iterator[Array]:
    """Yield clock, time of operation, current and voltage (4, n) of each record and the rest after.

    The estimator stands still in a rest, which takes no time of operation.
    """
    rest = step * np.arange(1, max(round(_REST / step), 1) + 1)
    clock = operation = 0.0
    for run in runs:
        time = run.time - run.time[0]
        watched = [_filled(time, run.signals[name]) for name in _WATCHED]
        yield np.array([clock + time, operation + time, *watched])
        idle = np.zeros(rest.size)
        yield np.array([clock + time[-1] + rest, np.full(rest.size, np.nan), idle, idle])
        clock += time[-1] + rest[-1] + step
        operation += time[-1]


def _filled(time: Array, values: Array) -> Array:
    """Return a signal with straight lines across the samples that are missing."""
    present = np.isfinite(values)
    return np.interp(time, time[present], values[present])
