"""Claims: answers of the new engine are classed by law and signal, or by what acts like them."""

from __future__ import annotations

import pytest

from orchestration.fmu import find_model
from studies.judging import by_terms
from studies.plants import PLANTS

ROW = {
    "family": "drag",
    "verdict": "cause",
    "each": [True],
    "parts": [True],
    "said": [["friction(v)", 0.95, ["friction += square(v)"]]],
    "right": [["friction over v"]],
    "processor": 2.0,
    "plant": "Motor",
}


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({}, "first"),
        ({"each": [False]}, "another"),
        ({"verdict": "ambiguous", "each": [False, True]}, "in the group"),
        ({"verdict": "unexplained"}, "best guess"),
        ({"verdict": "unexplained", "each": [False]}, "none"),
        ({"verdict": "consistent"}, "none"),
        ({"verdict": "refused"}, "refused"),
        ({"verdict": "too little"}, "too little"),
    ],
)
def test_an_answer_is_of_one_kind(change: dict, kind: str) -> None:
    assert by_terms.named(ROW | change) == kind


def test_the_report_counts() -> None:
    rows = [ROW, ROW | {"each": [False]}, ROW | {"verdict": "too little"}]
    rows.append(ROW | {"parts": [True, False]})
    text = str(by_terms.report(rows))
    assert "3 of 4 count" in text
    assert "first in 2 (66.7 %)" in text
    assert "false further terms in 1 (33.3 %)" in text
    clean = [ROW | {"verdict": "consistent"}, ROW | {"verdict": "recalibrate"}, ROW]
    assert "2 of 3 are consistent or recalibrated" in str(by_terms.report_clean(clean))


def test_names_are_those_of_the_studies() -> None:
    assert "friction over v" in by_terms._of_law("friction", "v")
    assert by_terms._is_right({"a over b"}, [["even part of a over b"]])
    assert not by_terms._is_right({"a over b"}, [["a over c"]])


def test_a_fault_of_an_input_is_seen_in_the_laws_that_depend_on_it() -> None:
    motor = find_model(PLANTS["Motor"].model)
    names = by_terms.said_otherwise(motor, ["input_lag(voltage)", "friction over omega"])
    assert {"winding_current remembering voltage", "acceleration over omega"} <= names
    assert "friction over voltage" not in names
    offset = by_terms.said_otherwise(motor, ["input_offset(load)"])
    assert {"acceleration()", "reading_offset(load)"} <= offset
