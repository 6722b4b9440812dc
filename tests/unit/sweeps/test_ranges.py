"""Ranges: the values of a parameter that a line of text stands for."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu.model import find_model
from orchestration.sweeps.ranges import given_range, read_range


@pytest.fixture(scope="module")
def model():
    return find_model("ppy_actuator")


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("R1=0.3..0.7:5", [0.3, 0.4, 0.5, 0.6, 0.7]),
        ("R1 = 300mohm..700 mohm:2", [0.3, 0.7]),
        ("k1=4..8 N/mm:2", [4000.0, 8000.0]),
        ("R1 = 1e2..700 mohm:2", [0.1, 0.7]),
        ("R1=300 mohm..0.7:2", [0.3, 0.7]),
        ("R1=0.01..1:3 log", [0.01, 0.1, 1.0]),
        ("R1=0.5, 600mohm,0.2", [0.5, 0.6, 0.2]),
        ("R1=1e-3..1e-1:2", [1e-3, 1e-1]),
        ("k1=6.3 N/mm, 9 N/mm", [6300.0, 9000.0]),
        ("current=-1..1:3", [-1.0, 0.0, 1.0]),
    ],
)
def test_values(model, text, values):
    assert read_range(text, model).values == pytest.approx(values)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("R1", "write name=from..to:count"),
        ("R1=", "write name=from..to:count"),
        ("R9=1..2:3", "no parameter or input named 'R9'"),
        ("R1=0.7..0.3:5", "a range goes up"),
        ("R1=0.3..0.7:1", "no number of values"),
        ("R1=0.3..0.7:many", "no number of values"),
        ("R1=0.3..0.7:", "no number of values"),
        ("R1=0..0.7:5 log", "equal ratios need positive ends"),
        ("R1=-1..0.7:5", "out of range"),
        ("R1=0.3 V..0.7:5", "V"),
        ("R1=a..b:5", "not a number"),
        ("R1=0.5,,0.6", "not a number"),
        ("R1=nan", "number"),
    ],
)
def test_what_is_no_range_is_told_in_a_line(model, text, told):
    with pytest.raises(UserError, match=told) as refused:
        read_range(text, model)
    assert "\n" not in str(refused.value)


def test_values_as_numbers_are_taken_as_they_are(model):
    assert given_range("R1", [0.5, 0.25], model).values.tolist() == [0.5, 0.25]
    assert given_range("current", np.linspace(-1.0, 1.0, 3), model).unit == "A"


@pytest.mark.parametrize(
    ("name", "values", "told"),
    [
        ("R9", [1.0], "no parameter or input named 'R9'"),
        ("R1", [], "a row of them"),
        ("R1", [[1.0]], "a row of them"),
        ("R1", [1.0, np.nan], "not a number"),
        ("R1", [0.5, -1.0, 0.6], "out of range"),
    ],
)
def test_numbers_that_cannot_be_swept_are_told_in_a_line(model, name, values, told):
    with pytest.raises(UserError, match=told) as refused:
        given_range(name, values, model)
    assert "\n" not in str(refused.value)
