"""Claims: the sections on laws show the curve, the equation and a row for every correction."""

from __future__ import annotations

import html
import re
from types import SimpleNamespace

import pytest

from fmus.kit.corrections import SignalTerm, correction
from orchestration.discrepancy.report.laws import wording
from orchestration.discrepancy.report.laws.page import add_laws
from orchestration.discrepancy.validation import Outcome
from orchestration.reporting.html import Page
from studies.plants.models.motor import Motor
from tests.support.law_reports import entry, motor_report


@pytest.fixture(autouse=True)
def amounts(monkeypatch):
    """A correction made by hand has no covariance, of which amounts are told."""
    monkeypatch.setattr(wording, "describe_shape_parameters", lambda *of: "amount 0.01 N m")


def page_of(law_report):
    page = Page("laws", "sentence")
    add_laws(page, law_report)
    return html.unescape(re.sub(r"<[^>]+>", " ", page.html()))


def test_a_correction_has_its_curve_its_law_and_its_row():
    law_report, _ = motor_report("linear")
    text = " ".join(page_of(law_report).split())
    assert "Friction over omega" in text
    assert "What friction lacks is added to what the model says" in text
    assert "cannot be told from Friction over omega friction(omega)" in text
    assert "12.0" in text
    assert "drop over current" in text  # which the record cannot tell from it
    assert "Which law over which signal" not in text  # there is one entry alone


@pytest.mark.parametrize(
    ("shape", "kind", "line"),
    [
        ("quadratic", "add", "friction = friction model + a omega^2"),
        ("linear", "multiply", "friction = friction model (1 + a omega)"),
        ("exponential", "add", "friction = friction model + a (exp(omega / w) - 1)"),
        ("sign_beyond", "add", "friction = friction model + a sign(omega) beyond |omega| = w"),
    ],
)
def test_the_law_is_an_equation_of_its_signal_without_the_remark(shape, kind, line):
    law_report, _ = motor_report(shape, kind=kind)
    assert line in " ".join(page_of(law_report).split())


def test_a_map_is_shown_where_there_is_more_than_one_law():
    law_report, _ = motor_report("linear", kind="multiply")
    law_report.found.entries.append(entry("drop", "current"))
    text = " ".join(page_of(law_report).split())
    assert "plus 1 is what the law is multiplied with" in text
    assert "the best of all would reach 3 in 19 records of 20" in text
    assert "Friction over omega, as a factor friction(omega)" in text


@pytest.mark.parametrize(
    ("outcome", "word"),
    [(Outcome.CONFIRMED, "confirmed"), (Outcome.REFUTED, "refuted"), (None, "not asked")],
)
def test_what_unseen_data_say_has_its_word(outcome, word):
    law_report, one = motor_report("linear")
    one.confirmation = outcome and SimpleNamespace(outcome=outcome)
    one.confirmed = outcome is Outcome.CONFIRMED
    one.errors = ({"speed": 0.1} if outcome else {}, {})
    assert word in page_of(law_report)


def test_what_is_there_beside_it_is_named_in_the_headings():
    law_report, _ = motor_report("linear")
    law_report.found.base.candidate.effects = (
        correction(Motor, "acceleration", SignalTerm("voltage"), "linear", "rad/s^2", 1.0),
    )
    beside = "beside acceleration that depends on voltage"
    assert f"Corrections that were fitted, {beside}" in page_of(law_report)
