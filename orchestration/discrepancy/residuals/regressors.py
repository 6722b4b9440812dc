"""Regressors of a residual: inputs, states, time, and squares, rates and integrals made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset
from orchestration.records.runs import join_records

_RUNAWAY = 1e30  # beyond which nothing is measured; below, squares are numbers
_CONSTANT = 1e-9  # of a signal's size; what varies less does not vary


class RegressorKind(StrEnum):
    """Transformation of a signal, as it is written about the name of the signal."""

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
        """Name of the signal with its transformation, like ``"rate of charge"``."""
        return self.kind.value.format(self.signal)


def simulate_regressors(model: FittedCandidate, data: Dataset) -> list[Regressor]:
    """Simulate a fitted model over a record and make regressors of its signals, run by run.

    Rates and integrals are of one run, whatever was before it.

    Parameters
    ----------
    model : FittedCandidate
    data : Dataset

    Returns
    -------
    list of Regressor
        As :func:`make_regressors` has them.
    """
    layout = model.candidate.cls.layout
    units = {v.name: v.unit for v in (*layout.inputs, *layout.states, *layout.measured_outputs)}
    problem = model.problem
    simulated = problem.model.run(  # as accurately as it was fitted
        data.time, data.inputs, model.parameters, runs=data.runs, tolerance=problem.tolerance
    ).signals
    by_run = []
    for run in data.runs:
        inputs = {name: u[run.samples] for name, u in data.inputs.items()}
        states = {v.name: simulated[v.name][run.samples] for v in layout.states}
        outputs = {v.name: simulated[v.name][run.samples] for v in layout.measured_outputs}
        time = data.time[run.samples] - run.ahead
        by_run.append(_transformed(time, inputs, states, outputs, units))
    joined = []
    for parts in zip(*by_run, strict=True):
        whole = join_records(len(data.time), data.runs, [part.values for part in parts])
        joined.append(replace(parts[0], values=whole))
    return _varying(joined)


def make_regressors(
    time: Array,
    inputs: Mapping[str, Array],
    states: Mapping[str, Array],
    outputs: Mapping[str, Array],
    units: Mapping[str, str],
) -> list[Regressor]:
    """Make regressors of the signals of a model.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs, states, outputs : Mapping of str to ndarray, shape (n,)
        Of the model, not measured: what a sensor adds to an output would correlate with its own
        residual.
    units : Mapping of str to str
        Of all of them.

    Returns
    -------
    list of Regressor
        Inputs, the integrals of their moduli, states, their squares and rates, the moduli of the
        rates of outputs, and time; without those that do not vary.
    """
    return _varying(_transformed(time, inputs, states, outputs, units))


def _transformed(
    time: Array,
    inputs: Mapping[str, Array],
    states: Mapping[str, Array],
    outputs: Mapping[str, Array],
    units: Mapping[str, str],
) -> list[Regressor]:
    """Return all signals with their transformations, whether they vary or not."""
    result = []
    for name, values in inputs.items():
        integral = np.concatenate([[0.0], np.cumsum(np.abs(values[:-1]) * np.diff(time))])
        unit = _product(units[name], "s")
        result.append(Regressor(name, values, units[name]))
        result.append(Regressor(name, integral, unit, RegressorKind.INTEGRAL_OF_MODULUS))
    for name, values in states.items():
        squared = "" if units[name] == "1" else f"{units[name]}²"
        rate = np.gradient(values, time)
        result.append(Regressor(name, values, units[name]))
        result.append(Regressor(name, values**2, squared, RegressorKind.SQUARE))
        result.append(Regressor(name, rate, _product(units[name], "1/s"), RegressorKind.RATE))
    for name, values in outputs.items():
        speed = np.abs(np.gradient(values, time))
        result.append(Regressor(name, speed, _product(units[name], "1/s"), RegressorKind.SPEED))
    result.append(Regressor("time", time, "s"))
    return result


def _varying(signals: Sequence[Regressor]) -> list[Regressor]:
    """Return the signals that vary, without those that run away unseen by any output."""
    sizes = [float(np.max(np.abs(s.values))) for s in signals]
    return [
        signal
        for signal, size in zip(signals, sizes, strict=True)
        if size < _RUNAWAY and np.ptp(signal.values) > _CONSTANT * size
    ]


def _product(unit: str, factor: str) -> str:
    """Return the unit of a signal multiplied by a time or a frequency."""
    plain = "" if unit == "1" else unit
    if factor == "1/s":
        return f"{plain}/s" if plain else factor
    return f"{plain}·{factor}".removeprefix("·")
