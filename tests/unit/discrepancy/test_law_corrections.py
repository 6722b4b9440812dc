"""Claims: a correction that unseen data confirm is a cause, and the conclusion is drawn with it."""

from __future__ import annotations

from dataclasses import replace
from math import sin, tanh

import pytest

from fmus.kit.corrections import SignalTerm, SmoothTable, correction
from orchestration.api.records import read_record
from orchestration.discrepancy.conclude import Verdict
from orchestration.discrepancy.law_corrections import (
    _conclude_anew,
    leaves_something,
    same_effect,
    search_laws,
)
from orchestration.discrepancy.laws import search_of
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.pipeline import diagnose_only
from orchestration.discrepancy.selection import Step
from orchestration.discrepancy.validation import confirm
from orchestration.fmu import find_model
from orchestration.fmu.model import families
from studies.clean.records import Case, draw
from studies.hidden_laws.place import over
from studies.plants.library import PLANTS
from studies.plants.models.motor import EFFECTS, Motor
from tests.support.lacking import diagnosed, motor


@pytest.fixture(scope="module")
def diagnosis(tmp_path_factory):
    """Diagnose a motor with a friction that no catalogue has."""
    path = tmp_path_factory.mktemp("motor") / "motor.csv"
    drawn = motor(path, lambda speed: 0.01 * sin(speed / 25.0))
    return diagnosed(path, drawn.plant.model)


@pytest.mark.slow
def test_a_corrected_diagnosis_keeps_what_is_said_of_the_data(diagnosis):
    kept = Note(NoteCode.QUANTISED, "speed")
    before = replace(diagnosis, notes=[kept, *diagnosis.notes, Note(NoteCode.AT_BOUND)])
    laws, corrected = search_laws(before)
    assert leaves_something(before)
    assert laws.best.confirmed
    assert corrected.verdict is Verdict.CAUSE
    assert corrected.causes == ["friction(omega)"]
    assert corrected.final.candidate.effects == (laws.cause.effect,)
    assert corrected.estimation is before.estimation
    assert corrected.validation is before.validation
    assert corrected.notes[0] == kept
    assert Note(NoteCode.AT_BOUND) not in corrected.notes, "that was about another model"
    for output, error in corrected.after.items():
        assert error < before.after[output]


@pytest.mark.slow
def test_what_was_named_before_a_law_stays_only_if_it_is_needed_beside_it(diagnosis):
    """A drag was named for the wave of the friction, which the law has no need of."""
    search = search_of(diagnosis)
    base = diagnosis.selection.base
    drag = families(Motor)["quadratic_drag(friction)"]
    fitted = search.fit_from(base.candidate.with_effect(drag), base)
    step = Step(fitted, 20.0, 20.0, 0.0, [], [], gains={fitted.effect_name: 20.0})
    before = replace(
        diagnosis,
        verdict=Verdict.CAUSE,
        selection=replace(diagnosis.selection, steps=[step]),
        notes=[Note(NoteCode.SOMETHING_LEFT)],
    )
    _, corrected = search_laws(before)
    assert corrected.causes == ["friction(omega)"]
    assert fitted.effect_name in [
        one.effect_name for one, _ in corrected.selection.steps[0].rejected
    ]


@pytest.mark.slow
@pytest.mark.parametrize("told_apart", [True, False])
def test_beside_a_correction_what_cannot_be_told_apart_is_ambiguous(diagnosis, told_apart):
    """What stands first after it is judged anew has an alternative, or none."""
    search = search_of(diagnosis)
    base = diagnosis.selection.base
    known = families(Motor)
    drag, sliding = (
        search.fit_from(base.candidate.with_effect(known[name]), base)
        for name in ("quadratic_drag(friction)", "sliding_friction(friction)")
    )
    others = [] if told_apart else [sliding]
    step = Step(drag, 20.0, 20.0, 0.0, others, [], gains={sliding.effect_name: 19.0})
    selection = replace(diagnosis.selection, steps=[step])
    judged = confirm(selection, diagnosis.validation, lambda fitted, _: fitted)
    corrected = _conclude_anew(diagnosis, search, judged)
    assert corrected.causes == ["quadratic_drag(friction)"]
    assert corrected.verdict is (Verdict.CAUSE if told_apart else Verdict.AMBIGUOUS)


@pytest.mark.slow
def test_a_resistance_that_falls_with_charge_is_named_alone(tmp_path):
    """Effects of the catalogue fit it, and are named before laws are searched."""
    lack = over("series_resistance + charge", lambda q: -0.111 * tanh(q / 1.57))
    plant = PLANTS["Actuator"].with_hidden(lack.change)
    drawn = draw(Case("Actuator", "PRBS", "Gaussian", 1), plant=plant)
    path = drawn.write(tmp_path / "record.csv")
    subject = find_model(drawn.plant.model)
    record = [read_record(path, subject)]
    named = diagnose_only(record, subject).diagnosis
    assert named.causes, "otherwise this record shows nothing"
    _, result = search_laws(named)
    assert result.causes == ["immediate_resistance(charge)"]
    strength = result.estimates["immediate_resistance_of_charge"]
    width = result.estimates["immediate_resistance_of_charge_width"]
    assert strength.value == pytest.approx(-0.111, rel=0.02)
    assert width.value == pytest.approx(1.57, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("verdict", "codes", "leaves"),
    [
        (Verdict.UNEXPLAINED, [], True),
        (Verdict.CAUSE, [NoteCode.SOMETHING_LEFT], True),
        (Verdict.CAUSE, [NoteCode.NO_GAIN], False),
        (Verdict.AMBIGUOUS, [NoteCode.SOMETHING_LEFT], True),
        (Verdict.AMBIGUOUS, [], False),
        (Verdict.RECALIBRATE, [], False),
    ],
)
def test_laws_are_searched_where_causes_do_not_account_for_all(diagnosis, verdict, codes, leaves):
    notes = [Note(code) for code in codes]
    assert leaves_something(replace(diagnosis, verdict=verdict, notes=notes)) is leaves


def test_only_the_same_function_of_the_same_signal_is_the_same_effect():
    effects = [*EFFECTS.values(), *families(Motor).values()]

    def known(law, of, shape, kind="add"):
        effect = same_effect(effects, correction(Motor, law, of, shape, "N*m", 0.01, kind=kind))
        return effect.id if effect else None

    speed = SignalTerm("omega", scale=100.0)
    assert (
        known("friction", speed, "sign")
        == known("friction", speed, "saturating")
        == "coulomb_friction"
    )
    assert known("friction", speed, "odd_quadratic") == "quadratic_drag"
    assert known("friction", speed, "cubic") == "cubic_stiffness"
    assert known("friction", speed, "exponential") is None
    assert known("friction", speed, "sign", "multiply") is None
    assert known("friction", speed, SmoothTable([-1.0, 1.0])) is None
    assert known("friction", SignalTerm("voltage"), "sign") is None
    assert known("friction", SignalTerm("omega", "lagged", 0.1), "sign") is None
    assert (
        known("winding_current", SignalTerm("voltage", "leading", 0.1), "linear")
        == "parallel_rc_branch"
    )
