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
        ("saturating", "add", "levels off beyond about 2 rad/s, and makes 0.01 N*m more at "),
        ("linear", "add", "makes 0.95 N*m more at 95 rad/s"),
        ("linear", "multiply", "makes 95 % more at 95 rad/s"),
        ("upper_stop", "add", "sets in above 2 rad/s, and makes 0.93 N*m more at 95 rad/s"),
    ],
)
def test_quantities_are_those_of_the_shape(shape, kind, told):
    """By hand: a tanh(x / w), a x and a (x - w), with a = 0.01 and w = 2."""
    assert wording.describe_quantities(*motor_report(shape, kind)).startswith(told)


def test_the_end_with_more_effect_is_stated():
    law_report, one = motor_report("linear", amount=-0.01)
    one.entry = replace(one.entry, visited=np.array([-200.0, 95.0]))
    assert wording.describe_quantities(law_report, one) == "makes 2 N*m more at -200 rad/s"


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0123, "1.2 %"),
        (0.5, "50 %"),
        (0.994, "99 %"),
        (0.995, "100 %"),
        (0.999, "100 %"),
        (1.234, "123 %"),
    ],
)
def test_a_share_has_two_digits(share, text):
    assert wording.format_percent(share) == text


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
        == "on data that no fit has seen the error of speed falls from 10 % to 5 %"
    )


def test_smoothed_noise_is_told_with_its_size():
    law_report, _ = motor_report("linear")
    assert wording.describe_smoothing(law_report) == ""
    law_report.laws.noise = {"voltage": 0.0123}
    assert " Noise on voltage (0.0123 V), which " in wording.describe_smoothing(law_report)


@pytest.mark.parametrize(
    ("causes", "confirmed", "last"),
    [
        (["friction(omega)"], True, False),
        (["sensor_lag(speed)", "friction(omega)"], True, True),
        (["sensor_lag(speed)"], False, True),
        ([], False, False),
    ],
)
def test_the_headline_begins_with_the_strongest(monkeypatch, causes, confirmed, last):
    best = SimpleNamespace(confirmed=confirmed)
    law_report = SimpleNamespace(best=best, effect_name=lambda correction: "friction(omega)")
    monkeypatch.setattr(wording, "LawReport", lambda result, laws: law_report)
    result = SimpleNamespace(diagnosis=SimpleNamespace(causes=causes), laws=None)
    assert wording._goes_last(result) is last
