"""Claims: frequency responses come from files, arrays and records, with a model or without.

The oracle is the circuit of eq. 3.9 by SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration as ppy
from fmus.kit import UserError
from orchestration.records import write_record
from tests.support import frequency as made

CURRENT = made.square(600)
VOLTAGE = made.noisy(np.random.default_rng(1), made.voltage(CURRENT), 1e-3)
COLUMNS = {
    "time [s]": made.STEP * np.arange(600),
    "current [mA]": 1e3 * CURRENT,
    "voltage [V]": VOLTAGE,
}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("frequency") / "square.csv"
    signals = {"current": CURRENT, "voltage": VOLTAGE}
    write_record(path, COLUMNS["time [s]"], signals, {"current": "A", "voltage": "V"})
    return path


def test_the_right_model_agrees_and_a_wrong_one_does_not(file):
    settings = {"R1": made.R1, "R2": made.R2, "C": made.C}
    right = ppy.frequency_response(file, "ppy_actuator", settings=settings)
    wrong = ppy.frequency_response(file, "ppy_actuator", settings={**settings, "R1": "0.6 ohm"})
    assert list(right.responses) == ["voltage/current"]
    one = right["voltage/current"]
    assert one.model == pytest.approx(made.held_impedance(one.frequency), rel=1e-3)
    assert np.mean(one.agrees) > 0.85
    assert not wrong["voltage/current"].agrees[:8].any()
    assert right.model == "ppy_actuator"


def test_any_fmu_is_shown_beside_its_record(lag):
    """One of another toolchain; its response is right to a thousandth above 0.3 Hz."""
    random = np.random.default_rng(2)
    u = random.normal(size=800)
    pole = np.exp(-made.STEP / 0.8)
    x = made.noisy(random, lfilter([0.0, 1.0 - pole], [1.0, -pole], u), 0.01)
    columns = {"time [s]": made.STEP * np.arange(800), "u [1]": u, "x [1]": x}
    found = ppy.frequency_response(columns, lag, settings={"tau": 0.8})["x/u"]
    z = np.exp(2j * np.pi * found.frequency * made.STEP)
    others = found.frequency > 0.3
    assert found.model[others] == pytest.approx(((1.0 - pole) / (z - pole))[others], rel=1e-3)
    assert np.mean(found.agrees) > 0.85


@pytest.mark.parametrize("inputs", [(), ("current",), "current"])
def test_columns_are_enough_and_keep_their_units(inputs):
    found = ppy.frequency_response(COLUMNS, of="voltage/current", inputs=inputs, band="50mHz..1Hz")
    one = found["voltage/current"]
    assert (one.unit, one.model) == ("V/mA", None)
    assert 1e3 * one.values == pytest.approx(made.held_impedance(one.frequency), rel=0.01)
    assert one.frequency == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9])


def test_the_denominator_drives_unless_an_input_is_named():
    forth = ppy.frequency_response(COLUMNS, of=["current/voltage"], inputs=["current"])
    assert "current repeats every 10 s" in str(forth)
    assert "voltage" not in " ".join(forth.notes)


def test_a_record_that_was_read_is_taken_with_its_units(file):
    record = ppy.read_record(file)
    found = ppy.frequency_response(record, of=["voltage/current"], period="20 s")
    assert found["voltage/current"].unit == "ohm"
    assert "3 times" in str(found)
    beside = ppy.frequency_response(record, "ppy_actuator", band=(0.05, 0.2))
    assert beside["voltage/current"].model.size == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "name ratios of columns, such as voltage/current, or a model with model="),
        ({"of": "voltage/curent"}, "no column 'curent'"),
        ({"of": "voltage"}, "of=.*voltage.*: write a ratio of two signals"),
        ({"of": "voltage/current", "settings": {"R1": 1.0}}, "settings=: there is no model"),
        ({"of": "voltage/current", "mapping": {"a": "b"}}, "mapping=: there is no model"),
        ({"of": "voltage/current", "band": "2Hz..1Hz"}, "the first frequency must be below"),
        ({"of": "voltage/current", "band": "2Hz"}, "write two frequencies, such as 10mHz..2Hz"),
        ({"model": "ppy_actuator", "inputs": ["forse"]}, "inputs=.'forse'.: the record has no"),
    ],
)
def test_what_is_missing_is_told_in_a_line(options, said):
    with pytest.raises(UserError, match=said):
        ppy.frequency_response(COLUMNS, **options)
