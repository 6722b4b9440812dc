"""Tunable parameters that are moved by hand in a run in real time, between its steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from math import isfinite
from threading import Lock
from typing import Any

from fmus.kit.arrays import Array
from fmus.kit.errors import UserError, find
from fmus.kit.units import format_range, format_value
from orchestration.experiment.model import Experiment
from orchestration.experiment.preparation import Preparation
from orchestration.experiment.stimulus import FromFile, Steps
from orchestration.experiment.subjects import Subject
from orchestration.experiment.waveforms import approach
from orchestration.fmu import Signal

RAMP = 5.0  # s that a change takes without a slew rate of its own: an operator sees what it does


@dataclass
class _Parameter:
    """A parameter that is moved: its values (n,) at all points, of which the next is written."""

    signal: Signal
    values: Array
    target: float
    slew: float = 0.0


class Tuner:
    """Parameters of a run and where they are to go; any thread may call its methods.

    Parameters
    ----------
    names : sequence of str
        Tunable parameters, in a system ``member.name``.

    Attributes
    ----------
    names : sequence of str
    changes : list of dict
        What was asked for: ``time`` in the run in s, ``wall`` time, ``name``, ``old`` and ``new``
        value and ``slew`` rate per second in the FMU's units, and ``by`` whom.
    """

    def __init__(self, names: Sequence[str] = ()):
        self.names = names
        self.changes: list[dict[str, Any]] = []
        self._lock = Lock()
        self._parameters: dict[str, _Parameter] = {}
        self._time: list[float] = []
        self._point = 0

    def added_to(self, experiment: Experiment, subject: Subject) -> Experiment:
        """Return an experiment in which the parameters are driven, from their own values.

        Raises
        ------
        UserError
            If one is not tunable, is no real number or is moved by the experiment already.
        """
        start = dict(experiment.parameters)
        driven = dict(experiment.inputs)
        for name in self.names:
            signal = find(name, subject.tunable, f"{subject.name} has no tunable parameter")
            if signal.type != "real" or name in driven:
                reason = "moved by the experiment" if name in driven else signal.type
                raise UserError(f"--tunable {name}: it is {reason}")
            table: dict[str, Any] = {
                "kind": "steps",
                "times": [],
                "levels": [],
                "initial": start.pop(name, None),
            }
            driven[name] = Steps.model_validate(table)
        return experiment.model_copy(update={"parameters": start, "inputs": driven})

    def begin(self, prepared: Preparation) -> Preparation:
        """Begin to move the parameters of a run; its result repeats it with their values."""
        self._time = prepared.time.tolist()
        for name in self.names:
            values = prepared.inputs[name]
            signal = prepared.subject.tunable[name]
            self._parameters[name] = _Parameter(signal, values, float(values[0]))
        recorded = dict.fromkeys(self.names, FromFile(kind="file", file="result.nc"))
        inputs = prepared.experiment.inputs | recorded
        return replace(
            prepared, experiment=prepared.experiment.model_copy(update={"inputs": inputs})
        )

    def advance(self, k: int) -> None:
        """Write the values of the point after `k`, the present one."""
        if k + 1 >= len(self._time):
            return
        step = self._time[k + 1] - self._time[k]
        with self._lock:
            self._point = k + 1
            for one in self._parameters.values():
                value = float(one.values[k])
                one.values[k + 1] = approach(value, one.target, one.slew * step)

    def move(self, name: str, value: float, slew: float | None, by: str) -> str:
        """Move a parameter from the next point on.

        Parameters
        ----------
        name : str
        value : float
            In the FMU's unit.
        slew : float or None
            Largest change per second; by default the change takes :data:`RAMP`.
        by : str
            Who asks for it.

        Returns
        -------
        str
            A line that says so.

        Raises
        ------
        UserError
            If there is no such parameter in the run, or a number is not allowed.
        """
        with self._lock:
            one = find(name, self._parameters, "this run has no parameter to tune")
            signal = one.signal
            if not (isfinite(value) and signal.min <= value <= signal.max):
                raise UserError(f"{name} = {value:g}: allowed is {format_range(signal)}")
            if slew is not None and not (isfinite(slew) and slew > 0.0):
                raise UserError(f"{name}: slew = {slew:g} per second: must be above 0")
            old = float(one.values[self._point])
            one.target = value
            one.slew = abs(value - old) / RAMP if slew is None else slew
            change = {"time": self._time[self._point], "wall": datetime.now(UTC).isoformat()}
            change |= {"name": name, "old": old, "new": value, "slew": one.slew, "by": by}
            self.changes.append(change)
        values = f"from {format_value(old, signal)} to {format_value(value, signal)}"
        return f"{name} {values}, {one.slew:.4g} per s, at {change['time']:.10g} s, by {by}"

    def state(self) -> Mapping[str, Mapping[str, Any]]:
        """Return what a client shows of each parameter: value, target, unit, limits, meaning."""
        with self._lock:
            return {
                name: {
                    "value": float(one.values[self._point]),
                    "target": one.target,
                    "unit": one.signal.unit,
                    "min": one.signal.min if isfinite(one.signal.min) else None,
                    "max": one.signal.max if isfinite(one.signal.max) else None,
                    "doc": one.signal.doc,
                }
                for name, one in self._parameters.items()
            }
