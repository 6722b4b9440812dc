"""Claims: answers are classed by law and signal, or by what acts like them, and every one counts.

Oracle: answers that are made up, and records whose generators know what is hidden.
"""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np
import pytest

import orchestration as ppy
from orchestration.fmu import find_model
from studies.clean import KINDS, Case, draw, least_squares_fit, pooled_error
from studies.hidden import HiddenCase, cases
from studies.judging import hidden
from studies.judging.public import WORSE
from studies.judging.study import settings_of
from studies.plants import PLANTS
from tests.support.pace import slow_but

ROW = {
    "title": "drag of a motor",
    "family": "drag",
    "plant": "Motor",
    "noise": "AR",
    "verdict": "cause",
    "causes": [[0]],
    "parts": [[0]],
    "said": [["friction(v)", 0.95, ["friction += square(v)"]]],
    "right": [["friction over v"]],
    "inside": {"damping": True, "inertia": False},
    "processor": 2.0,
    "floor": True,
}
CLEAN = ROW | {"right": [], "causes": [[]], "parts": [[]], "inside": {"damping": True}}


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({}, "first"),
        ({"causes": [[]]}, "another"),
        ({"verdict": "ambiguous", "causes": [[], [0]]}, "in the group"),
        ({"verdict": "unexplained"}, "best guess"),
        ({"verdict": "unexplained", "causes": [[]]}, "none"),
        ({"verdict": "consistent"}, "none"),
        ({"verdict": "recalibrate", "causes": []}, "none"),
        ({"verdict": "refused"}, "refused"),
    ],
)
def test_an_answer_is_of_one_kind(change, kind):
    assert hidden.named(ROW | change) == kind


@pytest.mark.parametrize(
    ("parts", "verdict", "are_both"),
    [
        ([[0], [1]], "cause", True),
        ([[1], [], [0]], "ambiguous", True),
        ([[0], [0]], "cause", False),
        ([[0, 1]], "cause", False),  # no part stands for both
        ([[0, 1], [1]], "cause", True),
        ([[0], [1]], "unexplained", False),
    ],
)
def test_two_are_named_by_two_parts(parts, verdict, are_both):
    assert hidden.both({"parts": parts, "verdict": verdict}) is are_both


def test_the_report_counts():
    rows = [
        ROW,
        ROW | {"causes": [[]], "floor": False, "title": "a wrong one"},
        ROW | {"verdict": hidden.LITTLE},
        ROW | {"parts": [[0], []]},
        ROW | {"right": [], "causes": [[]], "family": "outside", "title": "what ages"},
    ]
    topic = hidden.report(rows, "Hidden", ("family",))
    asked = {row[0]: row[1:] for row in topic.tables[0].rows}
    assert "4 of 5 records count" in str(topic)
    assert asked["the first cause is right"] == [3, "2 (66.7 %)"]
    assert asked["sure and wrong"] == [3, "1 (33.3 %)"]
    assert asked["sure, of what is outside of every family"] == [1, "1 (100.0 %)"]
    assert asked["a further term is false"] == [3, "1 (33.3 %)"]
    assert asked["where a law is wrong: the floor is right"] == [3, "2 (66.7 %)"]
    assert asked["where first, true values in 95 % intervals"] == [4, "2 (50.0 %)"]
    assert "both are named" not in asked
    assert "- a wrong one: another" in str(topic)
    assert "- what ages: cause" in str(topic)
    assert "drag of a motor" not in str(topic)


def test_clean_records_are_counted():
    rows = [
        CLEAN | {"verdict": "consistent"},
        CLEAN | {"verdict": "recalibrate", "inside": {"damping": False}},
        CLEAN | {"title": "accused"},
        CLEAN | {"verdict": "refused", "why": "too short", "title": "refused one"},
    ]
    topic = hidden.report_clean(rows)
    asked = {row[0]: row[1:] for row in topic.tables[0].rows}
    assert asked["accused: a cause is named"] == [4, "1 (25.0 %)"]
    assert asked["refused"] == [4, "1 (25.0 %)"]
    assert asked["where not accused, true values in 95 % intervals"] == [2, "1 (50.0 %)"]
    assert "- accused: cause" in str(topic)
    assert "- refused one: refused: too short" in str(topic)


def test_records_of_which_none_counts_make_a_topic():
    assert "0 of 1 records count" in str(
        hidden.report([ROW | {"verdict": hidden.LITTLE}], "Hidden", ("plant",))
    )


