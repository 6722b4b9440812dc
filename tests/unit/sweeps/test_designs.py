"""Designs: the cases of a sweep, and the properties that define each design."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.fmu.model import find_model
from orchestration.sweeps.designs import design
from orchestration.sweeps.ranges import read_range


@pytest.fixture(scope="module")
def model():
    return find_model("ppy_actuator")


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
        (("R1=0.3..0.7",), {}, "needs the number of values"),
        (("R1=0.3,0.5", "C=5,10,20"), {"kind": "list"}, "equal numbers of values"),
        (("R1=0.3..0.7:3", "R1=1..2:3"), {}, "R1 twice"),
        (("R1=0.5,0.6,0.5",), {}, "0.5 stands there twice"),
        (("R1=0.3..0.7:3",), {"kind": "sobol", "samples": 8}, "write from..to"),
        (("R1=0.3..0.7",), {"kind": "sobol", "samples": 9}, "powers of two"),
        (("R1=0.3..0.7",), {"kind": "latin-hypercube"}, "needs samples="),
        (("R1=0.3..0.7:3",), {"samples": 5}, "has its own values"),
        (("R1=0.3..0.7:3",), {"kind": "random"}, "one of grid"),
        (("R1=0.3..0.7:100000", "C=1..2:100000"), {}, "at most"),
    ],
)
def test_what_does_not_go_together_is_told_in_a_line(model, texts, about, told):
    with pytest.raises(UserError, match=told):
        design(ranges(model, *texts), **about)
