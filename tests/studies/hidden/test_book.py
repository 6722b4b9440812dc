"""Claims: records by the book are as loggers write them."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from orchestration.api import read_record
from orchestration.fmu import find_model
from studies.clean import Case, cases, draw
from studies.hidden.records import cases as hidden_cases
from studies.hidden.variations import OUTSIDE, VARIATIONS
from studies.plants import BY_THE_BOOK, PLANTS

_IN_FILE = {  # column: name, and its size in the unit of the model
    "Accelerometer": {"time [ms]": 1e-3, "deflection [um]": 1.0},
    "Vessel": {"time [s]": 1.0, "opening [%]": 0.01, "gauge [bar]": 1.0},
    "Crane": {"inclination [mrad]": 1e-3},
    "Ship": {"time [min]": 60.0, "turn [deg/min]": 1.0 / 60.0},
    "Tanks": {"pump [l/s]": 1e-3, "upper_level [cm]": 0.01},
    "House": {"time [h]": 3600.0, "heating [kW]": 1.0},
    "LithiumCell": {"terminal [mV]": 1e-3, "load [A]": 1.0},
    "GearMotor": {"tachometer [rpm]": 2.0 * pi / 60.0},
    "Train": {"time [min]": 60.0, "position [km]": 1.0},
}


def _stimulus(name):
    return "released" if PLANTS[name].released else "multisine"


@pytest.mark.parametrize("name", _IN_FILE)
def test_a_file_is_in_units_of_its_field(name, tmp_path):
    drawn = draw(Case(name, _stimulus(name), "Gaussian", 5))
    path = drawn.write(tmp_path / "record.csv")
    header = path.read_text().splitlines()[0].split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    signals = {"time": drawn.time, **drawn.inputs, **drawn.outputs}
    assert [cell.split(" ")[0] for cell in header] == list(signals)
    for column, size in _IN_FILE[name].items():
        written = table[:, header.index(column)]
        assert size * written == pytest.approx(signals[column.split(" ")[0]], rel=1e-9, abs=1e-9)
    record = read_record(path, find_model(PLANTS[name].model))
    assert record.time == pytest.approx(drawn.time, rel=1e-9)


def test_what_nothing_drives_is_released_and_stands_still_no_time_before():
    drawn = draw(Case("Crane", "released", "Gaussian", 6))
    assert not drawn.inputs
    assert 0.6 * 0.35 <= drawn.truth["swing_start"] <= 0.35
    assert np.ptp(drawn.outputs["inclination"]) > drawn.truth["swing_start"]
    for case in cases(40, 2, BY_THE_BOOK):
        is_released = bool(PLANTS[case.plant].released)
        assert (case.stimulus == "released") is is_released
        assert case.at_rest or not is_released


def test_every_plant_hides_three_effects_or_more_and_gets_its_turn():
    for name in BY_THE_BOOK:
        families = {v.family for v in VARIATIONS.values() if v.plant == name}
        assert len(families - {OUTSIDE}) >= 3
    assert {case.plant for case in hidden_cases(10, 1, BY_THE_BOOK)} == {*BY_THE_BOOK}
