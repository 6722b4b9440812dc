"""Claims: what must be known to read a verdict is said with it, and nothing where there is nothing to say."""

from __future__ import annotations

from dataclasses import replace

import pytest

from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.pipeline import Options, diagnose
from orchestration.discrepancy.report import terminal, wording
from orchestration.discrepancy.report.evidence_table import every_tried
from orchestration.discrepancy.report.summary import summary
from orchestration.fmu.model import find_model
from orchestration.reporting.plain import plain_text
from tests.support.diagnosis import rig_record

NOTHING = Options(effects=[])


@pytest.fixture(scope="module")
def actuator():
    return find_model("ppy_actuator")


def test_a_record_that_tells_all_needs_no_more_words(actuator):
    result = diagnose(rig_record(), actuator, options=NOTHING)
    assert wording.headline(result) == wording.sentence(result.diagnosis)


def test_a_missing_input_and_what_cannot_be_known_are_in_the_headline(actuator):
    result = diagnose(rig_record(None, "current", "voltage"), actuator, options=NOTHING)
    headline = wording.headline(result)
    assert (
        "lab record.csv has no force: taken to be 0 N throughout; --set force=... says otherwise; "
        in headline
    )
    assert (
        "the record does not determine alpha, k1, b1, k2, b2: hold what you know (--hold NAME)"
        in headline
    )
    assert summary(result)["headline"] == headline
    printed = " ".join(plain_text(terminal.overview(result)).split())
    assert printed.count("has no force") == 1
    assert " ".join(headline.split()) in printed


def test_what_is_held_is_no_reservation(actuator):
    known = ("alpha", "k1", "b1", "k2", "b2", "kelvin_elongation_start", "maxwell_elongation_start")
    options = Options({"force": 0.7}, effects=[], hold=known)
    result = diagnose(rig_record(None, "current", "voltage"), actuator, options=options)
    assert wording.headline(result) == wording.sentence(result.diagnosis)


def test_ratios_out_of_all_reason_are_in_the_headline(actuator):
    record = rig_record(None, "current", "force", "voltage")
    record = replace(record, signals=record.signals | {"voltage": 1e3 * record.signals["voltage"]})
    headline = wording.headline(diagnose(record, actuator, options=NOTHING))
    assert headline.count("out of all reason: ") == 1
    assert "R1 times " in headline


def test_why_an_effect_was_rejected_is_said_on_the_terminal_too(actuator):
    effects = ["strain_saturation", "quadratic_strain"]
    result = diagnose(rig_record("strain_saturation"), actuator, options=Options(effects=effects))
    rejected = [row for row in every_tried(result.diagnosis) if row.verdict == "rejected"]
    assert rejected
    printed = " ".join(plain_text(terminal.overview(result)).split())
    for row in rejected:
        assert f"{row.candidate.effect_name} {row.gain:.1f} rejected {row.why}" in printed


@pytest.mark.parametrize(
    ("margin", "said"), [(2e-5, False), (-2e-5, False), (12.0, True), (-3.0, True)]
)
def test_a_difference_that_is_none_is_not_told_as_one(margin, said):
    facts = {"course": "linear", "basis": "course", "margin": margin}
    assert ("BIC" in wording.message(Note(NoteCode.INTERSAMPLE, "current", facts))) is said


@pytest.mark.parametrize("asked", [True, False])
def test_an_input_that_is_forced_against_its_course_is_in_the_headline(actuator, asked):
    """The rig holds its inputs between samples."""
    result = diagnose(rig_record(), actuator, options=Options(effects=[], interpolate=asked))
    assert ("its course is one of steps" in wording.headline(result)) is asked
