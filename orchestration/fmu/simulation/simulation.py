"""Simulation of one FMU with given inputs: communication points, runs and their plot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import UserError, units
from fmus.kit.arrays import Array, Indices
from orchestration.fmu import stepping
from orchestration.fmu.archive import read_description
from orchestration.fmu.instance import EndRequested, Fmu
from orchestration.fmu.isolation import Ended, Limits, Process, allocate_rows
from orchestration.fmu.kernel import library, one_fmu
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Signal, Value, read_signal, show, type_of
from orchestration.fmu.simulation.run_files import RunFiles
from orchestration.fmu.source import Source
from orchestration.records import Record
from orchestration.reporting import option

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NO_FILES = RunFiles()
_MOST_STEPS = 1e7
_ROUNDING = 1e-9  # of a step, by which two times may differ and be the same point


def grid(start: float, stop: float, step: float) -> Array:
    """Return equidistant communication points from start to stop; the last step may be shorter.

    Parameters
    ----------
    start, stop, step : float
        In seconds.

    Returns
    -------
    ndarray, shape (n,)
        In seconds, with both ends.

    Raises
    ------
    UserError
        If the step is not positive, `stop` is not after `start`, or there are too many steps.
    """
    if not (np.isfinite([start, stop, step]).all() and step > 0.0 and stop > start):
        raise UserError(
            f"cannot step from {start:g} s to {stop:g} s by {step:g} s: {option('stop')} must come"
            f" later and {option('step')} be positive"
        )
    if (stop - start) / step > _MOST_STEPS:
        raise UserError(
            f"{(stop - start) / step:.3g} steps from {start:g} s to {stop:g} s by {step:g} s; at"
            " most 1e7 are made"
        )
    # rounding of the division must not lose the last whole step
    count = int((stop - start) / step * (1 + 1e-12)) + 1
    points: Array = start + step * np.arange(count, dtype=np.float64)
    if stop - points[-1] < _ROUNDING * min(step, stop - start):
        return points
    return np.concatenate([points, [stop]])


def points(recorded: Array, stop: float | None, step: float | None) -> Array:
    """Return communication points for a record, beginning at its first time.

    Parameters
    ----------
    recorded : ndarray, shape (m,)
        Times of the record in seconds.
    stop : float, optional
        Last point in seconds; default the end of the record.
    step : float, optional
        Step of a grid in seconds; default the times of the record.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If `grid` refuses the times, or without `step` the record does not include `stop`.
    """
    first = float(recorded[0])
    end = float(recorded[-1])
    last = end if stop is None else stop
    if step is not None:
        return grid(first, last, step)
    if not first < last <= end:
        raise UserError(
            f"{option('stop', last)} is not within the record, which goes from {first:g} s"
            f" to {end:g} s (with {option('step')}, its last values continue beyond its end)"
        )
    return recorded[recorded <= last]


def held(record: Record, name: str, time: Array) -> Array:
    """Return a recorded signal at other times by a zero-order hold.

    Parameters
    ----------
    record : Record
    name : str
        Name of the signal.
    time : ndarray, shape (n,)
        In seconds.

    Returns
    -------
    ndarray, shape (n,)
        In the unit of the record.
    """
    return record.signals[name][np.clip(stepping.last_before(record.time, time), 0, None)]


def with_changes(record: Record, time: Array) -> Array:
    """Return points in time, with those between them at which a recorded signal changes.

    Parameters
    ----------
    record : Record
    time : ndarray, shape (n,)
        Communication points in seconds.

    Returns
    -------
    ndarray, shape (m,)
        `time` itself if the record changes at its points only.
    """
    changes = np.zeros(record.time.size, dtype=bool)
    for values in record.signals.values():
        changes[1:] |= values[1:] != values[:-1]
    within = (record.time > time[0]) & (record.time < time[-1])
    instants = record.time[changes & within]
    # a change at a point, but for rounding, is none between two
    rounding = _ROUNDING * float(np.median(np.diff(time)))
    after = np.searchsorted(time, instants)
    apart = np.minimum(time[after] - instants, instants - time[after - 1])
    between = instants[apart > rounding]
    return np.union1d(time, between) if between.size else time


def points_before(time: Array, instants: Array) -> Indices:
    """Return the index of the last of `time` (n,) that is not after each of `instants` (m,)."""
    index: Indices = np.searchsorted(time, instants, side="right") - 1
    return index


def simulate(
    model: Model,
    time: Array,
    inputs: Mapping[str, Array],
    parameters: Mapping[str, Value],
    progress: Callable[[int], None] = lambda done: None,
    note: Callable[[str], None] = lambda line: None,
    *,
    isolation: Limits | None = None,
    files: RunFiles = _NO_FILES,
) -> dict[str, Array]:
    """Simulate a model and return its outputs.

    Parameters
    ----------
    model : Model
    time : ndarray, shape (n,)
        Communication points in seconds.
    inputs : Mapping[str, ndarray]
        Values (n,) by input, in the FMU's units; other inputs keep their start values.
    parameters : Mapping[str, float | str]
        Start values of parameters and inputs, in the FMU's units.
    progress : callable
        Called with the number of points done.
    note : callable
        Called with the warnings of an FMU that did not fail.
    isolation : Limits, optional
        Limits of a separate process for the run; default is this process.
    files : RunFiles
        Log of calls and states, for one FMU.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Every output, in the FMU's units.

    Raises
    ------
    UserError
        If the FMU refuses or fails; see :class:`orchestration.fmu.instance.Fmu`.
    UnfinishedSimulation
        If it fails after the first point; `EndedSimulation` if it asks to end there.
    """
    outputs = list(model.outputs)
    run = (outputs, time, dict(inputs), dict(parameters))
    function: Callable[..., dict[str, Array]] = _simulate
    arguments: tuple[Any, ...] = ((model.path.resolve(), model.tolerance), *run, files)
    callbacks: dict[str, Callable[..., None]] = {"progress": progress, "note": note}
    if model.system is not None:
        function, arguments, callbacks = _simulate_system, (model.system, *run), {}
    else:
        files.clear_log()
    if isolation is None:
        return function(*arguments, **callbacks)
    with Process(isolation) as process:
        try:
            results: dict[str, Array] = process.call(function, *arguments, callbacks=callbacks)
        except Ended as end:
            if end.interrupted:
                raise KeyboardInterrupt from end
            raise _ended(end, process, model, time) from end
        return results


def _ended(end: Ended, process: Process, model: Model, time: Array) -> UserError:
    """Return the error of a run whose process has ended, with the rows that it has left.

    Of a system nothing is left, and of texts nothing but numbers.
    """
    if model.system is not None:
        where = end.state.describe(model.system.points(time), model.system.name)
        return UserError(f"{where}: {end.reason}")
    has_texts = any(signal.type == "string" for signal in model.outputs.values())
    rows = None if has_texts else process.progress.read_rows(end.state.point)
    names = process.progress.rows_description() or list(model.outputs)
    points = stepping.communication_points(read_description(model.path), time)
    message = f"{end.state.describe(points, model.path.name)}: {end.reason}"
    return _unfinished(message, points, names, rows)


def _simulate(
    source: tuple[Path, float | None],
    outputs: Sequence[str],
    time: Array,
    inputs: Mapping[str, Array],
    parameters: Mapping[str, Value],
    files: RunFiles,
    *,
    progress: Callable[[int], None],
    note: Callable[[str], None],
) -> dict[str, Array]:
    """Simulate the FMU of a path and a tolerance in this process; see `simulate`."""
    path, tolerance = source
    with Fmu(path, parameters, tolerance=tolerance, calls=files.calls) as fmu:
        files.check(fmu)
        if files.state_in is None:
            begin_run(fmu, time, inputs, goes_on=files.state_out is not None)
        else:
            files.resume(fmu)
        results = simulate_instance(fmu, time, inputs, outputs, progress)
        files.write_state(fmu, float(time[-1]))
        try:
            fmu.terminate()
        except UserError as error:
            note(str(error))
        if fmu.complaints:
            note(fmu.complaints)
        return results


def begin_run(fmu: Fmu, time: Array, inputs: Mapping[str, Array], *, goes_on: bool = False) -> None:
    """Initialize an instance for a run, with the first inputs.

    Parameters
    ----------
    fmu : Fmu
    time : ndarray, shape (n,)
        Seconds; the stop time is the last one, or the end of the step of an FMU's own size there.
    inputs : Mapping of str to ndarray, shape (n,)
        In the FMU's units.
    goes_on : bool
        Whether another run goes on from the state at the end: then no stop time is told, beyond
        which FMUs refuse to step.

    Raises
    ------
    UserError
        If a name is no input, or the FMU refuses.
    """
    check_inputs(fmu, inputs)
    # one that is among the start values begins with that one, and moves at the first point
    first = {name: values[0] for name, values in inputs.items() if name not in fmu.parameters}
    last = stepping.communication_points(fmu.description, time)[-1]
    fmu.start(float(time[0]), None if goes_on else float(last), first)


def _simulate_system(
    system: Source,
    outputs: Sequence[str],
    time: Array,
    inputs: Mapping[str, Array],
    parameters: Mapping[str, Value],
) -> dict[str, Array]:
    """Open a system and run it once; see `simulate`."""
    with system.open() as runs:
        table = runs.run(time, inputs, parameters, outputs)
    return {name: table[:, k] for k, name in enumerate(outputs)}


class UnfinishedSimulation(UserError):
    """Raised when a simulation fails after its first point.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Completed communication points in s.
    outputs : dict of str to ndarray, shape (n,)
        Outputs at these points, in the FMU's units.
    """

    def __init__(self, message: str, time: Array, outputs: dict[str, Array]):
        super().__init__(message, time, outputs)  # the arguments that unpickling needs
        self.time = time
        self.outputs = outputs

    def __str__(self) -> str:
        return str(self.args[0])


class EndedSimulation(UnfinishedSimulation):
    """Raised when an FMU ends its simulation before the last point, at its own request.

    The last point is the time that it has reached.
    """


def unfinished(
    failure: stepping.StepFailed, fmu: Fmu, time: Array, names: Sequence[str], result: Array
) -> UserError:
    """Return the error of a run whose step failed, with its results until then.

    An FMU that asks to end within a step has values at the time that it has reached (FMI 2.0.4,
    4.2.4): they are the last ones.

    Parameters
    ----------
    failure : StepFailed
    fmu : Fmu
    time : ndarray, shape (n,)
    names : sequence of str
        Outputs in the columns of `result`.
    result : ndarray, shape (n, outputs)
        Filled at the completed points; gets another row for the time that was reached.
    """
    end = failure.__cause__
    done = failure.point
    if not isinstance(end, EndRequested):
        return _unfinished(str(failure), time, names, result[:done], fmu.as_values)
    latest = time[done] + _ROUNDING * (time[done] - time[done - 1])
    if end.reached is not None and done and time[done - 1] < end.reached <= latest:
        fmu.reader(names)(result[done])
        time = np.append(time[:done], end.reached)
        done += 1
    return _unfinished(str(failure), time, names, result[:done], fmu.as_values, EndedSimulation)


def _unfinished(
    message: str,
    time: Array,
    names: Sequence[str],
    rows: Array | None,
    read: Callable[[str, Array], Any] = lambda name, numbers: numbers,
    kind: type[UnfinishedSimulation] = UnfinishedSimulation,
) -> UserError:
    """Return the error of a failed simulation, with its results if there are any.

    Parameters
    ----------
    message : str
    time : ndarray, shape (n,)
    names : sequence of str
        Outputs in the columns of `rows`.
    rows : ndarray, shape (m, outputs), or None
        Outputs at the completed points.
    read : callable
        Returns values from the name of an output and numbers of its column.
    kind : type of UnfinishedSimulation
    """
    if rows is None or not len(rows):
        return UserError(message)
    outputs = {name: read(name, rows[:, k].copy()) for k, name in enumerate(names)}
    return kind(message, time[: len(rows)], outputs)


def simulate_instance(
    fmu: Fmu,
    time: Array,
    inputs: Mapping[str, Array],
    outputs: Sequence[str] | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> dict[str, Array]:
    """Step a started instance over given communication points.

    Inputs are set at every point, and are constant until the next; outputs are read at every point
    *after* its inputs are set, so that they include a direct feedthrough. An FMU that has only
    steps of one size makes these, as `orchestration.fmu.stepping.communication_points` says.

    Parameters
    ----------
    fmu : Fmu
    time : ndarray, shape (n,)
        Communication points in seconds, increasing.
    inputs : Mapping[str, ndarray]
        Values of shape (n,) by input name, in the FMU's units.
    outputs : sequence of str, optional
        Variables to read; default every output.
    progress : callable
        Called with the number of points done, some 200 times.

    Returns
    -------
    dict of str to ndarray, shape (n,)

    Raises
    ------
    UserError
        If a step fails or is discarded, with the time and the FMU's message; `UnfinishedSimulation`
        after the first point.
    """
    names = list(fmu.outputs if outputs is None else outputs)
    check_inputs(fmu, inputs)
    course = stepping.plan_course(fmu, time, inputs)
    has_texts = any(type_of(fmu.variable(name)) == "string" for name in (*names, *inputs))
    has_kernel = not has_texts and library.load_stepper() is not None
    follow_course = one_fmu.follow_course if has_kernel else stepping.follow_course
    points = len(course.time)
    result = allocate_rows((points, len(names)))

    def point_done(k: int) -> None:
        progress(k * len(time) // points)

    try:
        follow_course(fmu, course, names, result, point_done, max(1, points // 200))
    except stepping.StepFailed as failure:
        raise unfinished(failure, fmu, course.time, names, result) from failure
    progress(len(time))
    table = course.at_wanted(result, stepping.is_continuous(fmu, names))
    return {name: fmu.as_values(name, table[:, i]) for i, name in enumerate(names)}


def check_inputs(fmu: Fmu, names: Iterable[str]) -> None:
    """Raise UserError if a name is no input of an FMU and no tunable parameter.

    Raises
    ------
    UserError
        For the first such name.
    """
    for name in names:
        variable = fmu.variable(name)
        if variable.causality != "input" and not read_signal(variable).is_tunable:
            known = ", ".join(fmu.inputs) or "none"
            raise UserError(f"{fmu.path.name}: {name} is not an input; inputs are {known}")


def extremes(values: Array, signal: Signal) -> tuple[str, str, str]:
    """Return the smallest, the largest and the last value for display; of texts the last."""
    if signal.type == "string":
        return "", "", show(str(values[-1]), signal)
    return show(values.min(), signal), show(values.max(), signal), show(values[-1], signal)


def draw_signals(
    model: Model, time: Array, signals: Mapping[str, Array], title: str = ""
) -> Figure:
    """Draw inputs and outputs over time, one panel each, in display units.

    Parameters
    ----------
    model : Model
    time : ndarray, shape (n,)
        In seconds.
    signals : Mapping of str to ndarray, shape (n,)
        By input or output, in the FMU's units.
    title : str
        Title of the figure; default the name of the model.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from orchestration.reporting import pictures

    known = {**model.driven, **model.outputs}
    numbers = {name: v for name, v in signals.items() if known[name].type != "string"}
    figure, panels = pictures.panels(len(numbers), title or model.name)
    for panel, (name, values) in zip(panels, numbers.items(), strict=True):
        signal = known[name]
        style = "steps-post" if name in model.driven else "default"  # zero-order hold
        panel.plot(
            time,
            units.convert(values, signal.unit, signal.display),
            color=pictures.MODEL,
            drawstyle=style,
        )
        pictures.fit_values(panel, signal.type == "boolean")
        pictures.label(panel, name, signal.display)
    return figure
