"""Claims: the answer is in percent, an open interval says so, and every verdict has a next step."""

from __future__ import annotations

from dataclasses import replace

import pytest

from orchestration.diagnosis.report import wording
from tests.support.oscillator import with_group


def test_headline_gives_each_cause_its_percent_and_the_rest(dry):
    ambiguous = with_group(dry, "ambiguous", 0.82, 0.15)
    assert wording.headline(ambiguous) == (
        "82 % friction over velocity; 15 % friction over elongation; 3 % other"
    )
    step = wording.next_step(ambiguous)
    assert "velocity and elongation do not move together" in step


def test_no_headline_is_certain():
    assert wording.percent(0.9999) == "> 99 %"
    assert wording.percent(1e-9) == "< 1 %"
    assert wording.percent(0.456) == "46 %"


@pytest.mark.parametrize(
    ("interval", "words"),
    [
        ((1.0, 2.0), "1 … 2 kg"),
        ((1.0, float("inf")), "at least 1 kg"),
        ((0.0, 2.0), "0 … 2 kg"),
        ((float("-inf"), 2.0), "at most 2 kg"),
        ((0.0, float("inf")), "not determined"),
    ],
)
def test_an_open_interval_says_at_least(dry, interval, words):
    estimate = replace(dry.parameters["mass"], interval=interval)
    assert wording.interval(dry, "mass", estimate) == words
