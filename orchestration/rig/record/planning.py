"""Plan of a recording: an experiment checked against a rig, before anything moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from fmus.kit import registry
from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, error_context, suggestion
from fmus.rig_proxy import LOCKSTEP, describe_latch
from orchestration.experiment import Experiment
from orchestration.experiment.preparation import points, stimulus_values
from orchestration.rig.signals import checked_attributes

_PER_WATCHDOG = 3  # exchanges in the time after which the rig stops without one
# of the rig's period: a step that was written with three digits is meant to be the rig's
_FASTER = 0.98
_ROUNDING = 1e-9  # of a rate limit
_OLD = 2  # steps, after which a value is too old unless the user says otherwise


@dataclass(frozen=True)
class RecordingPlan:
    """The commands for a rig over time, and the outputs to record.

    Attributes
    ----------
    experiment : Experiment
        Experiment with the duration and step that are used.
    inputs : Mapping of str to str
        Units of all inputs of the rig, by name.
    outputs : Mapping of str to str
        Units of the outputs that are recorded, by name.
    time : ndarray, shape (n,)
        Times of the rows of the record, in s.
    values : ndarray, shape (n, number of inputs)
        Commands in the rig's units, each held from its row to the next.
    exchanges : int
        Number of exchanges with the rig in each step, evenly spaced.
    period, watchdog : float
        Period and watchdog time of the rig, in s.
    limits : Mapping
        Limits of the rig, as it states them.
    max_age : float
        Largest age in s of a value that is recorded.
    attributes : Mapping
        Numbers and texts that describe a signal, by signal and name.
    """

    experiment: Experiment
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    time: Array
    values: Array
    exchanges: int
    period: float
    watchdog: float
    limits: Mapping[str, Mapping[str, float | None]]
    max_age: float
    attributes: Mapping[str, Mapping[str, float | str]]

    @property
    def interval(self) -> float:
        """Time between two exchanges, s."""
        return float(self.time[1] - self.time[0]) / self.exchanges


def plan_recording(
    experiment: Experiment,
    rig: Mapping[str, Any],
    where: str,
    rate: float | None = None,
    max_age: float | None = None,
    note: Callable[[str], None] = lambda text: None,
) -> RecordingPlan:
    """Plan an experiment on a rig.

    Parameters
    ----------
    experiment : Experiment
    rig : Mapping
        The message ``status`` of its server.
    where : str
        File or name of the experiment, for messages.
    rate : float, optional
        Rows a second; default those of the experiment.
    max_age : float, optional
        Largest age in s of a recorded value; default two steps.
    note : callable
        Called with a line for every remark.

    Returns
    -------
    RecordingPlan

    Raises
    ------
    UserError
        If the rig cannot be used, an input is missing, unknown, in another unit, or beyond a
        limit of the rig, or the rig samples more slowly than is to be recorded.
    """
    _check_state(rig)
    step = _checked_step(experiment, rig, where, rate)
    if experiment.duration is None:
        raise UserError(
            f"{where}: duration is missing, and without a model there is no default (--set"
            " duration=20s)"
        )
    planned = experiment.model_copy(update={"step": step})
    time = points(planned, where)
    _check_signals(planned, rig, where)
    with error_context(where):
        columns = {
            name: stimulus_values(planned, name, unit, time, lambda x: note(f"{where}: {x}"))
            for name, unit in rig["inputs"].items()
        }
    exchanges = max(1, round(step / rig["period"]), ceil(_PER_WATCHDOG * step / rig["watchdog"]))
    for name, unit in rig["inputs"].items():
        limit = rig["limits"].get(name, {})
        _check_limits(columns[name], limit, step / exchanges, unit, f"{where}: inputs.{name}")
    return RecordingPlan(
        experiment=planned,
        inputs=rig["inputs"],
        outputs=_recorded_outputs(planned, rig, where, note),
        time=time,
        values=np.column_stack(list(columns.values())),
        exchanges=exchanges,
        period=rig["period"],
        watchdog=rig["watchdog"],
        limits=rig["limits"],
        max_age=_OLD * step if max_age is None else max_age,
        attributes=checked_attributes(rig.get("attributes", {})),
    )


def _check_state(rig: Mapping[str, Any]) -> None:
    """Refuse a rig that cannot be driven now: in lockstep, latched, in use, or without signals."""
    if rig["mode"] == LOCKSTEP:
        raise UserError(
            "the rig runs in lockstep, where time is the client's; a record needs one in real time"
        )
    if latch := describe_latch(rig):
        raise UserError(f"{latch} (ppy rig acknowledge releases it)")
    if rig["client"]:
        raise UserError(f"the rig has a client already: {rig['client']}")
    for key in ("period", "watchdog"):
        if not rig[key] > 0.0:
            raise UserError(f"the rig states a {key} of {rig[key]:g} s; it must be above 0")
    if not rig["inputs"] or not rig["outputs"]:
        raise UserError("the rig has nothing to drive or nothing to measure")


def _checked_step(
    experiment: Experiment, rig: Mapping[str, Any], where: str, rate: float | None
) -> float:
    """Return the time between two rows of the record (s), which the rig must be able to give."""
    step = experiment.step if rate is None else 1.0 / rate
    if step is None:
        raise UserError(
            f"{where}: step is missing, and without a model there is no default (--rate 10)"
        )
    if step < _FASTER * rig["period"]:
        fastest = 1.0 / rig["period"]
        raise UserError(
            f"{where}: {1.0 / step:.6g} rows a second are wanted, and the rig samples {fastest:.6g}"
            f" times a second; --rate {fastest:.4g} records as fast as it does"
        )
    return float(step)


def _check_signals(experiment: Experiment, rig: Mapping[str, Any], where: str) -> None:
    """Refuse inputs that rig or experiment lacks, and signals in other units than the rig's."""
    for name in experiment.inputs:
        if name not in rig["inputs"]:
            raise UserError(
                f"{where}: inputs.{name}: the rig has no such"
                f" input{suggestion(name, rig['inputs'])}"
            )
    for name, unit in rig["inputs"].items():
        if name not in experiment.inputs:
            raise UserError(
                f"{where}: the rig has the input {name} [{unit}], and the experiment does not say"
                f" what it gets (--set inputs.{name}=0)"
            )
    for name, unit in _declared_units(experiment).items():
        rig_unit = {**rig["outputs"], **rig["inputs"]}.get(name, unit)
        if rig_unit != unit:
            raise UserError(
                f"{where}: {name} is in {unit} in {experiment.component}, and in {rig_unit} on the"
                " rig"
            )


