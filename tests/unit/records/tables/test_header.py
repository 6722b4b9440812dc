"""Claims: name and unit are told apart in every form that instruments write, and what is no unit
stays a part of the name.
"""

import pytest

from fmus.kit import units
from orchestration.records.tables.header import are_units, is_unit, plain_unit, read_header_cell


@pytest.mark.parametrize(
    ("cell", "parts"),
    [
        ("current [A]", ("current", "A")),
        (" a [b] [V] ", ("a [b]", "V")),
        ("current []", ("current", None)),
        ("stress [blorg]", ("stress", "blorg")),
        ("Current(A)", ("Current", "A")),
        ("Test_Time (s)", ("Test_Time", "s")),
        ("101 <V> (VDC)", ("101 <V>", "V")),
        ("Relative Time(h:min:s.ms)", ("Relative Time", None)),
        ("Strom (Kanal 1)", ("Strom (Kanal 1)", None)),
        ("Ewe/V", ("Ewe", "V")),
        ("<I>/mA", ("<I>", "mA")),
        ("(Q-Qo)/mA.h", ("(Q-Qo)", "mA.h")),
        ("control/V/mA", ("control", "V/mA")),
        ("Geschwindigkeit / m/s", ("Geschwindigkeit", "m/s")),
        ("Dev1/ai0", ("Dev1/ai0", None)),
        ("ox/red", ("ox/red", None)),
        ("dQ/dV", ("dQ/dV", None)),
        ("dV/dt(V/s)", ("dV/dt", "V/s")),
        ("Strom in mA", ("Strom", "mA")),
        ("time in air", ("time in air", None)),
        ("Aux_Temperature_1(C)", ("Aux_Temperature_1", "degC")),
        ("Ladung (C)", ("Ladung", "C")),
        ("", ("", None)),
        ("(V)", ("(V)", None)),
    ],
)
def test_a_header_cell_is_split_into_name_and_unit(cell, parts):
    assert read_header_cell(cell) == parts


@pytest.mark.parametrize(
    "text",
    [
        "s",
        "mA",
        "V",
        "Ω",
        "kOhm",
        "mA.h",
        "Ah",
        "mV/s",
        "°C",
        "℃",
        "N·m",
        "Nm",
        "VDC",
        "Volts",
        "%",
        "m/s^2",
        "m²",
        "µm",
        "U/min",
        "V vs. Ref.",
        "l/min",
        "deg C",
        "Sek",
        "bar",
        "1/s",
    ],
)
def test_a_unit_of_an_instrument_is_one_that_the_models_know(text):
    assert is_unit(text)
    units.check(plain_unit(text))


def test_a_newton_metre_is_no_nanometre():
    assert units.measure_alike(plain_unit("Nm"), "J")
    assert units.measure_alike(plain_unit("nm"), "m")


@pytest.mark.parametrize(
    "text", ["", "#", "dt", "dV", "a", "red", "ai0", "Kanal", "n/a", "R", "mean"]
)
def test_what_may_be_a_word_is_no_unit(text):
    assert not is_unit(text)


def test_a_row_of_units_may_leave_some_out_but_has_no_other_word():
    assert are_units(["#", "s", "V vs. Ref.", "A", ""])
    assert not are_units(["#", "", "n/a"])
    assert not are_units(["s", "V", "Kraft"])
