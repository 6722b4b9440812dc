"""The tests of an actuator in the thesis: how their records look, and their graphical readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from demonstrations.graphical import (
    GraphicalEstimate,
    read_circuit,
    read_creep,
    read_loops,
    resampled,
)
from fmus.kit import UserError
from fmus.kit.arrays import Array, Indices
from orchestration.records import Record

Estimates = Mapping[str, GraphicalEstimate]
_QUIET = 0.013  # A, 1 % of the galvanostat's range
_BEFORE = 10.0  # durations of a test for which its load had been as at the first sample
_FLAT = 0.05  # of a level or a range: largest deviation of what is constant
_EVEN = 0.1  # of the mean: largest deviation of the intervals of what is periodic
CIRCUIT = {"R1": "ohm", "R2": "ohm", "C": "F"}  # units by parameter
_CYCLES = 2  # of a triangle at least
_BURGERS = {"k1": "N/m", "b1": "N*s/m", "k2": "N/m", "b2": "N*s/m"}


@dataclass(frozen=True)
class Kind:
    """A test of the thesis.

    Attributes
    ----------
    title : str
    source : str
        Where the thesis has it.
    tells : tuple of str
        Parameters that a record of it determines, if it has the outputs that they act on.
    advice : str
        How to make one that determines them.
    recognises : callable
        Whether a record is one.
    read : callable
        Returns what is read off a record; its second argument has the circuit, SI, as far as it is
        known. It raises UserError if nothing can be read.
    as_driven : callable
        Returns a record with what its inputs did before its samples and between them.
    """

    title: str
    source: str
    tells: tuple[str, ...]
    advice: str
    recognises: Callable[[Record], bool]
    read: Callable[[Record, Mapping[str, float]], Estimates]
    as_driven: Callable[[Record], Record] = lambda record: record


def kind_of(record: Record) -> Kind | None:
    """Return the test that a record is; None if it looks like none of them."""
    return next((kind for kind in KINDS if kind.recognises(record)), None)


# --- how a record looks
# --------------------------------------------------------------------------------------------------


def _is_held_force(record: Record) -> bool:
    is_quiet = np.abs(_signal(record, "current")).max() <= _QUIET
    is_step = len(_switches(_signal(record, "force"))) == 1
    return bool("displacement" in record.signals and is_quiet and is_step)


def _is_held_voltage(record: Record) -> bool:
    if not {"current", "voltage"} <= record.signals.keys():
        return False
    _, current, voltage = _held_part(record)
    is_held = np.nanstd(voltage) <= _FLAT * abs(np.nanmean(voltage))
    return bool(is_held and np.ptp(current) > _FLAT * np.abs(current).max())


def _is_triangle(record: Record) -> bool:
    between = np.diff(record.time[_switches_of_current(record)])
    if "displacement" not in record.signals or between.size < 2 * _CYCLES - 1:
        return False
    return bool(np.abs(between - between.mean()).max() <= _EVEN * between.mean())


def _is_prbs(record: Record) -> bool:
    return "voltage" in record.signals and len(_switches_of_current(record)) >= 2 * _CYCLES


def _signal(record: Record, name: str) -> Array:
    """Return a signal (n,); zero if it was not recorded, as the input of a model then is."""
    return record.signals.get(name, np.zeros_like(record.time))


def _switches_of_current(record: Record) -> Indices:
    """Return the switches of the current, counted from its first sample after a rest."""
    current = _signal(record, "current")
    is_driven = np.abs(current) > 0.5 * np.abs(current).max()
    return _switches(np.trim_zeros(np.where(is_driven, current, 0.0)))


def _switches(signal: Array) -> Indices:
    """Return the first sample after each change between two levels; none if there are others."""
    height = signal - signal.min(initial=np.inf)
    span = height.max(initial=0.0)
    if (np.minimum(height, span - height) > _FLAT * span).any():
        return np.zeros(0, dtype=np.intp)
    return np.flatnonzero(np.diff(height > 0.5 * span)) + 1


def _held_part(record: Record) -> tuple[Array, Array, Array]:
    """Return time, current and voltage from the first sample at a voltage that is held."""
    voltage = record.signals["voltage"]
    first = np.argmax(np.abs(voltage) > 0.5 * np.nanmax(np.abs(voltage)))
    return record.time[first:], record.signals["current"][first:], voltage[first:]


# --- how it is driven
# --------------------------------------------------------------------------------------------------


def _after_rest(record: Record) -> Record:
    """Return a record of a step of the load after a time under the load that it begins with.

    A record tells the creep of its step only if the creep of the load before has ended.
    """
    before = record.time[0] - _BEFORE * np.ptp(record.time)
    first = np.zeros(1, dtype=int)
    return _with_rows(record, first, np.array([before]), _signal(record, "current")[first])


def _between_samples(record: Record) -> Record:
    """Return a record of a held voltage with its current between samples, by Simpson's rule.

    This current is an answer: held from sample to sample, it would move more charge than was moved,
    by half a sample period of what it falls by.
    """
    time, current, _ = _held_part(record)
    sixth = np.diff(time) / 6.0
    middle = CubicSpline(time, current)(time[:-1] + 3.0 * sixth)
    rows = np.repeat(np.arange(record.time.size - sixth.size, record.time.size), 2)
    times = np.column_stack([time[:-1] + sixth, time[1:] - sixth])
    return _with_rows(record, rows, times.ravel(), np.column_stack([middle, current[1:]]).ravel())


def _with_rows(record: Record, rows: Indices, times: Array, current: Array) -> Record:
    """Return a record with rows before others, of which they have the load and no output."""
    signals = {name: np.insert(values, rows, np.nan) for name, values in record.signals.items()}
    inputs = {"current": current, "force": _signal(record, "force")[rows]}
    for name in inputs.keys() & signals.keys():
        signals[name] = np.insert(record.signals[name], rows, inputs[name])
    return replace(record, time=np.insert(record.time, rows, times), signals=signals)


# --- what is read off it
# --------------------------------------------------------------------------------------------------


def _read_held_force(record: Record, circuit: Mapping[str, float]) -> Estimates:
    """Read the Burgers parameters off the creep (eqs. 3.1 to 3.3)."""
    time, force = record.time, record.signals["force"]
    measured = record.signals["displacement"]
    step = _switches(force)[0]
    is_before = time < time[step]
    before, after = force[is_before].mean(), force[~is_before].mean()
    since = time - time[step]

    def read(displacement: Array) -> Sequence[float]:
        return [*read_creep(time, force, displacement).values.values()]

    def draw(values: Sequence[float]) -> Array:
        k1, b1, k2, b2 = values
        crept = (after - before) * (1.0 / k1 - np.expm1(-np.maximum(since, 0.0) * k2 / b2) / k2)
        curve = np.where(is_before, before / b1 * since, crept + after / b1 * since)
        return np.asarray(curve + (measured - curve)[is_before].mean())

    return _estimates(read, draw, measured, _BURGERS)


def _read_held_voltage(record: Record, circuit: Mapping[str, float]) -> Estimates:
    """Read the circuit off the current, V/R2 + V/R1 exp(-t/(R1 C)) (fig. 3-1).

    Its end gives R2, its first sample R1, and the area between it and its end the charge C V.
    """
    time, current, voltage = _held_part(record)
    level = float(np.nanmean(voltage))

    def read(i: Array) -> Sequence[float]:
        end = float(i[-(i.size // 3) :].mean())
        if not (i[0] / level > end / level > 0.0):
            raise UserError("current: does not fall towards a leakage while the voltage is held")
        return [level / (i[0] - end), level / end, float(np.trapezoid(i - end, time)) / level]

    def draw(values: Sequence[float]) -> Array:
        R1, R2, C = values
        return np.asarray(level / R2 + level / R1 * np.exp(-(time - time[0]) / (R1 * C)))

    return _estimates(read, draw, current, CIRCUIT)


def _read_triangle(record: Record, circuit: Mapping[str, float]) -> Estimates:
    """Read the displacement per charge off the slope of their loops (fig. 3-10, eq. 3.4)."""
    current = record.signals["current"]
    is_above = current > 0.5 * (current.min() + current.max())
    switches = record.time[1:][np.diff(is_above)]
    period = 2.0 * float(np.diff(switches).mean())
    charge = _charge(record.time, current, circuit)
    start = float(switches[0] - record.time[0])
    loops = read_loops(
        record.time, charge, record.signals["displacement"], period, start=start, drift=True
    )
    return {"alpha": loops.slope}


def _charge(time: Array, current: Array, circuit: Mapping[str, float]) -> Array:
    """Return the charge (n,) of a held current, by the circuit where that is known (eq. 3.5)."""
    step = float(np.diff(time).mean())
    gain, decay = step, 1.0
    if circuit:
        R1, R2, C = (circuit[name] for name in CIRCUIT)
        decay = float(np.exp(-step / ((R1 + R2) * C)))
        gain = R2 * C * (1.0 - decay)
    return np.asarray(lfilter([0.0, gain], [1.0, -decay], current))


def _read_prbs(record: Record, circuit: Mapping[str, float]) -> Estimates:
    """Read the circuit off the record by an output-error model (eqs. 3.9 to 3.13)."""
    found = read_circuit(record.time, record.signals["current"], record.signals["voltage"])
    last = found.windows[-1].output_error
    if not last.exists:
        raise UserError("no circuit of R1, R2 and C behaves so")
    return {name: getattr(last, name) for name in CIRCUIT}


def _estimates(
    read: Callable[[Array], Sequence[float]],
    draw: Callable[[Sequence[float]], Array],
    measured: Array,
    units: Mapping[str, str],
) -> Estimates:
    """Return what is read off a signal, with intervals, by the names that have units."""
    return dict(zip(units, resampled(read, draw, measured, [*units.values()]), strict=True))


KINDS = (
    Kind(
        "held force with creep",
        "thesis section 3.1.2",
        tuple(_BURGERS),
        "no current, one step of the load, held for at least six time constants of the creep",
        _is_held_force,
        _read_held_force,
        _after_rest,
    ),
    Kind(
        "held voltage",
        "thesis section 2.3",
        tuple(CIRCUIT),
        "a step of the voltage, held until the current no longer falls",
        _is_held_voltage,
        _read_held_voltage,
        _between_samples,
    ),
    Kind(
        "triangle of charge",
        "thesis section 3.3.1, fig. 3-10",
        ("alpha", *CIRCUIT),
        "a square wave of the current under a constant load, ten cycles or more",
        _is_triangle,
        _read_triangle,
    ),
    Kind(
        "PRBS",
        "thesis section 3.1.4",
        (*CIRCUIT, "alpha"),
        "a pseudorandom binary current, longer than several (R1 + R2) C",
        _is_prbs,
        _read_prbs,
    ),
)
"""In the order in which a record is held against them."""
HELD_VOLTAGE = KINDS[1]
