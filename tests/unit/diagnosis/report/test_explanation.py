"""Claims: two candidates are compared by the features that decide, also one that no set had."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.diagnosis.report.explanation import explain
from orchestration.reporting.console import plain_text

DRY_NAME = "friction(velocity)"
CUBE_NAME = "spring_force(elongation)"


def test_the_hidden_friction_is_ahead_of_a_spring(dry):
    found = explain(dry, DRY_NAME, CUBE_NAME)
    assert found.lead > 0.0
    assert found.errors[0] < found.errors[1]
    assert found.comparison.left_out > 0.0
    assert found.sentence.startswith(f"{DRY_NAME} is ahead of {CUBE_NAME} by")


def test_the_other_way_round_everything_has_the_other_sign(dry):
    found = explain(dry, DRY_NAME, CUBE_NAME)
    turned = explain(dry, CUBE_NAME, DRY_NAME)
    assert turned.lead == pytest.approx(-found.lead)
    assert turned.comparison.left_out == pytest.approx(-found.comparison.left_out)
    assert turned.comparison.rise == pytest.approx(-found.comparison.rise)
    assert turned.likeness == pytest.approx(found.likeness)


def test_the_error_that_would_change_it_is_that_of_an_equal_score(dry):
    """The gain in log likelihood of n samples is n log of the ratio of errors."""
    found = explain(dry, DRY_NAME, "nothing")
    gain = found.samples * np.log(found.errors[1] / found.even_error)
    assert gain == pytest.approx(found.lead)
    assert "on which the model as it is has the lower error" in found.sentence
    narrow = replace(found, scores=(1.0, 0.0))
    needed = 100.0 * found.errors[1] * np.exp(-1.0 / found.samples)
    assert f"has an error of {needed:.3g} % instead of" in narrow.sentence


def test_a_candidate_that_no_set_had_is_fitted_now(dry):
    found = explain(dry, DRY_NAME, "spring_force(velocity)")
    assert [term.signal for term in found.models[1].terms] == ["velocity"]
    assert "spring force over velocity" in found.texts[1]
    # friction and spring act on the mass alike, so that this is the same cause by another name
    assert found.likeness > 0.99
    assert "do nearly the same" in found.sentence


def test_the_table_has_every_feature(dry):
    text = "".join(plain_text(part) for part in explain(dry, DRY_NAME, "nothing").overview())
    for feature in (
        "fitted samples",
        "unseen samples",
        "standard error",
        "coefficients",
        "prior against",
    ):
        assert feature in text


@pytest.mark.parametrize("name", ["friction", "friction(nowhere)", "nowhere(velocity)"])
def test_what_is_no_candidate_is_refused(dry, name):
    with pytest.raises(UserError, match=r"LAW\(SIGNAL\) or nothing; fitted were friction"):
        explain(dry, name, "nothing")


def test_a_candidate_is_not_compared_with_itself(dry):
    with pytest.raises(UserError, match="both candidates are the same"):
        explain(dry, DRY_NAME, DRY_NAME)


def test_a_reading_of_the_file_is_compared_with_a_law_that_was_fitted_beside_it(flipped):
    """The law is fitted to the file as it was read, where it has to do without the reading."""
    found = explain(flipped, "reading_sign(force)", DRY_NAME)
    assert found.models[1].reading is None
    assert found.lead > 0.0
    assert found.texts[0] == "force has the opposite sign in oscillator_1.csv"


def test_what_was_fitted_with_its_rival_only_is_said(flipped):
    with pytest.raises(UserError, match="a candidate is LAW"):
        explain(flipped, "reading_offset(force)", "nothing")
    both = explain(flipped, DRY_NAME, "nothing").models[0]
    together = replace(flipped, found=replace(flipped.found, fits=[both]))
    with pytest.raises(UserError, match="was fitted together with friction"):
        explain(together, "reading_sign(force)", DRY_NAME)
