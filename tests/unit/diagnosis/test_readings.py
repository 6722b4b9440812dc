"""Claims: a reading gives the values that a file means, and undoes what was done to it."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, State
from orchestration.diagnosis import LawModel, Record
from orchestration.diagnosis.readings import Reading, ReadingKind, readings_of

READINGS = sys.modules[Reading.__module__]


class Heater(Component):
    """Two nodes; both temperatures are measured."""

    name = "heater"
    power = Input("W", nominal=10.0)
    ambient = Input("K", nominal=300.0)
    warm = State("K", rate="warm_rate", nominal=300.0)
    cold = State("K", rate="cold_rate", nominal=300.0)

    def warm_rate(self):
        """Of the heated node."""
        return 0.1 * self.power - 0.1 * (self.warm - self.cold)

    def cold_rate(self):
        """Of the other."""
        return 0.1 * (self.warm - self.cold) - 0.1 * (self.cold - self.ambient)

    @Output("K")
    def first(self):
        """Of the heated node."""
        return self.warm

    @Output("K")
    def second(self):
        """Of the other."""
        return self.cold


@pytest.fixture(scope="module")
def model():
    return LawModel(Heater)


def right() -> Record:
    random = np.random.default_rng(3)
    inputs = random.normal(size=(50, 2))
    return Record(0.5 * np.arange(50.0), inputs, random.normal(size=(50, 2)), (False, False), "r")


def spoilt(kind: str) -> tuple[Record, Reading]:
    """Return a record that was misused, and the reading that undoes it."""
    record = right()
    inputs, outputs, kinds = record.inputs.copy(), record.outputs.copy(), ReadingKind
    if kind == "sign":
        inputs[:, 0] *= -1.0
        return replace(record, inputs=inputs), Reading(kinds.SIGN, ("power",), -1.0)
    if kind == "milli":
        inputs[:, 0] *= 1e3
        return replace(record, inputs=inputs), Reading(kinds.UNIT, ("power",), 1e-3, unit="in mW")
    if kind == "celsius":
        outputs[:, 1] -= 273.15
        reading = Reading(kinds.UNIT, ("second",), shift=273.15, unit="in degC")
        return replace(record, outputs=outputs), reading
    if kind == "exchanged":
        both = Reading(kinds.EXCHANGED, ("ambient", "first"))
        inputs[:, 1], outputs[:, 0] = record.outputs[:, 0], record.inputs[:, 1]
        return replace(record, inputs=inputs, outputs=outputs), both
    clock = Reading(kinds.CLOCK, ("time",), 1e-3, unit="in ms")
    return replace(record, time=1e3 * record.time), clock


@pytest.mark.parametrize("kind", ["sign", "milli", "celsius", "exchanged", "clock"])
def test_a_reading_undoes_what_was_done(kind: str, model: LawModel) -> None:
    record, reading = spoilt(kind)
    read = reading.apply(model, record)
    assert read.time == pytest.approx(right().time)
    assert read.inputs == pytest.approx(right().inputs)
    assert read.outputs == pytest.approx(right().outputs)


@pytest.mark.parametrize("kind", ["sign", "milli", "celsius", "exchanged", "clock"])
def test_it_is_among_those_that_are_tried(kind: str, model: LawModel) -> None:
    record, reading = spoilt(kind)
    assert reading in readings_of(model, [record])


@pytest.mark.parametrize(("samples", "told"), [(3, "late"), (-3, "early")])
def test_a_late_column_is_moved_back(samples: int, told: str, model: LawModel) -> None:
    """An output has gaps where nothing was recorded; an input keeps its last known value."""
    record = right()
    outputs, inputs = record.outputs.copy(), record.inputs.copy()
    outputs[:, 0] = np.roll(outputs[:, 0], samples)
    inputs[:, 0] = np.roll(inputs[:, 0], samples)
    late = replace(record, inputs=inputs, outputs=outputs)
    output = Reading(ReadingKind.LATE, ("first",), shift=0.5 * samples)
    read = output.apply(model, late)
    inside = slice(0, -3) if samples > 0 else slice(3, None)
    assert read.outputs[inside, 0] == pytest.approx(record.outputs[inside, 0])
    assert np.isnan(read.outputs[:, 0]).sum() == 3
    assert read.outputs[:, 1] == pytest.approx(record.outputs[:, 1])
    read = Reading(ReadingKind.LATE, ("power",), shift=0.5 * samples).apply(model, late)
    assert read.inputs[inside, 0] == pytest.approx(record.inputs[inside, 0])
    assert np.isfinite(read.inputs).all()
    assert output.sentence == f"first is 1.5 s {told}"


def test_a_late_column_is_moved_back_at_any_instants(model: LawModel) -> None:
    """To the nearest sample: within half a step of the signal as it was."""
    time = np.cumsum(np.random.default_rng(5).uniform(0.05, 0.4, 200))
    late = np.sin(0.3 * (time - 1.7))
    record = replace(
        right(), time=time, inputs=np.zeros((200, 2)), outputs=np.column_stack([late, late])
    )
    read = Reading(ReadingKind.LATE, ("first",), shift=1.7).apply(model, record).outputs[:, 0]
    inside = np.isfinite(read)
    assert 190 <= inside.sum() < 200
    assert np.abs(read - np.sin(0.3 * time))[inside].max() <= 0.3 * 0.2


def test_only_columns_that_move_are_read_otherwise(model: LawModel) -> None:
    record = right()
    inputs, outputs = record.inputs.copy(), record.outputs.copy()
    inputs[:, 1] = 293.0
    outputs[:, 1] = np.nan
    readings = readings_of(model, [replace(record, inputs=inputs, outputs=outputs)])
    columns = {name for reading in readings for name in reading.columns}
    assert columns == {"power", "first", "ambient", "time"}
    still = [(reading.kind, reading.shift) for reading in readings if "ambient" in reading.columns]
    assert still == [(ReadingKind.UNIT, 273.15), (ReadingKind.UNIT, -273.15)]
    exchanged = [r.columns for r in readings if r.kind is ReadingKind.EXCHANGED]
    assert exchanged == [("power", "first")], "of whatever units"


def test_units_are_those_of_the_quantity(model: LawModel) -> None:
    told = {r.unit for r in readings_of(model, [right()]) if r.columns == ("power",)}
    assert {"in mW", "in kW"} <= told
    assert "in degC" not in told
    offsets = [r for r in readings_of(model, [right()]) if r.kind is ReadingKind.OFFSET]
    assert {r.columns[0]: r.unit for r in offsets}["power"] == "W"
    told = {r.unit for r in readings_of(model, [right()]) if r.columns == ("ambient",)}
    assert {"in degC", "in K and read as degC"} <= told


@pytest.mark.parametrize(
    ("reading", "fault", "correction"),
    [
        (
            Reading(ReadingKind.SIGN, ("power",), -1.0),
            "power has the opposite sign",
            "multiply power by -1",
        ),
        (
            Reading(ReadingKind.OFFSET, ("power",), shift=-0.5, unit="W"),
            "power is 0.5 W too high",
            "subtract 0.5 W from power",
        ),
        (
            Reading(ReadingKind.UNIT, ("second",), shift=273.15, unit="in degC"),
            "second is in degC",
            "add 273.15 to second, or write its unit in the header",
        ),
        (
            Reading(ReadingKind.EXCHANGED, ("first", "second")),
            "first and second are exchanged",
            "exchange the names of first and second",
        ),
        (
            Reading(ReadingKind.LATE, ("first",), shift=-0.25),
            "first is 0.25 s early",
            "shift first 0.25 s later",
        ),
        (
            Reading(ReadingKind.CLOCK, ("time",), 1e-3, unit="in ms"),
            "time is in ms",
            "multiply time by 0.001, or write its unit in the header",
        ),
        (
            Reading(
                ReadingKind.SIGN,
                ("power",),
                -1.0,
                instead=(Reading(ReadingKind.SIGN, ("first",), -1.0),),
            ),
            "power has the opposite sign or first has the opposite sign",
            "multiply power by -1",
        ),
    ],
)
def test_a_fault_is_said_plainly(reading: Reading, fault: str, correction: str) -> None:
    assert reading.sentence == fault
    assert reading.correction == correction


def test_kinds_that_are_estimated_have_a_shift() -> None:
    """An offset and a delay are sizes; a sign, a unit, an exchange and a clock are not."""
    fitted = {kind.name for kind in ReadingKind if Reading(kind, ("power",)).is_fitted}
    assert fitted == {"OFFSET", "LATE"}


@pytest.mark.parametrize(
    ("unit", "smaller"),
    [("N*m", "in mN*m"), ("V/m", "in mV/m"), ("1/s", "in thousandths of 1/s")],
)
def test_a_unit_of_several_has_its_prefix_at_the_first(unit: str, smaller: str) -> None:
    units = [reading.unit for reading in READINGS._units("load", unit)]
    assert smaller in units
