"""Readings: the ways in which a file may mean other values than those that were read from it."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum, unique
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, sosfiltfilt

from fmus.kit import UserError
from fmus.kit.arrays import Array
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Record, step_of

TIME = "time"
_PREFIXES = {"m": 1e-3, "k": 1e3, "u": 1e-6}
_WORDS = {"m": "thousandths", "k": "thousands", "u": "millionths"}
_PREFIXED = ("A", "V", "W", "N", "Pa", "ohm", "F", "H", "C", "J", "s", "m")
_RPM, _DEGREES = math.pi / 30.0, math.pi / 180.0
# By the unit of a variable: units in which laboratories write it, by their size in that unit.
_USUAL = {
    "rad": {"deg": _DEGREES, "revolutions": 2.0 * math.pi},
    "rad/s": {"rpm": _RPM, "deg/s": _DEGREES, "Hz": 2.0 * math.pi},
    "Pa": {"bar": 1e5},
    "m": {"cm": 1e-2},
    "1": {"%": 1e-2},
    "C": {"A*h": 3600.0},
    "J": {"W*h": 3600.0},
    "m/s": {"km/h": 1.0 / 3.6},
    "N": {"kgf": 9.80665},
}
_PER_SECOND = {"min": 60.0, "h": 3600.0}
_CLOCKS = {"us": 1e-6, "ms": 1e-3, "min": 60.0, "h": 3600.0}
_ZERO_CELSIUS = 273.15
_ORDER = 2  # of a filter that is tried: one that is sharper leaves little else
_SMOOTH = 1e-3  # roughness of what was filtered at most
_NEAR_ZERO = 0.02  # of the largest value
_ACTS_LATE = "{column} acts {size} s later than it is recorded"


class _Kind(NamedTuple):
    """A way to misread a file, and the way to correct it: texts about a `Reading`.

    Attributes
    ----------
    fault, correction : str
    is_fitted : bool
        Whether its shift is estimated.
    """

    fault: str
    correction: str
    is_fitted: bool = False


@unique
class ReadingKind(Enum):
    """One kind of misreading of a file."""

    SIGN = _Kind("{column} has the opposite sign", "{change}")
    UNIT = _Kind("{column} is {unit}", "{change}, or write its unit in the header")
    OFFSET = _Kind("{column} is {size}{unit} too {level}", "{change}", True)
    EXCHANGED = _Kind(
        "{column} and {other} are exchanged", "exchange the names of {column} and {other}"
    )
    CLOCK = _Kind(f"{TIME} is {{unit}}", "{change}, or write its unit in the header")
    LATE = _Kind("{columns} {are} {size} s {side}", "shift {columns} {size} s {back}", True)
    PACE = _Kind(
        "{columns} {are} recorded by a clock that is {percent} {pace} than that of the inputs",
        "give {columns} the times of the other clock",
        True,
    )
    RATE = _Kind("{columns} {are} the derivative in time of the signal", "integrate {columns}")
    INTEGRAL = _Kind(
        "{columns} {are} the integral over time of the signal", "differentiate {columns}"
    )
    UNSIGNED = _Kind("{columns} lost the sign", "record {columns} with the sign")
    FILTERED = _Kind(
        "{columns} {are} filtered forwards and backwards, up to {size} Hz",
        "record {columns} without a filter, or filter the inputs in the same way",
        True,
    )


@dataclass(frozen=True)
class Reading:
    """A way to read a file: ``factor * value + shift`` in place of each value of a column.

    Attributes
    ----------
    kind : ReadingKind
    columns : tuple of str
        Inputs and outputs that it changes; two that are exchanged; ``time``.
    factor : float
    shift : float
        SI; of a late column its delay, s, negative of an early one; of a clock the share by which
        it is fast; of a filter its cut-off, Hz.
    unit : str
        That the file has, in words; of an offset the SI unit of its shift.
    levels : tuple of float
        Of each column where its signal begins, or about which it lost its sign, or which was
        taken off before it was integrated, SI.
    instead : tuple of Reading
        Others that a model cannot tell from it.
    is_command : bool
        Whether a late column is an input.
    """

    kind: ReadingKind
    columns: tuple[str, ...]
    factor: float = 1.0
    shift: float = 0.0
    unit: str = ""
    levels: tuple[float, ...] = ()
    instead: tuple[Reading, ...] = ()
    is_command: bool = False

    @property
    def source(self) -> tuple[ReadingKind, tuple[str, ...]]:
        """All but its values."""
        return self.kind, self.columns

    @property
    def cause(self) -> tuple[str, str]:
        """Kind and columns, as law and signal of a term."""
        return f"reading_{self.kind.name.lower()}", ",".join(self.columns)

    @property
    def is_fitted(self) -> bool:
        """True if its shift is estimated."""
        return self.kind.value.is_fitted

    @property
    def is_sized(self) -> bool:
        """True if it has values that are estimated."""
        return self.is_fitted or bool(self.levels)

    @property
    def dead_time(self) -> float:
        """Time, s, after which an input acts, if that is a property of the plant; else 0."""
        return max(-float(self.shift), 0.0) if self.is_command else 0.0

    @property
    def values(self) -> Array:
        """Values that are estimated: its levels, and its shift."""
        return np.array([*self.levels, *[self.shift] * self.is_fitted])

    def with_values(self, values: Array) -> Reading:
        """Return the reading with other `values`."""
        count = len(self.levels)
        shift = float(values[count]) if self.is_fitted else self.shift
        return replace(self, levels=tuple(values[:count].tolist()), shift=shift)

    def is_fed_by_output(self, model: LawModel) -> bool:
        """Return whether an input and an output are exchanged by it."""
        inputs = {v.name for v in model.inputs}
        return self.kind is ReadingKind.EXCHANGED and len(inputs.intersection(self.columns)) == 1

    def moves_inputs(self, model: LawModel) -> bool:
        """Return whether a run of the model is another one by it."""
        inputs = {v.name for v in model.inputs} | {TIME}
        is_of_inputs = self.kind is ReadingKind.FILTERED
        return is_of_inputs or not inputs.isdisjoint(self.columns)

    def apply(self, model: LawModel, record: Record) -> Record:
        """Return a record of the values that the file means.

        Not a number are inputs that follow from others, if these cannot be so.
        """
        read = self._applied(model, record)
        if not self.moves_inputs(model):
            return read
        try:
            return model.simulated(read)
        except UserError:
            return replace(read, inputs=np.full_like(read.inputs, np.nan))

    def _applied(self, model: LawModel, record: Record) -> Record:
        """Return a record with the columns and the clock that are meant."""
        if self.kind is ReadingKind.CLOCK:
            time = np.ascontiguousarray(record.time * self.factor)
            return replace(record, time=time, begin=record.begin * self.factor)
        if self.kind is ReadingKind.UNSIGNED:
            levels = dict(zip(self.columns, self.levels, strict=True))
            folds = [levels.get(v.name, np.nan) for v in model.outputs]
            return replace(record, folds=np.array(folds))
        if self.kind is ReadingKind.PACE:
            is_past = record.time > (1.0 + self.shift) * record.time[-1]
            outputs = np.where(is_past[:, np.newaxis], np.nan, record.outputs)
            return replace(record, outputs=outputs, pace=self.shift)
        if self.kind is ReadingKind.FILTERED:
            filtered = _filtered(record.inputs, record.time, self.shift)
            return replace(record, inputs=np.ascontiguousarray(filtered))
        names = [v.name for v in (*model.inputs, *model.outputs)]
        values = np.hstack([record.inputs, record.outputs])
        places = [names.index(name) for name in self.columns]
        if self.kind is ReadingKind.EXCHANGED:
            values[:, places] = values[:, places[::-1]]
        else:
            for number, place in enumerate(places):
                is_input = place < len(model.inputs)
                values[:, place] = self._meant(values[:, place], record.time, number, is_input)
        parts = np.split(values, [len(model.inputs)], axis=1)
        inputs, outputs = map(np.ascontiguousarray, parts)
        return replace(record, inputs=inputs, outputs=outputs)

    def _meant(self, values: Array, time: Array, number: int, is_input: bool) -> Array:
        """Return the values (n,) that are meant by those of one of its columns."""
        if self.kind is ReadingKind.LATE:
            return _earlier(values, time, self.shift, is_input=is_input)
        if self.kind in (ReadingKind.RATE, ReadingKind.INTEGRAL):
            known = np.isfinite(values)  # a gap is bridged, or the sum after it would be unknown
            own = values[known], time[known]
            change = _integral(*own) if self.kind is ReadingKind.RATE else _derivative(*own)
            meant = np.full(len(values), np.nan)
            meant[known] = self.levels[number] + change
            return meant
        return self.factor * values + self.shift

    def as_filed(self, model: LawModel, errors: Array, time: Array) -> Array:
        """Return errors of the outputs (n, ny) with those of a column that is late in its rows."""
        if self.kind is not ReadingKind.LATE:
            return errors
        is_late = [v.name in self.columns for v in model.outputs]
        columns = [
            _earlier(column, time, -self.shift, is_input=False) if late else column
            for column, late in zip(errors.T, is_late, strict=True)
        ]
        return np.column_stack(columns)

    @property
    def sentence(self) -> str:
        """The fault of the file, without its name."""
        return " or ".join(one._said(one._fault) for one in (self, *self.instead))

    @property
    def _fault(self) -> str:
        return _ACTS_LATE if self.dead_time else self.kind.value.fault

    @property
    def correction(self) -> str:
        """The way to correct the file."""
        return self._said(self.kind.value.correction)

    def _said(self, text: str) -> str:
        """Return a text of its kind about its columns and values."""
        column, other = (*self.columns, "", "")[:2]
        is_up = self.shift > 0.0
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        size = f"{abs(self.shift):.5g}"
        verb, toward = ("add", "to") if is_up else ("subtract", "from")
        shifted = f"{verb} {size}{unit if self.is_fitted else ''} {toward} {column}"
        return text.format(
            column=column,
            other=other,
            columns=" and ".join(self.columns),
            are="is" if len(self.columns) == 1 else "are",
            unit=unit if self.is_fitted else self.unit,
            size=f"{abs(self.shift):.3g}",
            percent=f"{100.0 * abs(self.shift):.3g} %",
            level="low" if is_up else "high",
            pace="faster" if is_up else "slower",
            side="late" if is_up else "early",
            back="earlier" if is_up else "later",
            change=shifted if self.shift else f"multiply {column} by {self.factor:.6g}",
        )

    def __str__(self) -> str:
        return f"{self.cause[0]}({self.cause[1]})"


def _integral(values: Array, time: Array) -> Array:
    """Return the integral over time of values (n,), from 0 on, by trapezoids."""
    return cumulative_trapezoid(values, time, initial=0) if values.size else values


def _derivative(values: Array, time: Array) -> Array:
    """Return the derivative in time of values (n,) by the sample before, NaN of the first."""
    return np.append(np.nan, np.diff(values) / np.diff(time))[: values.size]


def _earlier(values: Array, time: Array, shift: float, *, is_input: bool) -> Array:
    """Return a column at instants later by a shift, s.

    An input is linear between samples, as the mean of one that is held is, and keeps its value
    beyond its ends. An output has none there, and is that of the nearest sample, with its noise.
    """
    instants = time + shift
    if is_input:
        return np.interp(instants, time, values)
    places = np.interp(instants, time, np.arange(len(time)))
    near = 0.5 * step_of(time)
    inside = (instants > time[0] - near) & (instants < time[-1] + near)
    return np.where(inside, values[np.round(places).astype(int)], np.nan)


def _filtered(values: Array, time: Array, cutoff: float) -> Array:
    """Return columns (n, m) filtered forwards and backwards, up to a cut-off, Hz.

    As they are where the cut-off is beyond their samples.
    """
    share = 2.0 * cutoff * step_of(time)
    if not 0.0 < share < 1.0:
        return values
    return np.asarray(sosfiltfilt(butter(_ORDER, share, output="sos"), values, axis=0))


def readings_of(model: LawModel, records: Sequence[Record]) -> list[Reading]:
    """Return every way to read the records, the plainest first; fitted shifts are 0 yet.

    Parameters
    ----------
    model : LawModel
    records : sequence of Record
        A column that stands still in them, or is not measured, is read as it is.
    """
    inputs = np.concatenate([r.inputs for r in records])
    outputs = np.concatenate([r.outputs for r in records])
    moving = {
        v.name: v.unit
        for v, column in zip(
            (*model.inputs, *model.outputs), np.hstack([inputs, outputs]).T, strict=True
        )
        if v in (*model.recorded, *model.outputs)
        and np.isfinite(column).sum() > 1
        and np.nanstd(column) > 0.0
    }
    kinds = ReadingKind
    result = [Reading(kinds.SIGN, (name,), factor=-1.0) for name in moving]
    for name, unit in moving.items():
        result += _units(name, unit)
    # of an input that stands still another zero acts, while a factor is one of what it drives
    still = [v for v in model.recorded if v.name not in moving]
    result += [reading for v in still for reading in _units(v.name, v.unit) if reading.shift]
    own = [v for v in model.recorded if v.name in moving]
    # of whatever units: a header names columns, and not values
    pairs = [*itertools.combinations(moving, 2), *((v.name, s.name) for v in own for s in still)]
    result += [Reading(kinds.EXCHANGED, pair) for pair in pairs]
    # an offset of an output is one of its sensor, which is a term
    result += [Reading(kinds.OFFSET, (v.name,), unit=v.unit) for v in own]
    if not model.is_dynamic:
        return result
    for unit, size in _CLOCKS.items():
        result.append(Reading(kinds.CLOCK, (TIME,), size, unit=f"in {unit}"))
        result.append(Reading(kinds.CLOCK, (TIME,), 1.0 / size, unit=f"in s and read as {unit}"))
    # a late output is a fault of its measurement, which is a term
    result += [Reading(kinds.LATE, (v.name,), is_command=True) for v in own]
    logged = tuple(v.name for v in model.outputs if v.name in moving)
    if own and logged:  # by another logger than the inputs
        result += [Reading(kinds.LATE, logged), Reading(kinds.PACE, logged)]
        if max(_roughness(outputs)) < _SMOOTH:
            result.append(Reading(kinds.FILTERED, logged))
    return result


def _roughness(columns: Array) -> list[float]:
    """Return the size of the third differences of each column (n, m) that moves, over its spread.

    Of noise, and of jumps; that of white noise alone is 1.
    """
    return [
        float(np.nanstd(np.diff(column, 3)) / np.nanstd(column) / np.sqrt(20.0))
        for column in columns.T
        if np.isfinite(column).any() and np.nanstd(column) > 0.0
    ]


def readings_by_run(
    model: LawModel, records: Sequence[Record], nominal: Array
) -> Iterator[Reading]:
    """Yield the ways to read outputs that tell a part of their signal alone, each and together.

    Parameters
    ----------
    model : LawModel
    records : sequence of Record
    nominal : ndarray, shape (n, ny)
        Outputs of a run over the first record, which tell where a signal begins, and about which
        level it may have lost its sign.
    """
    measured = np.concatenate([r.outputs for r in records])
    moving = [j for j, y in enumerate(measured.T) if np.isfinite(y).sum() > 1 and np.nanstd(y) > 0]
    sets = [(j,) for j in moving] + [tuple(moving)] * (len(moving) > 1)
    for places in sets:
        names = tuple(model.outputs[j].name for j in places)
        begins = tuple(nominal[0, list(places)].tolist())
        if model.is_dynamic:
            yield Reading(ReadingKind.RATE, names, levels=begins)
            for levels in ((0.0,) * len(names), begins):  # some take off the first value before
                yield Reading(ReadingKind.INTEGRAL, names, levels=levels)
        own = measured[:, list(places)]
        least, most = np.nanmin(own, axis=0), np.nanmax(own, axis=0)
        # they come as near to zero as columns do that lose a sign there
        if ((least >= 0.0) & (least < _NEAR_ZERO * most)).all():
            levels = tuple(nominal[:, list(places)].mean(axis=0).tolist())
            yield Reading(ReadingKind.UNSIGNED, names, levels=levels)


def _units(column: str, unit: str) -> Iterator[Reading]:
    """Yield a column in other units than its own."""
    kind = ReadingKind.UNIT
    for prefix, size in _PREFIXES.items():
        takes_prefix = re.split("[*/]", unit)[0] in _PREFIXED
        smaller = f"{prefix}{unit}" if takes_prefix else f"{_WORDS[prefix]} of {unit}"
        yield Reading(kind, (column,), size, unit=f"in {smaller}")
    others = dict(_USUAL.get(unit, {}))
    quantity, slash, seconds = unit.rpartition("/")
    if slash and seconds == "s" and unit not in _USUAL:
        others |= {f"{quantity}/{name}": 1.0 / size for name, size in _PER_SECOND.items()}
    for name, size in others.items():
        yield Reading(kind, (column,), size, unit=f"in {name}")
        yield Reading(kind, (column,), 1.0 / size, unit=f"in {unit} and read as {name}")
    if unit == "K":
        yield Reading(kind, (column,), shift=_ZERO_CELSIUS, unit="in degC")
        yield Reading(kind, (column,), shift=-_ZERO_CELSIUS, unit="in K and read as degC")
