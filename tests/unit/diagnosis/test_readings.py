"""Claims: a reading gives the values that a file means, and undoes what was done to it."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, State
from orchestration.diagnosis import LawModel, Record
from orchestration.diagnosis.readings import (
    Reading,
    ReadingKind,
    readings_by_run,
    readings_of,
)

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
    read_outputs = read.outputs
    inside = slice(0, -3) if samples > 0 else slice(3, None)
    assert read.outputs[inside, 0] == pytest.approx(record.outputs[inside, 0])
    assert np.isnan(read.outputs[:, 0]).sum() == 3
    assert read.outputs[:, 1] == pytest.approx(record.outputs[:, 1])
    read = Reading(ReadingKind.LATE, ("power",), shift=0.5 * samples).apply(model, late)
    assert read.inputs[inside, 0] == pytest.approx(record.inputs[inside, 0])
    assert np.isfinite(read.inputs).all()
    assert output.sentence == f"first is 1.5 s {told}"
    errors = output.as_filed(model, read_outputs, late.time)
    known = np.isfinite(errors)
    assert np.isnan(errors).sum() == 3
    assert (errors == late.outputs)[known].all(), "in the rows of the file"


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
    still = {(reading.kind, reading.shift) for reading in readings if "ambient" in reading.columns}
    units = {(ReadingKind.UNIT, 273.15), (ReadingKind.UNIT, -273.15)}
    assert still == units | {(ReadingKind.EXCHANGED, 0.0)}
    exchanged = [r.columns for r in readings if r.kind is ReadingKind.EXCHANGED]
    assert exchanged == [("power", "first"), ("power", "ambient")], "of whatever units"


TIME = 0.05 * np.arange(400.0)


def of_first(values: np.ndarray) -> Record:
    """Return a record with an output of these values."""
    outputs = np.column_stack([values, np.cos(TIME)])
    return Record(TIME, np.zeros((len(TIME), 2)), outputs, (False, False), "r")


@pytest.mark.parametrize(
    ("reading", "values", "within"),
    [
        # the trapezoidal rule: a twelfth of a step squared for each unit of slope
        (Reading(ReadingKind.RATE, ("first",), levels=(2.0,)), np.cos(TIME), 3e-4),
        (
            Reading(ReadingKind.INTEGRAL, ("first",), levels=(0.0,)),
            0.05 * np.cumsum(2.0 + np.sin(TIME)),
            1e-12,
        ),
        (
            Reading(ReadingKind.INTEGRAL, ("first",), levels=(2.0,)),
            0.05 * np.cumsum(np.sin(TIME)),
            1e-12,
        ),
    ],
)
def test_a_part_of_a_signal_gives_the_signal(
    reading: Reading, values: np.ndarray, within: float, model: LawModel
) -> None:
    first, second = reading.apply(model, of_first(values)).outputs.T
    known = np.isfinite(first)
    assert known.mean() > 0.95
    assert first[known] == pytest.approx((2.0 + np.sin(TIME))[known], abs=within)
    assert second == pytest.approx(np.cos(TIME))


@pytest.mark.parametrize("kind", [ReadingKind.RATE, ReadingKind.INTEGRAL])
def test_a_gap_ends_no_integral(kind: ReadingKind, model: LawModel) -> None:
    """The sine and its integral from the cosine with three samples missing, by their formulae."""
    signal, values = {
        ReadingKind.RATE: (np.sin(TIME), np.cos(TIME)),
        ReadingKind.INTEGRAL: (np.cos(TIME - 0.025), np.sin(TIME)),
    }[kind]
    gap = np.isin(np.arange(len(TIME)), [0, 100, 250])
    reading = Reading(kind, ("first",), levels=(0.0,))
    first = reading.apply(model, of_first(np.where(gap, np.nan, values))).outputs[:, 0]
    known = np.isfinite(first)
    assert known.sum() == (~gap).sum() - (kind is ReadingKind.INTEGRAL)
    begins = signal[1] if kind is ReadingKind.RATE else 0.0
    assert first[known] == pytest.approx((signal - begins)[known], abs=0.03)


def test_filtered_outputs_are_those_of_inputs_through_the_same_filter(model: LawModel) -> None:
    """A filter forwards and backwards halves the power at its cut-off, and has no phase."""
    inputs = np.column_stack([np.sin(2.0 * np.pi * f * TIME) for f in (0.02, 1.0)])
    record = replace(of_first(np.sin(TIME)), inputs=inputs)
    reading = Reading(ReadingKind.FILTERED, ("first",), shift=1.0)
    slow, fast = reading.apply(model, record).inputs[100:300].T
    assert slow == pytest.approx(inputs[100:300, 0], abs=0.01)
    assert fast == pytest.approx(0.5 * inputs[100:300, 1], abs=0.01)
    beyond = replace(reading, shift=11.0).apply(model, record)
    assert beyond.inputs is not None
    assert beyond.inputs == pytest.approx(inputs), "there is nothing beyond half of the samples"


def test_outputs_are_asked_for_their_signals_each_and_together(model: LawModel) -> None:
    nominal = np.column_stack([np.linspace(1.0, 5.0, 400), np.full(400, 7.0)])
    values = np.abs(np.sin(TIME))
    readings = list(readings_by_run(model, [of_first(values)], nominal))
    assert {r.columns for r in readings} == {("first",), ("second",), ("first", "second")}
    (unsigned,) = [r for r in readings if r.kind is ReadingKind.UNSIGNED]
    assert (unsigned.columns, unsigned.levels) == (("first",), (3.0,)), "no other touches zero"
    both = [r for r in readings if r.kind is ReadingKind.INTEGRAL and len(r.columns) == 2]
    assert {r.levels for r in both} == {(0.0, 0.0), (1.0, 7.0)}


@pytest.mark.parametrize(("noise", "is_asked"), [(0.0, True), (0.05, False)])
def test_outputs_with_noise_were_not_filtered(
    noise: float, is_asked: bool, model: LawModel
) -> None:
    inputs = np.sign(np.sin(TIME))[:, np.newaxis] * [1.0, 0.0]
    spread = noise * np.random.default_rng(1).normal(size=(400, 2))
    smooth = of_first(np.sin(TIME))
    record = replace(smooth, inputs=inputs, outputs=smooth.outputs + spread)
    kinds = {reading.kind for reading in readings_of(model, [record])}
    assert (ReadingKind.FILTERED in kinds) == is_asked


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
            Reading(ReadingKind.LATE, ("power",), shift=-0.25, is_command=True),
            "power acts 0.25 s later than it is recorded",
            "shift power 0.25 s later",
        ),
        (
            Reading(ReadingKind.LATE, ("power",), shift=0.25, is_command=True),
            "power is 0.25 s late",
            "shift power 0.25 s earlier",
        ),
        (
            Reading(ReadingKind.LATE, ("first", "second"), shift=2.0),
            "first and second are 2 s late",
            "shift first and second 2 s earlier",
        ),
        (
            Reading(ReadingKind.PACE, ("first",), shift=-0.03),
            "first is recorded by a clock that is 3 % slower than that of the inputs",
            "give first the times of the other clock",
        ),
        (
            Reading(ReadingKind.RATE, ("first",), levels=(0.0,)),
            "first is the derivative in time of the signal",
            "integrate first",
        ),
        (
            Reading(ReadingKind.FILTERED, ("first",), shift=0.25),
            "first is filtered forwards and backwards, up to 0.25 Hz",
            "record first without a filter, or filter the inputs in the same way",
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
    """An offset and a delay are sizes; a sign, a unit and an exchange are not."""
    fitted = {kind.name for kind in ReadingKind if Reading(kind, ("power",)).is_fitted}
    assert fitted == {"OFFSET", "LATE", "PACE", "FILTERED"}


@pytest.mark.parametrize(
    ("unit", "smaller"),
    [("N*m", "in mN*m"), ("V/m", "in mV/m"), ("1/s", "in thousandths of 1/s")],
)
def test_a_unit_of_several_has_its_prefix_at_the_first(unit: str, smaller: str) -> None:
    units = [reading.unit for reading in READINGS._units("load", unit)]
    assert smaller in units
