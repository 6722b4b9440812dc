"""Claims: a cause stays in the final model if the record needs it there, within reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.discrepancy import final_model
from orchestration.discrepancy.candidates import label
from orchestration.discrepancy.conclude import Verdict
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.validation import (
    ConfirmedSelection,
    predict,
)
from orchestration.discrepancy.validation.confirmation import FreeRunGain
from tests.support.conclusion import conclude_again, conclude_judged, search_of
from tests.support.regression_model import OTHERS, STEP, Amplifier
from tests.support.several import Cell, measured
from tests.support.wired_motor import FRICTION, Motor, with_dry_friction


@pytest.fixture(scope="module")
def diagnosis():
    return diagnose(Cell, measured(3, 4.0), [])


def test_all_that_was_measured_is_fitted_to_at_the_end(diagnosis):
    assert len(diagnosis.final.problem.time) == len(measured(3, 4.0).time)
    assert len(diagnosis.usable.time) == len(measured(3, 4.0).time)
    stays = conclude_again(diagnosis, usable=diagnosis.estimation, more_than_estimation=False)
    assert stays.final is diagnosis.selection.best


def asymmetric_record():
    """A record of an asymmetric part: linear regression does not know the sign of a cubic one."""
    rng = np.random.default_rng(3)
    signal = rng.standard_normal(900)
    shown = 2.0 * signal + 0.5 * np.abs(signal) + 0.1 * rng.standard_normal(900)
    table = np.column_stack([signal, np.abs(signal), signal**3])
    least, (left,) = np.linalg.lstsq(table, shown)[:2]
    error = np.sqrt(left / 900 * np.linalg.inv(table.T @ table)[2, 2])
    assert abs(least[2]) < 1.96 * error
    return Dataset(STEP * np.arange(900), {"signal": signal}, {"shown": shown})


def selected_after(found, earlier, cause):
    """Return the selection that would have been if another effect were selected before a cause."""
    search = search_of(found)
    (step,) = found.selection.steps
    first = search.fit_from(found.selection.base.candidate.with_effect(earlier), step.chosen)
    both = search.fit_from(first.candidate.with_effect(cause), step.chosen)
    steps = [replace(step, chosen=first, gains={earlier.id: 1.0}), replace(step, chosen=both)]
    fits = (found.selection.base, first, both)
    return ConfirmedSelection(
        replace(found.selection, steps=steps),
        [predict(found.validation, one) for one in fits],
        {},
        [],
    )


@pytest.mark.parametrize(("fall", "stays"), [(4.0, True), (1.0, False)])
def test_a_cause_that_may_do_nothing_in_the_final_model_is_named_only_if_unseen_data_need_it(
    monkeypatch, fall, stays
):
    """It was named first; beside the second, linear regression does not know its sign.

    Its interval is then as wide as the free runs are sure: half a width of 1.96 / 4 of its value.
    """
    monkeypatch.setattr(final_model, "free_run_gain", lambda *_: FreeRunGain(0.5, fall))
    asymmetric, cubic = OTHERS[1:]
    found = diagnose(Amplifier, asymmetric_record(), [asymmetric])
    anew = conclude_judged(found, selected_after(found, cubic, asymmetric))
    if stays:
        assert anew.selection.best.candidate.effects == (cubic, asymmetric)
        strength = anew.estimates[cubic.neutral]
        ends = strength.value * np.array([1.0 - 1.96 / fall, 1.0 + 1.96 / fall])
        assert sorted(strength.interval) == pytest.approx(sorted(ends), rel=1e-3)
        return
    assert anew.causes == found.causes == [label(asymmetric)]
    assert anew.confirmations.keys() == {label(asymmetric)}
    (note,) = [note for note in anew.notes if note.code is NoteCode.MAY_BE_NEUTRAL]
    assert note.subject == label(cubic)
    assert note.facts["low"] < 0.0 < note.facts["high"]


def test_a_cause_that_the_record_needs_keeps_its_name_whatever_its_interval(monkeypatch):
    """Its interval is that of the likelihood ratio then, and does not hold zero."""
    rng = np.random.default_rng(3)
    signal = rng.standard_normal(900)
    shown = 2.0 * signal + 0.1 * np.abs(signal) + 0.1 * rng.standard_normal(900)
    data = Dataset(STEP * np.arange(900), {"signal": signal}, {"shown": shown})
    monkeypatch.setattr(
        final_model, "undetermined_effects", lambda model, _: [*model.candidate.effects]
    )
    found = diagnose(Amplifier, data, OTHERS[1:2])
    assert found.causes == [label(OTHERS[1])]
    low, high = found.estimates[OTHERS[1].neutral].interval
    assert 0.0 < low < 0.1 < high


@pytest.mark.slow
def test_beside_parameters_out_of_all_reason_no_cause_is_named_that_leaves_something(monkeypatch):
    whole = diagnose(Motor, with_dry_friction(0.8), [FRICTION])
    named = diagnose(Motor, with_dry_friction(0.8, wave=0.1), [FRICTION])
    assert whole.causes == named.causes == ["coulomb_friction"]
    monkeypatch.setattr(final_model, "implausible", lambda *_: {"gain": 159.0})
    assert conclude_again(whole).causes == whole.causes
    again = conclude_again(named)
    assert (again.verdict, again.causes) == (Verdict.UNEXPLAINED, [])
    (note,) = [note for note in again.notes if note.code is NoteCode.IMPLAUSIBLE]
    assert note.facts["ratios"] == {"gain": 159.0}


@pytest.mark.slow
def test_a_cause_is_named_where_else_a_parameter_were_out_of_all_reason():
    """It is so slow that dry friction cannot be told from drag: of both, 81 times nominal."""
    creeping = with_dry_friction(0.8, width=0.01, drive=0.02, noise=3e-5)
    diagnosis = diagnose(Motor, creeping, [FRICTION])
    assert (diagnosis.verdict, diagnosis.causes) == (Verdict.CAUSE, ["coulomb_friction"])
    assert NoteCode.IMPLAUSIBLE not in {note.code for note in diagnosis.notes}
    low, high = diagnosis.estimates["drag"].interval
    assert low < 1.25 < high
