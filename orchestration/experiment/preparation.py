"""Checks of an experiment against its subject, and the arrays with which it is run."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.kit.arrays import Array, Signals
from fmus.kit.errors import UserError, error_context, find, suggestion
from fmus.kit.units import convert, format_range, format_value
from orchestration.experiment.model import (
    UNITS_OF_LOOP,
    Experiment,
    Master,
    NoiseTable,
    WorkLoopTable,
)
from orchestration.experiment.stimulus import DrivenInput
from orchestration.experiment.subjects import Subject
from orchestration.fmu import Signal, Value
from orchestration.fmu import simulation as simulate
from orchestration.fmu.signal import check_type, is_text, read_setting, split_assignment
from orchestration.fmu.simulation import LimitOutputs
from orchestration.system import checking

_NOISE_STREAM = 1  # last number of a seed: makes noise independent of a stimulus of that name
_FEWEST_STEPS = 3  # of a work loop's period: fewer points enclose no area
_PERIODIC = 1e-3  # share of its range by which a reference may differ from cycle to cycle
_IMBALANCE = "Energy that the coupling made since the start, an error of co-simulation"


@dataclass(frozen=True)
class Preparation:
    """An experiment that fits its subject.

    Attributes
    ----------
    experiment : Experiment
        With the duration, step and, on a system, master of the run.
    subject : Subject
    time : ndarray, shape (n,)
        Communication points in s.
    settings : dict of str to float or str
        Parameters, in the FMU's units.
    inputs, noise : dict of str to ndarray, shape (n,)
        Stimuli by input, and noise by recorded output; in the FMU's units.
    record : list of str
        Outputs that are recorded, besides the inputs.
    """

    experiment: Experiment
    subject: Subject
    time: Array
    settings: Mapping[str, Value]
    inputs: Signals
    noise: Signals
    record: list[str]

    @property
    def imbalances(self) -> dict[str, Signal]:
        """Signal of the energy that each coupling makes, by the coupling's name."""
        return {
            str(c): Signal(f"imbalance {c}", "real", "J", "J", 0.0, -np.inf, np.inf, _IMBALANCE)
            for c in self.subject.couplings
        }

    @property
    def signals(self) -> dict[str, Signal]:
        """All signals of the results, by name."""
        signals = {name: self.subject.driven[name] for name in self.inputs}
        signals |= {name: self.subject.outputs[name] for name in self.record}
        return signals | {signal.name: signal for signal in self.imbalances.values()}

    @property
    def limits(self) -> LimitOutputs:
        """Outputs that report limits."""
        return LimitOutputs.among(self.subject.outputs, self.subject.parameters)

    @property
    def wanted(self) -> list[str]:
        """Outputs that the run returns: those recorded, ends of couplings, and limits."""
        ends = [str(wire.source) for coupling in self.subject.couplings for wire in coupling]
        return list(dict.fromkeys([*self.record, *ends, *self.limits.watched]))


def prepare(
    experiment: Experiment, subject: Subject, where: str, note: Callable[[str], None]
) -> Preparation:
    """Check an experiment against its subject.

    Parameters
    ----------
    experiment : Experiment
    subject : Subject
    where : str
        File or name of the experiment, for messages.
    note : callable
        Called with one line for each remark: repairs in a file, inputs that stay at their start
        value.

    Raises
    ------
    UserError
        If the experiment does not fit its subject.
    """
    if experiment.variants:
        raise UserError(f"{where}: variants are run side by side (ppy run), and nowhere else")
    defaults: dict[str, Any] = {
        "duration": experiment.duration or subject.duration,
        "step": experiment.step or subject.step,
    }
    if experiment.system:
        defaults["master"] = experiment.master or Master()
    complete = experiment.model_copy(update=defaults)
    time = points(complete, where, subject.start)
    with error_context(where):
        settings = dict(subject.settings) | _resolve_settings(complete, subject)
        inputs = _make_stimuli(
            complete, subject, settings, time - time[0], lambda line: note(f"{where}: {line}")
        )
        record = _recorded_outputs(complete, subject)
        recorded = {output: subject.outputs[output] for output in record}
        noise = {
            output: _make_noise(output, table, complete, recorded.get(output), time.size)
            for output, table in complete.noise.items()
        }
        signals = {name: subject.driven[name] for name in inputs} | recorded
        if complete.over != "time":
            find(complete.over, signals, "over: nothing recorded")
        if complete.work_loop:
            _check_work_loop(complete.work_loop, subject, time, inputs, signals)
    for name, signal in subject.inputs.items():
        if name not in inputs:
            start = format_value(signal.start, signal)
            note(f"no values for the input {name}; it stays at {start}")
    for name, signal in subject.open_inputs.items():
        if name not in settings:
            note(checking.describe_open_input(name, signal))
    return Preparation(complete, subject, time, settings, inputs, noise, record)


def _check_work_loop(
    table: WorkLoopTable,
    subject: Subject,
    time: Array,
    inputs: Signals,
    signals: Mapping[str, Signal],
) -> None:
    """Raise UserError if signals of the loop are missing, or force or reference is not periodic."""
    for key, name in table.signals.items():
        if key not in ("force", "reference"):
            find(name, signals, f"work_loop.{key}: no output recorded")
    step = time[1] - time[0]
    if table.period < _FEWEST_STEPS * step:
        raise UserError(
            f"work_loop.period = {table.period:g} s: must be at least {_FEWEST_STEPS} steps of"
            f" {step:g} s"
        )
    later = time[time >= time[0] + table.period]  # points with another one a period before
    for key in ("force", "reference"):
        name = getattr(table, key)
        values = find(name, inputs, f"work_loop.{key}: no input driven")
        change = np.interp(later, time, values) - np.interp(later - table.period, time, values)
        if np.abs(change).max(initial=0.0) > _PERIODIC * np.ptp(values):
            raise UserError(
                f"work_loop.period = {table.period:g} s: {name} is not the same again after that"
                " time, as a loop has to be"
            )
    for key, name in table.signals.items():
        convert(0.0, signals[name].unit, UNITS_OF_LOOP[key], f"work_loop.{key}: {name}")
    for key, name in table.coupling.parameters.items() if table.coupling else ():
        find(name, subject.parameters, f"work_loop.coupling.{key}: no parameter")