def _recorded_outputs(
    experiment: Experiment, rig: Mapping[str, Any], where: str, note: Callable[[str], None]
) -> dict[str, str]:
    """Return the units of the outputs that are to be recorded and that the rig measures.

    An experiment that names no outputs wants all of them.
    """
    wanted = [name for name in experiment.record or rig["outputs"] if name not in rig["inputs"]]
    for name in wanted:
        if name not in rig["outputs"]:
            note(f"the rig does not measure {name}; it is not recorded")
    outputs = {name: rig["outputs"][name] for name in wanted if name in rig["outputs"]}
    if not outputs:
        raise UserError(
            f"{where}: record: the rig measures nothing of it; it measures"
            f" {', '.join(rig['outputs'])}"
        )
    return outputs


def _declared_units(experiment: Experiment) -> dict[str, str]:
    """Return the units of the signals of the component that the experiment is written for.

    Empty for a component that is not known by name.
    """
    if experiment.component not in registry.components():
        return {}
    layout = registry.component(experiment.component).layout
    return {variable.name: variable.unit for variable in (*layout.inputs, *layout.outputs)}


def _check_limits(
    values: Array, limit: Mapping[str, float | None], interval: float, unit: str, where: str
) -> None:
    """Refuse values or changes of an input that are beyond the limits of the rig."""
    low = limit.get("min")
    high = limit.get("max")
    rate = limit.get("rate")
    if low is not None and values.min() < low:
        raise UserError(
            f"{where}: goes down to {values.min():.6g} {unit}; the rig's limit is {low:g} {unit}"
        )
    if high is not None and values.max() > high:
        raise UserError(
            f"{where}: goes up to {values.max():.6g} {unit}; the rig's limit is {high:g} {unit}"
        )
    changes = np.diff(values, prepend=0.0)  # from rest
    largest = int(np.argmax(np.abs(changes)))
    if rate is not None and abs(changes[largest]) > rate * interval * (1.0 + _ROUNDING):
        raise UserError(
            f"{where}: changes by {changes[largest]:+.6g} {unit} at once (row {largest + 1},"
            f" commands come every {interval:.4g} s); the rig's limit is {rate:g} {unit}/s"
        )
