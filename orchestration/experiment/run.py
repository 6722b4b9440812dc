"""From an experiment to its results: everything is checked against what it is made on, then it runs."""

from __future__ import annotations

import json
import platform
import zlib
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from fmus.kit.errors import UserError, suggestion
from fmus.kit.units import allowed, shown
from orchestration.experiment import results
from orchestration.experiment.model import Experiment, Master, Noise
from orchestration.experiment.stimulus import Place
from orchestration.experiment.subject import Subject, known, subject
from orchestration.fmu import simulate
from orchestration.fmu.signal import Signal, check_type, read_setting
from orchestration.master.reference.coupling_error import imbalance

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]
_NOISE = 1  # parts the random numbers of a signal's noise from those of a stimulus


def run(
    experiment: Experiment,
    where: str = "experiment",
    progress: Callable[[int, int], None] = lambda done, whole: None,
    note: Callable[[str], None] = lambda text: None,
    fits: Callable[[xarray.Dataset], None] = lambda sketch: None,
) -> xarray.Dataset:
    """Make an experiment.

    Parameters
    ----------
    experiment : Experiment
    where : str
        Its file or name, for messages.
    progress : callable
        Told how many points are done, and of how many.
    note : callable
        Told, in a line, what else is worth knowing: repairs in a file, inputs that stay at their start value.
    fits : callable
        Shown, before anything is computed, a first point of the results without values; it may refuse them.

    Returns
    -------
    xarray.Dataset
        Inputs and recorded outputs over time in the FMU's units, with all that it takes to make the experiment again.
        Of each mechanical coupling of a system the energy that it made, the running sign of coupling error.
        After an interrupt, what was computed, with the attribute ``complete`` 0.

    Raises
    ------
    UserError
        If something in the experiment does not fit what it is made on, or an FMU fails.
    KeyboardInterrupt
        If an interrupt came before the first point.
    """
    with subject(experiment, where) as on:
        resolved: dict[str, Any] = {"duration": experiment.duration or on.duration, "step": experiment.step or on.step}
        if experiment.system:
            resolved["master"] = experiment.master or Master()
        experiment = experiment.model_copy(update=resolved)
        time = _points(experiment, where)
        settings = dict(on.settings) | _settings(experiment, on, where)
        inputs = _inputs(experiment, on, time, where, note)
        record = list(on.usual if experiment.record is None else experiment.record)
        for name in record:
            if name not in on.inputs:
                known(name, on.outputs, "record: no output", where)
        record = list(dict.fromkeys(name for name in record if name not in on.inputs))
        noise = {
            name: _noise(name, n, record, experiment, on, time.size, where) for name, n in experiment.noise.items()
        }
        signals = {name: on.inputs[name] for name in inputs} | {name: on.outputs[name] for name in record}
        if experiment.over != "time":
            known(experiment.over, signals, "over: nothing recorded", where)
        doc = "Energy that the coupling made since the start, an error of co-simulation"
        made = {str(c): Signal(f"imbalance {c}", "real", "J", "J", 0.0, -np.inf, np.inf, doc) for c in on.couplings}
        signals |= {signal.name: signal for signal in made.values()}
        fits(results.dataset(time[:1], {name: np.zeros(1) for name in signals}, signals, set(inputs), {}))
        ends = [str(wire.source) for coupling in on.couplings for wire in coupling]
        wanted = list(dict.fromkeys([*record, *ends]))
        done = on.run(time, inputs, settings, wanted, lambda points: progress(points, time.size))
    for line in done.notes:
        note(line)
    count = done.time.size
    if count == 0:
        raise KeyboardInterrupt
    values = {name: array[:count] for name, array in inputs.items()}
    for name, array in zip(wanted, done.signals.values(), strict=True):
        if name in record:
            values[name] = array + noise[name][:count] if name in noise else array
    extrapolation = experiment.master.extrapolation if experiment.master else 0
    for name, found in imbalance(on.couplings, done.signals, extrapolation).items():
        values[made[name].name] = found.energy
        share = f"{100.0 * found.relative:.3g} % of what went through it"
        note(f"{name}: {found.energy[-1]:.3g} J made by the coupling, {share}")
    return results.dataset(time[:count], values, signals, set(inputs), {
        "title": experiment.title or where, "source": experiment.source, "subject": on.name,
        "complete": int(done.complete), "duration": experiment.duration, "step": experiment.step,
        "seed": experiment.seed, "runtime": experiment.runtime,
        "over": experiment.over, "wall_time": done.statistics.wall,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": f"ppy-rig {version('ppy-rig')}, numpy {np.__version__}, Python {platform.python_version()}",
        "guids": json.dumps(dict(on.guids)),
        "parameters": json.dumps({n: f"{v!r} {_unit(n, on)}" for n, v in settings.items()}),
        "experiment": experiment.model_dump_json(exclude_none=True),
    })  # fmt: skip


