"""Signals that a residual may depend on: inputs, states, their squares and rates, what has gone through, time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.records.joined import joined

Array = NDArray[np.float64]
_CONSTANT = 1e-9  # of a signal's size; what varies less does not vary


class RegressorKind(StrEnum):
    """What is made of a signal, as its name says it."""

    VALUE = "{}"
    INTEGRAL_OF_MODULUS = "integral of |{}|"
    SQUARE = "square of {}"
    RATE = "rate of {}"
    SPEED = "speed of {}"  # the modulus of the rate


@dataclass(frozen=True)
class Regressor:
    """A signal that a residual may depend on.

    Attributes
    ----------
    signal : str
    values : ndarray, shape (n,)
        At every sample of the record.
    unit : str
    kind : RegressorKind
    """

    signal: str
    values: Array
    unit: str
    kind: RegressorKind = RegressorKind.VALUE

    @property
    def name(self) -> str:
        """Name of the signal with what was made of it, like ``"rate of charge"``."""
        return self.kind.value.format(self.signal)


def regressors_of(model: FittedCandidate, data: Dataset) -> list[Regressor]:
    """Signals of a fitted model over a record: its inputs, its states and how fast its outputs move."""
    layout = model.candidate.cls.layout
    units = {v.name: v.unit for v in (*layout.inputs, *layout.states, *layout.outputs)}
    values = model.problem.start | model.fit.values
    simulated = model.problem.model.run(data.time, data.inputs, values, runs=data.runs).signals
    each = []
    for (
        run
    ) in data.runs:  # rates and integrals are of one run: what was before it tells nothing of it
        states, outputs = (
            {v.name: simulated[v.name][run.samples] for v in group}
            for group in (layout.states, layout.outputs)
        )
        inputs = {name: values[run.samples] for name, values in data.inputs.items()}
        each.append(_all(data.time[run.samples] - run.ahead, inputs, states, outputs, units))
    whole = [
        replace(parts[0], values=joined(len(data.time), data.runs, [part.values for part in parts]))
        for parts in zip(*each, strict=True)
    ]
    return _varying(whole)


def regressors(
    time: Array,
    inputs: Mapping[str, Array],
    states: Mapping[str, Array],
    outputs: Mapping[str, Array],
    units: Mapping[str, str],
) -> list[Regressor]:
    """Gather what a residual may depend on.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs, states, outputs : Mapping of str to ndarray, shape (n,)
        Of the model, not measured: what a sensor adds to an output would correlate with its own residual.
    units : Mapping of str to str
        Of all of them.

    Returns
    -------
    list of Regressor
        Inputs, the integrals of their moduli, states, their squares and rates, the moduli of the rates of outputs, and
        time; without those that do not vary.
    """
    return _varying(_all(time, inputs, states, outputs, units))


def _all(
    time: Array,
    inputs: Mapping[str, Array],
    states: Mapping[str, Array],
    outputs: Mapping[str, Array],
    units: Mapping[str, str],
) -> list[Regressor]:
    result = []
    for name, values in inputs.items():
        through = np.concatenate([[0.0], np.cumsum(np.abs(values[:-1]) * np.diff(time))])
        result += [
            Regressor(name, values, units[name]),
            Regressor(name, through, _times(units[name], "s"), RegressorKind.INTEGRAL_OF_MODULUS),
        ]
    for name, values in states.items():
        squared = "" if units[name] == "1" else f"{units[name]}²"
        result += [
            Regressor(name, values, units[name]),
            Regressor(name, values**2, squared, RegressorKind.SQUARE),
            Regressor(
                name, np.gradient(values, time), _times(units[name], "1/s"), RegressorKind.RATE
            ),
        ]
    for name, values in outputs.items():
        speed = np.abs(np.gradient(values, time))
        result.append(Regressor(name, speed, _times(units[name], "1/s"), RegressorKind.SPEED))
    result.append(Regressor("time", time, "s"))
    return result


def _varying(signals: Sequence[Regressor]) -> list[Regressor]:
    return [s for s in signals if np.ptp(s.values) > _CONSTANT * np.max(np.abs(s.values))]


def _times(unit: str, by: str) -> str:
    plain = "" if unit == "1" else unit
    if by == "1/s":
        return f"{plain}/s" if plain else by
    return f"{plain}·{by}".removeprefix("·")