def test_names_are_those_of_the_studies():
    motor = find_model(PLANTS["Motor"].model)
    right = [sorted(hidden.said_otherwise(motor, ["even part of friction over omega"])), ["x"]]
    assert hidden._matches({"friction over omega"}, right) == [0]
    assert hidden._matches({"friction over voltage"}, right) == []
    assert "friction loop of v" in hidden._of_law("friction", "v")


def test_a_fault_of_an_input_is_seen_in_the_laws_that_depend_on_it():
    motor = find_model(PLANTS["Motor"].model)
    names = hidden.said_otherwise(motor, ["input_lag(voltage)", "friction over omega"])
    assert {"winding_current remembering voltage", "acceleration over omega"} <= names
    assert "friction over voltage" not in names
    offset = hidden.said_otherwise(motor, ["input_offset(load)"])
    assert {"acceleration()", "reading_offset(load)"} <= offset


def test_an_effect_of_the_actuator_is_named_by_its_law_too():
    assert "charge_elongation over charge" in hidden._names_of_effect("strain_saturation")
    assert hidden._names_of_effect("sensor_lag(voltage)") == {"sensor_lag(voltage)"}


def test_cases_of_the_rig_repeat_and_cover_the_catalogue():
    drawn = hidden.rig_cases(60, 3)
    assert drawn == hidden.rig_cases(60, 3)
    assert len({case.hidden for case in drawn}) == len({case.hidden for case in drawn[:30]})
    assert {(case.strength, case.colour) for case in drawn} == {
        (strength, colour) for strength in (1.0, 0.3) for colour in (0.0, 0.9)
    }


def test_a_page_goes_on_where_it_stopped(tmp_path):
    """And tells of what was kept."""
    kept, page = tmp_path / "5.jsonl", tmp_path / "page.md"
    plants = (*hidden.USUAL, *hidden.BY_THE_BOOK)
    (case,) = cases(1, 5, plants)
    kept.write_text(json.dumps(ROW | asdict(case)) + "\n")
    options = ["--records", "1", "--clean", "0", "--seed", "5"]
    hidden.STUDY.main([*options, "--kept", str(kept), "--out", str(page)])
    text = page.read_text()
    assert "--records 1 --two 0 --terms 0 --rig 0 --clean 0 --seed 5" in text
    assert "## One hidden effect" in text
    assert "## Clean records" not in text
    assert len(kept.read_text().splitlines()) == 1


def test_the_floor_finds_what_is_plain_to_see():
    """A drag in the power of 1.75 of the speed."""
    case = HiddenCase("Motor", "multisine", "Gaussian", 6, hidden="Motor, drag, lower power")
    row = hidden.judge(case, with_floor=True)
    assert hidden.named(row) == "first"
    assert row["floor"]


@pytest.mark.parametrize(
    ("plant", "noise"),
    slow_but(
        [(plant, noise) for plant in ("Cell", "Pendulum") for noise in KINDS],
        *(("Cell", noise) for noise in KINDS),
    ),
)
def test_clean_records_have_no_cause(plant, noise):
    stimulus = "square" if plant == "Cell" else "PRBS"
    row = hidden.judge_clean(Case(plant, stimulus, noise, 11, at_rest=False))
    assert row["verdict"] in ("consistent", "recalibrate"), row["said"]


@pytest.mark.parametrize(
    "case",
    [
        Case("Cell", "multisine", "Gaussian", 21, at_rest=False),
        Case("Motor", "closed loop", "AR", 22),
    ],
    ids=str,
)
def test_a_refit_is_no_worse_than_plain_least_squares(case, tmp_path):
    """From five starts, of simulations that share no code with the model."""
    drawn = draw(case)
    plant = drawn.plant
    path = drawn.write(tmp_path / "record.csv")
    options = {"settings": settings_of(drawn), "hold": plant.known, "effects": [], "laws": False}
    refit = {n: e.value for n, e in ppy.diagnose(path, plant.model, **options).parameters.items()}
    rests = zip(plant.states, plant.rest(), strict=True)
    sizes = {f"{name}_start": max(abs(drawn.truth[f"{name}_start"]), 1e-6) for name in plant.states}
    least, _ = least_squares_fit(
        drawn.simulated,
        drawn.outputs,
        dict(plant.nominal) | {f"{name}_start": float(value) for name, value in rests},
        used=drawn.regular,
        sizes=sizes,
    )
    error = pooled_error(drawn.outputs, drawn.simulated(refit), drawn.regular)
    assert error <= WORSE * least
    assert np.isfinite(least)
