"""Claims: a terminal shows the headline once, and why effects were rejected."""

from __future__ import annotations

import pytest

from orchestration.discrepancy.pipeline import DiagnosisOptions, diagnose
from orchestration.discrepancy.report import terminal, wording
from orchestration.discrepancy.report.summary import diagnosis_summary
from orchestration.discrepancy.report.tables import tried_effects
from orchestration.fmu.model import find_model
from orchestration.reporting.console import plain_text
from tests.support.diagnosis import rig_record

NOTHING = DiagnosisOptions(effects=[])


@pytest.fixture(scope="module")
def actuator():
    return find_model("ppy_actuator")


def test_a_missing_input_and_what_cannot_be_known_are_in_the_headline(actuator):
    result = diagnose(rig_record(None, "current", "voltage"), actuator, options=NOTHING)
    headline = str(wording.headline(result))
    assert (
        "lab record.csv has no force: taken to be 0 N throughout; settings={'force': '...'} says"
        " otherwise; " in headline
    )
    assert (
        "the record does not determine alpha, k1, b1, k2, b2: hold what you know (hold=['NAME'])"
        in headline
    )
    assert diagnosis_summary(result)["headline"] == headline
    printed = " ".join(plain_text(terminal.overview(result)).split())
    assert printed.count("has no force") == 1
    assert " ".join(headline.split()) in printed


@pytest.mark.slow
def test_why_an_effect_was_rejected_is_said_on_the_terminal_too(actuator):
    effects = ["strain_saturation", "quadratic_strain"]
    result = diagnose(
        rig_record("strain_saturation"), actuator, options=DiagnosisOptions(effects=effects)
    )
    rejected = [row for row in tried_effects(result.diagnosis) if row.verdict == "rejected"]
    assert rejected
    printed = " ".join(plain_text(terminal.overview(result)).split())
    for row in rejected:
        assert f" {row.gain:.1f} rejected " in printed
        assert row.candidate.effect_name in printed
        assert set(row.reason.split()) <= set(printed.split())
