"""Stepping one FMU over given inputs: communication points, the loop, and a model's simulation for ``ppy simulate``."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit import units
from fmus.kit.errors import UserError
from orchestration.fmu import stepping
from orchestration.fmu.course import course
from orchestration.fmu.instance import Fmu
from orchestration.fmu.isolation.box import rows
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Ended, Process
from orchestration.fmu.kernel import library, one_fmu
from orchestration.fmu.model import Model
from orchestration.fmu.signal import Value
from orchestration.records import Record

Array = NDArray[np.float64]


def grid(start: float, stop: float, step: float) -> Array:
    """Communication points from ``start`` to ``stop`` inclusive, ``step`` apart; a shorter last step if need be.

    Raises
    ------
    UserError
        If the numbers make no grid.
    """
    if not (np.isfinite([start, stop, step]).all() and step > 0.0 and stop > start):
        raise UserError(
            f"cannot step from {start:g} s to {stop:g} s by {step:g} s: --stop must come later and --step be positive"
        )
    if (stop - start) / step > 1e7:
        raise UserError(
            f"{(stop - start) / step:.3g} steps from {start:g} s to {stop:g} s by {step:g} s; at most 1e7 are made"
        )
    points: Array = start + step * np.arange(
        int((stop - start) / step * (1 + 1e-12)) + 1, dtype=np.float64
    )
    return (
        points
        if stop - points[-1] < 1e-9 * min(step, stop - start)
        else np.concatenate([points, [stop]])
    )


def points(recorded: Array, stop: float | None, step: float | None) -> Array:
    """Communication points for a record: its own times, or a grid of ``step``; from its start, to ``stop`` if given.

    Raises
    ------
    UserError
        If the numbers make no grid, or the record ends before ``stop`` and no step says how to go on.
    """
    first, end = float(recorded[0]), float(recorded[-1])
    last = end if stop is None else stop
    if step is not None:
        return grid(first, last, step)
    if not first < last <= end:
        raise UserError(
            f"--stop {last:g} s is not within the record, which goes from {first:g} s to {end:g} s "
            "(with --step, its last values are held beyond its end)"
        )
    return recorded[recorded <= last]


def held(record: Record, name: str, time: Array) -> Array:
    """Values of a recorded signal at other times, each sample held until the next."""
    index = (
        np.searchsorted(record.time, time + 1e-9 * np.median(np.diff(record.time)), side="right")
        - 1
    )
    return record.signals[name][np.clip(index, 0, None)]


def simulate(
    model: Model,
    time: Array,
    inputs: Mapping[str, Array],
    parameters: Mapping[str, Value],
    progress: Callable[[int], None] = lambda done: None,
    note: Callable[[str], None] = lambda line: None,
    isolation: Limits | None = None,
) -> dict[str, Array]:
    """Run the model's FMU.

    Parameters
    ----------
    model : Model
    time : ndarray, shape (n,)
        Communication points in seconds.
    inputs : Mapping[str, ndarray]
        Values (n,) by input, in the FMU's units; missing inputs stay at their start value.
    parameters : Mapping[str, float | str]
        Values that replace defaults, in the FMU's units; constant values of inputs too.
    progress : callable
        Called with the number of points done.
    note : callable
        Called with what the FMU had to say although it did not fail.
    isolation : Limits, optional
        Of a process beside this one in which it is run; default in this one.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Every output, in the FMU's units.

    Raises
    ------
    UserError
        If the FMU refuses or fails; see :class:`orchestration.fmu.instance.Fmu`.
    Unfinished
        If it does so on its way.
    """
    asked = model.path.resolve(), list(model.outputs), time, dict(inputs), dict(parameters)
    if isolation is None:
        return _simulate(*asked, progress, note)
    with Process(isolation) as process:
        try:
            done: dict[str, Array] = process.call(
                _simulate, *asked, told={"progress": progress, "note": note}
            )
        except Ended as end:
            if end.interrupted:
                raise KeyboardInterrupt from end
            there, names = process.box.filled(end.state.point), process.box.about()
            message = f"{end.state.words(time, model.path.name)}: {end.reason}"
            raise unfinished(message, time, names or asked[1], there) from end
        return done


def _simulate(
    path: Path,
    outputs: Sequence[str],
    time: Array,
    inputs: Mapping[str, Array],
    parameters: Mapping[str, Value],
    progress: Callable[[int], None],
    note: Callable[[str], None],
) -> dict[str, Array]:
    with Fmu(path, parameters) as fmu:
        fmu.start(float(time[0]))
        found = simulate_instance(fmu, time, inputs, outputs, progress)
        if fmu.complaints:
            note(fmu.complaints)
        return found


class Unfinished(UserError):
    """A simulation that its FMU has stopped.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Points that were reached, in s.
    outputs : dict of str to ndarray, shape (n,)
        At them.
    """

    def __init__(self, message: str, time: Array, outputs: dict[str, Array]):
        super().__init__(message, time, outputs)  # as it is made again where it was sent to
        self.time, self.outputs = time, outputs

    def __str__(self) -> str:
        return str(self.args[0])


def unfinished(message: str, time: Array, names: Sequence[str], rows: Array | None) -> UserError:
    """An error with what there is, if there is something."""
    if rows is None or not len(rows):
        return UserError(message)
    return Unfinished(
        message, time[: len(rows)], {name: rows[:, k].copy() for k, name in enumerate(names)}
    )


def simulate_instance(
    fmu: Fmu,
    time: Array,
    inputs: Mapping[str, Array],
    outputs: Sequence[str] | None = None,
    progress: Callable[[int], None] = lambda done: None,
    linear: Collection[str] = (),
    parts: int = 1,
) -> dict[str, Array]:
    """Step a started instance over given communication points.

    Inputs are set at every point, and held until the next or go there linearly; outputs are read at every point *after*
    its inputs are set, so that a direct feedthrough shows at once.

    Parameters
    ----------
    fmu : Fmu
    time : ndarray, shape (n,)
        Communication points in seconds, increasing.
    inputs : Mapping[str, ndarray]
        Values of shape (n,) by input name, in the FMU's units.
    outputs : sequence of str, optional
        Which variables to read; default every output.
    progress : callable
        Called with the number of points done, now and then.
    linear : collection of str
        Real inputs that go linearly from point to point. An FMU that can interpolate gets their slopes, any other holds
        the value at the middle of every part, whose effect on its states differs in the second order only.
    parts : int
        Steps from point to point.

    Returns
    -------
    dict of str to ndarray, shape (n,)

    Raises
    ------
    UserError
        If a step fails or is discarded, with the time and the FMU's message; nothing shorter is returned.
    """
    names = list(fmu.outputs if outputs is None else outputs)
    check_inputs(fmu, inputs)
    way = course(fmu, time, inputs, linear, parts)
    step = stepping.stepped if library.stepper() is None else one_fmu.stepped
    result = rows((len(time), len(names)))
    try:
        step(fmu, way, names, result, progress, max(1, len(time) // 200))
    except stepping.Failed as failure:
        raise unfinished(str(failure), time, names, result[: failure.point]) from failure
    progress(len(time))
    return {name: result[:, i] for i, name in enumerate(names)}


def check_inputs(fmu: Fmu, names: Iterable[str]) -> None:
    """Refuse what is no input of an FMU.

    Raises
    ------
    UserError
        If there is one.
    """
    for name in names:
        if fmu.variable(name).causality != "input":
            inputs_are = ", ".join(fmu.inputs) or "none"
            raise UserError(f"{fmu.path.name}: {name} is not an input; inputs are {inputs_are}")


def plot(
    path: Path, model: Model, time: Array, signals: Mapping[str, Array], title: str = ""
) -> None:
    """Draw inputs and outputs over time, one panel each, in display units.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    from orchestration.reporting import pictures

    known = {**model.inputs, **model.outputs}
    figure, panels = pictures.panels(len(signals), title or model.name)
    for panel, (name, values) in zip(panels, signals.items(), strict=True):
        signal = known[name]
        style = "steps-post" if name in model.inputs else "default"  # inputs are held
        panel.plot(
            time,
            units.convert(values, signal.unit, signal.display),
            color=pictures.MODEL,
            drawstyle=style,
        )
        pictures.label(panel, name, signal.display)
    pictures.save(figure, path)
