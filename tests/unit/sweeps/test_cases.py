"""Which values and which cases. Oracle: they are written out here, and properties that define the designs."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu.model import find_model
from orchestration.sweeps.design import design
from orchestration.sweeps.ranges import given_range, read_range


@pytest.fixture(scope="module")
def model():
    return find_model("ppy_actuator")


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("R1=0.3..0.7:5", [0.3, 0.4, 0.5, 0.6, 0.7]),
        ("R1 = 300mohm..700 mohm:2", [0.3, 0.7]),
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
        ("R1=0.3..0.7:1", "no count of values"),
        ("R1=0.3..0.7:many", "no count of values"),
        ("R1=0.3..0.7:", "no count of values"),
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


def ranges(model, *texts):
    return [read_range(text, model) for text in texts]


def test_a_grid_has_every_value_with_every_other(model):
    found = design(ranges(model, "R1=0.3,0.5", "C=5,10,20"))
    assert found.shape == (2, 3)
    assert found.cases.tolist() == [[r, c] for r in (0.3, 0.5) for c in (5.0, 10.0, 20.0)]


def test_a_list_takes_values_together(model):
    assert design(ranges(model, "R1=0.3,0.5", "C=5,10"), "list").cases.tolist() == [
        [0.3, 5.0],
        [0.5, 10.0],
    ]


def test_a_latin_hypercube_has_one_value_in_every_part_of_every_parameter(model):
    found = design(ranges(model, "R1=0.2..0.6", "C=1..100 log"), "latin-hypercube", 50, seed=3)
    linear, ratio = (found.cases[:, 0] - 0.2) / 0.4, np.log(found.cases[:, 1]) / np.log(100.0)
    for share in (linear, ratio):
        assert sorted(np.floor(share * 50).astype(int)) == list(range(50))
    again = design(ranges(model, "R1=0.2..0.6", "C=1..100 log"), "latin-hypercube", 50, seed=3)
    assert np.array_equal(found.cases, again.cases)
    assert not np.array_equal(
        found.cases, design(again.ranges, "latin-hypercube", 50, seed=4).cases
    )


def test_points_of_sobol_fill_every_box(model):
    """256 points of a (0, 8, 2)-net: one in each of 256 boxes, however these are cut."""
    cases = design(ranges(model, "R1=0.2..0.6", "C=1..3"), "sobol", 256).cases
    share = (cases - [0.2, 1.0]) / [0.4, 2.0]
    for first in range(9):
        box = np.floor(share * [2**first, 2 ** (8 - first)]).astype(int)
        assert len(np.unique(box, axis=0)) == 256


@pytest.mark.parametrize(
    ("texts", "about", "told"),
    [
        ((), {}, "nothing to sweep"),
        (("R1=0.3..0.7",), {}, "names no count"),
        (("R1=0.3,0.5", "C=5,10,20"), {"kind": "list"}, "as many values"),
        (("R1=0.3..0.7:3", "R1=1..2:3"), {}, "R1 twice"),
        (("R1=0.5,0.6,0.5",), {}, "0.5 stands there twice"),
        (("R1=0.3..0.7:3",), {"kind": "sobol", "samples": 8}, "write from..to"),
        (("R1=0.3..0.7",), {"kind": "sobol", "samples": 9}, "powers of two"),
        (("R1=0.3..0.7",), {"kind": "latin-hypercube"}, "needs --samples"),
        (("R1=0.3..0.7:3",), {"samples": 5}, "has its own values"),
        (("R1=0.3..0.7:3",), {"kind": "random"}, "one of grid"),
        (("R1=0.3..0.7:100000", "C=1..2:100000"), {}, "at most"),
    ],
)
def test_what_does_not_go_together_is_told_in_a_line(model, texts, about, told):
    with pytest.raises(UserError, match=told):
        design(ranges(model, *texts), **about)
