"""Claims: a correction is told in quantities that can be checked by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.validation import Outcome
from tests.support.law_reports import motor_report


@pytest.mark.parametrize(
    ("shape", "kind", "told"),
    [
        ("saturating", "add", "levels off beyond about 2.00 rad/s, and makes 10.0 mN·m more at "),
        ("linear", "add", "makes 950 mN·m more at 95.0 rad/s"),
        ("linear", "multiply", "makes 95 % more at 95.0 rad/s"),
        ("upper_stop", "add", "sets in above 2.00 rad/s, and makes 930 mN·m more at 95.0 rad/s"),
    ],
)
def test_quantities_are_those_of_the_shape(shape, kind, told):
    """By hand: a tanh(x / w), a x and a (x - w), with a = 0.01 and w = 2."""
    assert wording.describe_quantities(*motor_report(shape, kind)).startswith(told)


def test_the_end_with_more_effect_is_stated():
    law_report, one = motor_report("linear", amount=-0.01)
    one.entry = replace(one.entry, visited=np.array([-200.0, 95.0]))
    assert wording.describe_quantities(law_report, one) == "makes 2.00 N·m more at −200 rad/s"


def test_unseen_data_have_a_word():
    _, one = motor_report("linear")
    assert wording.unseen_data_outcome(one) == "not asked"
    one.errors = ({"speed": 0.1}, {"speed": 0.05})
    assert wording.unseen_data_outcome(one) == "confirmed"
    one.confirmed = False
    assert wording.unseen_data_outcome(one) == "not confirmed"
    one.confirmation = SimpleNamespace(outcome=Outcome.REFUTED)
    assert wording.unseen_data_outcome(one) == "refuted"


def test_the_error_that_falls_most_is_told():
    _, one = motor_report("linear")
    one.errors = ({"speed": 0.1, "current": 0.4}, {"speed": 0.05, "current": 0.3})
    assert (
        wording.describe_errors(one)
        == "on data that no fit has seen the error of speed falls from 10.0 % to 5.0 %"
    )


@pytest.mark.parametrize(
    ("after", "told"), [(0.00698, "falls from 0.704 % to 0.698 %"), (0.00704, "stays at 0.7 %")]
)
def test_an_error_that_hardly_falls_is_not_told_as_from_one_figure_to_the_same(after, told):
    _, one = motor_report("linear")
    one.errors = ({"speed": 0.00704}, {"speed": after})
    assert wording.describe_errors(one).endswith(f"the error of speed {told}")


def test_smoothed_noise_is_told_with_its_size():
    law_report, _ = motor_report("linear")
    assert wording.describe_smoothing(law_report) == ""
    law_report.laws.noise = {"voltage": 0.0123}
    assert " Noise on voltage (12.3 mV), which " in wording.describe_smoothing(law_report)


def test_a_law_is_told_by_its_shape_in_place_of_its_parameters():
    law_report, one = motor_report("saturating")
    law_report.laws.cause = SimpleNamespace(effect=one.model.effect, effect_name="friction(omega)")
    (told,) = wording._phrases(law_report).items()
    assert told == (
        "friction(omega)",
        "it looks like a saturation, and levels off beyond about 2.00 rad/s, and makes 10.0 mN·m"
        " more at 95.0 rad/s",
    )


@pytest.mark.parametrize(("causes", "count"), [(["friction(omega)"], 0), ([], 1)])
def test_what_is_no_cause_comes_after_the_verdict(monkeypatch, causes, count):
    monkeypatch.setattr(wording, "describe_shape", lambda law_report, correction: "a line")
    law_report, one = motor_report("linear")
    one.confirmed = False
    one.errors = ({"speed": 0.1}, {"speed": 0.05})
    result = SimpleNamespace(diagnosis=SimpleNamespace(causes=causes))
    sentences = wording._beside_verdict(replace(law_report, result=result))
    assert len(sentences) == count
    assert all(text.startswith("Friction over omega would be worth") for text in sentences)
