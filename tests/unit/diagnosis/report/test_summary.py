"""Claims: the JSON has the keys of the contract, and guesses are no causes."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from orchestration.diagnosis.report import wording
from orchestration.diagnosis.report.summary import _term_figures, summary
from orchestration.diagnosis.terms import Shape
from tests.support.oscillator import DRY, telling_apart, with_group
from tests.support.reference import documented_fields


def test_guesses_are_no_causes(dry):
    unexplained = with_group(dry, "unexplained", 0.5, 0.2)
    figures = summary(unexplained)
    assert figures["causes"] == []
    assert figures["alternatives"] == []
    assert [one["probability"] for one in figures["group"]] == [0.5, 0.2]
    assert figures["gain"]["holdout_nrmse_after"] == figures["gain"]["holdout_nrmse_before"]
    assert wording.headline(unexplained).startswith("no cause is sure; best guesses: 50 %")
    likely = with_group(dry, "unexplained", 0.94, 0.03)
    assert wording.headline(likely).startswith("no cause explains enough; best guesses: 94 %")


def test_the_json_has_the_keys_of_the_contract(dry):
    figures = json.loads(json.dumps(summary(dry), allow_nan=False))
    assert figures["verdict"] == "cause"
    (cause,) = figures["causes"]
    assert (cause["effect"], cause["law"], cause["signal"]) == (
        "friction(velocity)",
        "friction",
        "velocity",
    )
    assert cause["shape"] == "a tanh(x/w)"
    assert cause["memory"] == ""
    assert (cause["middle"], cause["scale"], cause["places"]) == (DRY.middle, DRY.scale, [])
    amount = cause["parameters"]["friction_of_velocity"]
    assert amount["unit"] == "N"
    assert amount["ci95"][0] < 1.5 < amount["ci95"][1]
    assert figures["gain"]["holdout_nrmse_after"].keys() == {"position"}
    assert figures["parameters"]["stiffness"]["nominal"] == 20.0


def test_every_field_is_documented(dry):
    experiment = telling_apart("friction(velocity)", "friction(elongation)")
    figures = summary(replace(dry, experiment=experiment))
    stamp = {"format", "product", "shown"}
    assert {*figures, *stamp, "comparison", "history", "later"} == documented_fields()
    assert figures["experiment"]["reached"]["friction(elongation)"] == 0.6
    assert "experiment" not in summary(dry)


def test_a_reading_of_the_file_has_figures_of_its_own(flipped):
    (cause,) = json.loads(json.dumps(summary(flipped), allow_nan=False))["causes"]
    assert cause["effect"] == "reading_sign(force)"
    assert "law" not in cause
    reading = cause["reading"]
    assert (reading["kind"], reading["columns"]) == ("sign", ["force"])
    assert (reading["factor"], reading["shift"]) == (-1.0, 0.0)
    assert reading["correction"] == "multiply force by -1"


def test_a_curve_has_its_knots(dry):
    """In the order of its values, at its scale and middle."""
    curve = replace(DRY, shape=Shape.CURVE, scale=0.5, middle=0.1, places=(-1.0, 0.0, 2.0))
    names = [f"curve_at_{k}" for k in range(3)]
    figures = _term_figures(dry, "curve", curve, dict.fromkeys(names, dry.parameters["mass"]))
    assert figures["places"] == pytest.approx([-0.4, 0.1, 1.1])
    assert [*figures["parameters"]] == names