def _points(experiment: Experiment, where: str) -> Array:
    try:
        return simulate.grid(0.0, experiment.duration or 0.0, experiment.step or 0.0)
    except UserError as error:
        raise UserError(f"{where}: {error}") from error


def _unit(name: str, on: Subject) -> str:
    return on.parameters[name].unit if name in on.parameters else ""


def _settings(experiment: Experiment, on: Subject, where: str) -> dict[str, float]:
    found = {}
    for name, given in experiment.parameters.items():
        if name in on.fed:
            raise UserError(f"{where}: parameters.{name}: it is an input; {on.fed[name]}")
        if name not in on.parameters:
            near = suggestion(name, [*on.parameters, *Experiment.model_fields])
            raise UserError(f"{where}: {on.name} has no parameter named {name!r}{near}")
        signal = on.parameters[name]
        text = str(given).lower() if isinstance(given, bool) else str(given)
        found[name] = read_setting(text, signal, f"{where}: parameters.{name} = {given}")
    return found


def _inputs(
    experiment: Experiment, on: Subject, time: Array, where: str, note: Callable[[str], None]
) -> dict[str, Array]:
    found = {}
    for name, stimulus in experiment.inputs.items():
        here = f"{where}: inputs.{name}"
        signal = known(name, on.inputs, f"{on.name} has no input", where)
        place = Place(name, signal.unit, _seed(experiment, name))
        try:
            found[name] = stimulus.values(time, place)
        except UserError as error:
            raise UserError(f"{here}: {error}") from error
        _within(signal, found[name], here)
        for line in place.notes:
            note(f"{here}: {line}")
    for name, signal in on.inputs.items():
        if name not in found:
            note(f"no values for the input {name}; it stays at {shown(signal.start, signal)}")
    return found


def _within(signal: Signal, values: Array, where: str) -> None:
    for extreme in (values.min(), values.max()):
        if not signal.min <= extreme <= signal.max:
            raise UserError(f"{where}: {shown(extreme, signal)} is out of range; allowed is {allowed(signal)}")
    for value in np.unique(values) if signal.type != "real" else ():
        check_type(signal.type, value, where)


def _seed(experiment: Experiment, name: str, part: int = 0) -> tuple[int, ...]:
    """Seed of a signal's random numbers: they do not change when another signal comes or goes."""
    return experiment.seed, zlib.crc32(name.encode()), part


def _noise(
    name: str, noise: Noise, record: list[str], experiment: Experiment, on: Subject, count: int, where: str
) -> Array:
    """Noise of a stationary process whose value is `correlation` times the last one plus something new."""
    if name not in record:
        raise UserError(f"{where}: noise.{name}: noise is added to recorded outputs, and this is none")
    signal = on.outputs[name]
    rms = noise.rms.to(signal.unit, f"{where}: noise.{name}.rms = {noise.rms.value:g} {noise.rms.unit}")
    if rms < 0.0 or signal.type != "real":
        raise UserError(f"{where}: noise.{name}.rms = {rms:g}: needs a real output, and 0 or more")
    fresh = np.random.default_rng(_seed(experiment, name, _NOISE)).standard_normal(count)
    fresh[1:] *= np.sqrt(1.0 - noise.correlation**2)
    return rms * np.asarray(lfilter([1.0], [1.0, -noise.correlation], fresh))
