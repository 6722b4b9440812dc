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

from fmus.kit.arrays import Array
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Record

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
    """How a file may be misread."""

    SIGN = _Kind("{column} has the opposite sign", "{change}")
    UNIT = _Kind("{column} is {unit}", "{change}, or write its unit in the header")
    OFFSET = _Kind("{column} is {size}{unit} too {level}", "{change}", True)
    EXCHANGED = _Kind(
        "{column} and {other} are exchanged", "exchange the names of {column} and {other}"
    )
    CLOCK = _Kind(f"{TIME} is {{unit}}", "{change}, or write its unit in the header")
    LATE = _Kind("{column} is {size} s {side}", "shift {column} {size} s {back}", True)


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
        SI; of a late column its delay, s, negative of an early one.
    unit : str
        That the file has, in words; of an offset the SI unit of its shift.
    instead : tuple of Reading
        Others that a model cannot tell from it.
    """

    kind: ReadingKind
    columns: tuple[str, ...]
    factor: float = 1.0
    shift: float = 0.0
    unit: str = ""
    instead: tuple[Reading, ...] = ()

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
        """Whether its shift is estimated."""
        return self.kind.value.is_fitted

    def moves_inputs(self, model: LawModel) -> bool:
        """Return whether a run of the model is another one by it."""
        inputs = {v.name for v in model.inputs} | {TIME}
        return not inputs.isdisjoint(self.columns)

    def apply(self, model: LawModel, record: Record) -> Record:
        """Return a record of the values that the file means."""
        if self.kind is ReadingKind.CLOCK:
            time = np.ascontiguousarray(record.time * self.factor)
            return replace(record, time=time, begin=record.begin * self.factor)
        names = [v.name for v in (*model.inputs, *model.outputs)]
        values = np.hstack([record.inputs, record.outputs])
        places = [names.index(name) for name in self.columns]
        if self.kind is ReadingKind.EXCHANGED:
            values[:, places] = values[:, places[::-1]]
        elif self.kind is ReadingKind.LATE:
            is_input = places[0] < len(model.inputs)
            values[:, places[0]] = _earlier(
                values[:, places[0]], record.time, self.shift, is_input=is_input
            )
        else:
            values[:, places] = self.factor * values[:, places] + self.shift
        inputs, outputs = np.split(values, [len(model.inputs)], axis=1)
        return replace(
            record,
            inputs=np.ascontiguousarray(inputs),
            outputs=np.ascontiguousarray(outputs),
        )

    @property
    def sentence(self) -> str:
        """The fault of the file, without its name."""
        return " or ".join(one._said(one.kind.value.fault) for one in (self, *self.instead))

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
            unit=unit if self.is_fitted else self.unit,
            size=f"{abs(self.shift):.3g}",
            level="low" if is_up else "high",
            side="late" if is_up else "early",
            back="earlier" if is_up else "later",
            change=shifted if self.shift else f"multiply {column} by {self.factor:.6g}",
        )

    def __str__(self) -> str:
        return f"{self.cause[0]}({self.cause[1]})"


def _earlier(values: Array, time: Array, shift: float, *, is_input: bool) -> Array:
    """Return the samples of a column nearest to instants later by a shift, s.

    Beyond its ends an input keeps its value, and an output has none.
    """
    instants = time + shift
    places = np.interp(instants, time, np.arange(len(time)))
    moved = values[np.round(places).astype(int)]
    if not is_input:
        near = 0.5 * float(np.median(np.diff(time)))
        inside = (instants > time[0] - near) & (instants < time[-1] + near)
        moved = np.where(inside, moved, np.nan)
    return moved


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
        if np.isfinite(column).sum() > 1 and np.nanstd(column) > 0.0
    }
    kinds = ReadingKind
    result = [Reading(kinds.SIGN, (name,), factor=-1.0) for name in moving]
    for name, unit in moving.items():
        result += _units(name, unit)
    # of an input that stands still another zero acts, while a factor is one of what it drives
    still = [v for v in model.inputs if v.name not in moving]
    result += [reading for v in still for reading in _units(v.name, v.unit) if reading.shift]
    result += [  # of whatever units: a header names columns, and not values
        Reading(kinds.EXCHANGED, pair) for pair in itertools.combinations(moving, 2)
    ]
    # an offset of an output is one of its sensor, which is a term
    own = [v for v in model.inputs if v.name in moving]
    result += [Reading(kinds.OFFSET, (v.name,), unit=v.unit) for v in own]
    if not model.states:
        return result
    for unit, size in _CLOCKS.items():
        result.append(Reading(kinds.CLOCK, (TIME,), size, unit=f"in {unit}"))
        result.append(Reading(kinds.CLOCK, (TIME,), 1.0 / size, unit=f"in s and read as {unit}"))
    # a late output is a fault of its measurement, which is a term
    result += [Reading(kinds.LATE, (v.name,)) for v in own]
    return result


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