def _recorded_outputs(experiment: Experiment, subject: Subject) -> list[str]:
    """Return the outputs to record, each once, without the inputs, which are always recorded."""
    wanted = subject.recorded_by_default if experiment.record is None else experiment.record
    outputs = [name for name in wanted if name not in subject.inputs]
    for name in outputs:
        find(name, subject.outputs, "record: no output")
    return list(dict.fromkeys(outputs))


def points(experiment: Experiment, where: str, start: float = 0.0) -> Array:
    """Return the communication points (n,) in s; UserError if step and duration give none."""
    end = start + (experiment.duration or 0.0)
    with error_context(where):
        return simulate.grid(start, end, experiment.step or 0.0)


def _resolve_settings(experiment: Experiment, subject: Subject) -> dict[str, Value]:
    """Return the parameters that an experiment sets, in the FMU's units."""
    values = {}
    for key, stated in experiment.parameters.items():
        name, given = key, stated
        if key not in subject.parameters and isinstance(stated, str):
            name, given = split_assignment(f"{key}={stated}", subject.parameters) or (key, stated)
        if name in subject.why_not_settable:
            raise UserError(f"parameters.{name}: it is an input; {subject.why_not_settable[name]}")
        if name not in subject.parameters:
            near = suggestion(name, [*subject.parameters, *Experiment.model_fields])
            raise UserError(f"{subject.name} has no parameter named {name!r}{near}")
        signal = subject.parameters[name]
        here = f"parameters.{name} = {given}"
        if signal.type == "string":
            is_text(signal.type, given, here)
        text = str(given).lower() if isinstance(given, bool) else str(given)
        values[name] = read_setting(text, signal, here)
    return values


def _make_stimuli(
    experiment: Experiment,
    subject: Subject,
    settings: Mapping[str, Value],
    time: Array,
    note: Callable[[str], None],
) -> dict[str, Array]:
    """Return the stimuli by input."""
    values = {}
    for name in experiment.inputs:
        signal = find(name, subject.driven, f"{subject.name} has no input")
        if name in experiment.parameters:
            raise UserError(
                f"{name} is given by parameters.{name} and by inputs.{name}; one is needed"
            )
        start = float(settings.get(name, signal.start)) if name in subject.tunable else 0.0
        values[name] = stimulus_values(experiment, name, signal.unit, time, note, start=start)
        check_values(signal, values[name], f"inputs.{name}")
    return values


def stimulus_values(
    experiment: Experiment,
    name: str,
    unit: str,
    time: Array,
    note: Callable[[str], None],
    *,
    start: float = 0.0,
) -> Array:
    """Return the stimulus of an input at the communication points.

    Parameters
    ----------
    experiment : Experiment
    name, unit : str
        Name and unit of the input.
    time : ndarray, shape (n,)
        Communication points in s since the first.
    note : callable
        Called with a line for each repair in a file.
    start : float
        Value before a first step, in the unit of the input.

    Returns
    -------
    ndarray, shape (n,)
        In the unit of the input.

    Raises
    ------
    UserError
        If a unit does not fit the input, or the values of its keys are not allowed.
    """
    here = f"inputs.{name}"
    driven = DrivenInput(name, unit, _seed(experiment, name), start)
    with error_context(here):
        values = experiment.inputs[name].values(time, driven)
    for line in driven.notes:
        note(f"{here}: {line}")
    return values


def check_values(signal: Signal, values: Array, where: str) -> None:
    """Raise UserError if values are out of the range of a signal, or not of its type."""
    for extreme in (values.min(), values.max()):
        if not signal.min <= extreme <= signal.max:
            raise UserError(
                f"{where}: {format_value(extreme, signal)} is out of range; allowed is"
                f" {format_range(signal)}"
            )
    if signal.type != "real":
        for value in np.unique(values):
            check_type(signal.type, value, where)


def _seed(experiment: Experiment, name: str, stream: int = 0) -> tuple[int, ...]:
    """Return the seed of a signal's random numbers, which depends on no other signal."""
    return experiment.seed, zlib.crc32(name.encode()), stream


def _make_noise(
    name: str,
    noise: NoiseTable,
    experiment: Experiment,
    signal: Signal | None,
    count: int,
) -> Array:
    """Return noise (count,), white or AR(1), stationary from its first value on.

    UserError if `signal`, the output of that name, is None, as it is not recorded.
    """
    if signal is None:
        raise UserError(f"noise.{name}: noise is added to recorded outputs, and this is none")
    rms = noise.rms.to(signal.unit, f"noise.{name}.rms = {noise.rms.value:g} {noise.rms.unit}")
    if rms < 0.0 or signal.type != "real":
        raise UserError(f"noise.{name}.rms = {rms:g}: needs a real output, and 0 or more")
    fresh = np.random.default_rng(_seed(experiment, name, _NOISE_STREAM)).standard_normal(count)
    # AR(1) x[k] = a x[k-1] + e[k] is stationary with variance 1 if var e = 1 - a^2 and var x[0] = 1
    fresh[1:] *= np.sqrt(1.0 - noise.correlation**2)
    from scipy.signal import lfilter  # half a second to load, which few experiments need

    return rms * np.asarray(lfilter([1.0], [1.0, -noise.correlation], fresh))
