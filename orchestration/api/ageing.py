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
from orchestration.api.linearisation import linearise
from orchestration.api.options import AgeKeywords
from orchestration.api.records import Records, listed, matching_runs
from orchestration.api.simulation import AnyModel, as_measured, simulate, values_of
from orchestration.fmu import Model
from orchestration.fmu.model import built
from orchestration.fmu.signal import Signal
from orchestration.identify import Fit, comparison
from orchestration.identify.ageing import FEWEST, Ageing, Course, Derating, forecast_life
from orchestration.identify.spectral import parts_of_ratio, unit_of_ratio
from orchestration.identify.uncertainty import Estimate
from orchestration.records import Record, record_labels
from orchestration.reporting import option

_ESTIMATOR = "degradation_estimator"  # the registered component that lowers the voltage limit
_WATCHED = ("current", "voltage")  # its inputs
_REST = 60.0  # s between records, in which the estimator stands still; longer than its timeout


@takes(AgeKeywords)
def age(records: Records, model: AnyModel | None = None, **options: Unpack[AgeKeywords]) -> Ageing:
    """Follow the ageing of an actuator over a record or several, and forecast its life.

    Parameters are fitted window by window; the life ends when the impedance of the fitted model, or
    a parameter, has risen by a share. The clock is the time of operation: records follow each other
    without the rests between them. The degradation estimator runs over the same records.

    Parameters
    ----------
    records : Record, str, Path, DataFrame or Mapping of str to array_like, or sequence of these
        In the order of use; a folder stands for its files that have a table, by name.
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
    of = options["of"]
    ratio = _ratio(declared, options) if "/" in of else None
    if ratio is None:
        find(of, dict.fromkeys(options["fit"]), f"{option('of')}: nothing is fitted")
    left_out: list[str] = []
    sources = named_records(listed(records), options, left_out.append).values()
    found = [run for one in sources for run in matching_runs(one, declared, options)]
    runs = [*_in_operation(found)]
    windows = [part for run in runs for part in _windows(run, seconds(options["window"]))]
    courses = _courses(declared, windows, ratio, options)
    time = np.array([one.time.mean() for one in windows])
    forecast = None
    if time.size >= FEWEST:
        forecast = forecast_life(time, courses[of].value, options["rise"] / 100.0)
    derating, reasons = _derated(runs, options)
    return Ageing(
        declared.title,
        tuple(dict.fromkeys(run.source for run in runs)),
        of,
        time,
        tuple(one.label for one in windows),
        courses,
        forecast,
        derating,
        (*left_out, *reasons),
    )


def _in_operation(runs: Sequence[Record]) -> Iterator[Record]:
    """Yield records over the time of operation in s, which rests between them do not count to."""
    begin = 0.0
    for run, label in zip(runs, record_labels(runs), strict=True):
        time = begin + (run.time - run.time[0])
        yield replace(run, time=time, label=label)
        begin = float(time[-1])


def _windows(run: Record, length: float) -> Iterator[Record]:
    """Divide a record into equal windows of about a length in s."""
    if not 0.0 < length < inf:
        raise UserError(f"{option('window', f'{length:g}')}: a time above 0 s")
    first, last = run.time[[0, -1]]
    count = max(round((last - first) / length), 1)
    window = np.searchsorted(np.linspace(first, last, count + 1)[1:-1], run.time, side="right")
    for number in np.unique(window):
        yield run.part(window == number)


def _courses(
    model: Model, windows: Sequence[Record], ratio: _Ratio | None, options: AgeKeywords
) -> dict[str, Course]:
    """Fit the windows, and return the course of each parameter, and of a ratio.

    Start values of states are fitted, but are of a window and not of the actuator.
    """
    given = values_of(model, options["settings"])
    subject = built(model)
    fits = []
    for k, one in enumerate(windows):
        options["progress"](f"window {k + 1} of {len(windows)}")
        data = comparison.fit_data(subject, one)
        fits.append(comparison.fit_model(subject, [data], options["fit"], given))
        if fits[-1].is_interrupted:  # the rest of the windows would go on
            raise KeyboardInterrupt
    courses = {
        name: Course.of([fit.estimates[name] for fit in fits], declared)
        for name, declared in fits[0].declared.items()
        if name == options["of"] or not getattr(declared, "starts", None)
    }
    if ratio is not None:
        rising = [_with_interval(fit, ratio.magnitude) for fit in fits]
        courses[options["of"]] = Course.of(rising, ratio.signal)
    return courses


class _Ratio(NamedTuple):
    """A ratio of two signals: its declaration, and its magnitude at fitted values."""

    signal: Signal
    magnitude: Callable[[Mapping[str, float]], float]


def _ratio(model: Model, options: AgeKeywords) -> _Ratio:
    """Return a ratio of two signals of the linearised model, such as eq. 4.10."""
    written = option("of", options["of"])
    output, driven = parts_of_ratio(options["of"])
    if model.cls is None:
        raise UserError(f"{written}: {model.name} has no equations; name a fitted parameter")
    above = find(output, model.outputs, f"{written}: {model.name} has no output")
    below = find(driven, model.inputs, f"{written}: {model.name} has no input")
    unit = unit_of_ratio(above.unit, below.unit)
    frequency = np.array([rows_per_second(options["frequency"])])

    def magnitude(values: Mapping[str, float]) -> float:
        settings = {**(options["settings"] or {}), **values}
        linear = linearise(model, inputs=[driven], outputs=[output], settings=settings)
        return float(np.abs(linear.response(frequency)).item())

    return _Ratio(Signal(options["of"], "real", unit, unit, 0.0, 0.0, inf), magnitude)


def _with_interval(fit: Fit, measure: Callable[[Mapping[str, float]], float]) -> Estimate:
    """Return a quantity at fitted values, and its interval by differences over those of a fit."""
    value = measure(fit.values)
    highs = {name: high for name, (_, high) in fit.intervals.items()}
    half = inf
    if all(high <= fit.declared[name].max and high < inf for name, high in highs.items()):
        moves = [measure(fit.values | {name: high}) - value for name, high in highs.items()]
        half = float(np.sqrt(moves @ fit.correlation_matrix @ moves))
    return Estimate(value, value, (value - half, value + half), "")


def _derated(
    runs: Sequence[Record], options: AgeKeywords
) -> tuple[Derating | None, tuple[str, ...]]:
    """Run the degradation estimator over the records, with rests between them.

    Its sample period is that of the first record.
    """
    lacking = [name for name in _WATCHED if any(name not in run.signals for run in runs)]
    if lacking:
        return None, (f"no derating: the records have no {' and no '.join(lacking)}",)
    step = float(np.median(np.diff(runs[0].time)))
    rest = step * (max(round(_REST / step), 1) + 1)
    rows = []
    for k, run in enumerate(runs):
        clock = run.time + k * rest
        rows.append(np.array([clock, run.time, *(_filled(run, name) for name in _WATCHED)]))
        rows.append(np.array([[clock[-1] + step], [np.nan], [0.0], [0.0]]))
    clock, operation, *signals = np.hstack(rows)
    settings = {"sample_period": step} | dict(options["derating"] or {})
    inputs = dict(zip(_WATCHED, signals, strict=True))
    found = simulate(_ESTIMATOR, inputs, time=clock, settings=settings)
    valid = np.maximum.accumulate(found["estimate_valid"]) > 0.5
    change = np.where(valid, found["impedance_change"], np.nan)
    used = np.isfinite(operation)
    return Derating(operation[used], found["voltage_limit"][used], change[used]), ()


def _filled(run: Record, name: str) -> Array:
    """Return a signal of a record with straight lines across the samples that are missing."""
    values = run.signals[name]
    present = np.isfinite(values)
    return np.interp(run.time, run.time[present], values[present])
