"""Claims: the verdict follows from what the best model does not account for."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit import measurement_effects
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy import conclude as conclusion
from orchestration.discrepancy.candidates import label
from orchestration.discrepancy.conclude import DiagnosisData, Verdict, conclude, errors_fall
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.laws import search_of
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.validation import (
    ConfirmedSelection,
    confirm,
    errors_in_variables,
    predict,
)
from orchestration.discrepancy.validation.confirmation import FreeRunGain
from tests.support.diagnosis import FEW, coloured, short_record
from tests.support.gain import Gain
from tests.support.regression_model import OTHERS, STEP, Amplifier
from tests.support.several import Cell, measured
from tests.support.wired_motor import FRICTION, Motor, wired


def as_it_is(fitted, below):
    """Report a model as it is."""
    return fitted


@pytest.fixture(scope="module")
def diagnosis():
    return diagnose(Cell, measured(3, 4.0), [])


def conclude_again(diagnosis, **other):
    """Draw the conclusion of a diagnosis once more, from its own selection."""
    judged = confirm(diagnosis.selection, diagnosis.validation, as_it_is)
    return conclude_judged(diagnosis, judged, **other)


def conclude_judged(diagnosis, judged, **other):
    """Draw the conclusion from the data of a diagnosis and a selection that was judged."""
    data = DiagnosisData(
        estimation=diagnosis.estimation,
        validation=diagnosis.validation,
        usable=diagnosis.usable,
        more_than_estimation=True,
        parameters=list(diagnosis.selection.base.problem.names),
        intersample=diagnosis.intersample,
        input_noise=errors_in_variables.no_input_noise(diagnosis.selection.base),
    )
    return conclude(search_of(diagnosis), judged, replace(data, **other))


def test_a_conclusion_drawn_again_is_the_same(diagnosis):
    again = conclude_again(diagnosis)
    assert again.verdict is diagnosis.verdict is Verdict.RECALIBRATE
    assert again.changed == diagnosis.changed
    assert again.judged_errors == diagnosis.judged_errors
    for name, estimate in diagnosis.estimates.items():
        assert again.estimates[name].value == pytest.approx(estimate.value, rel=1e-5)


def test_the_notes_on_the_data_come_first(diagnosis):
    note = Note(NoteCode.EVEN_CLOCK)
    assert conclude_again(diagnosis, notes=[note]).notes == [note, *conclude_again(diagnosis).notes]


def test_all_that_was_measured_is_fitted_to_at_the_end(diagnosis):
    assert len(diagnosis.final.problem.time) == len(measured(3, 4.0).time)
    assert len(diagnosis.usable.time) == len(measured(3, 4.0).time)
    stays = conclude_again(diagnosis, usable=diagnosis.estimation, more_than_estimation=False)
    assert stays.final is diagnosis.selection.best


def test_nothing_is_claimed_of_a_record_that_tells_nothing(diagnosis):
    again = conclude_again(diagnosis, informative=False)
    assert again.verdict is Verdict.AMBIGUOUS
    assert again.inconclusive
    assert again.changed == []


@pytest.mark.parametrize(
    ("after", "gained"),
    [
        ({"a": 0.5, "b": 1.0}, True),
        ({"a": 0.5, "b": 1.09}, True),
        ({"a": 0.5, "b": 1.11}, False),
        ({"a": 1.0, "b": 1.0}, False),
    ],
)
def test_a_gain_is_an_error_that_falls_and_none_that_grows(after, gained):
    assert errors_fall({"a": 1.0, "b": 1.0}, after) is gained


def test_a_hum_is_not_explained():
    diagnosis = diagnose(PpyActuator, short_record("hum"), FEW[:1])
    assert diagnosis.verdict is Verdict.UNEXPLAINED


def test_a_wrong_unit_is_no_cause():
    data = short_record("strain_saturation")
    wrong = data.measured | {"displacement": 1e3 * data.measured["displacement"]}
    diagnosis = diagnose(PpyActuator, replace(data, measured=wrong), FEW[:1])
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert NoteCode.IMPLAUSIBLE in {note.code for note in diagnosis.notes}
    assert "look at units, signs and columns first" in wording.sentence(diagnosis)


def test_what_is_left_where_the_cause_does_not_act_is_told():
    """A saturation of the strain does not touch the voltage, which wanders."""
    data = short_record("strain_saturation")
    wander = 2e-3 * np.cumsum(coloured(0.0, 5, data.time.size))
    wandering = data.measured | {"voltage": data.measured["voltage"] + wander}
    diagnosis = diagnose(PpyActuator, replace(data, measured=wandering), FEW[:1])
    assert diagnosis.verdict is Verdict.CAUSE
    assert not diagnosis.explained
    assert NoteCode.SOMETHING_LEFT in {note.code for note in diagnosis.notes}
    assert diagnosis.causes[:1] == ["strain_saturation"]
    said = wording.sentence(diagnosis)
    assert said.startswith(
        "What the model gets wrong: strain_saturation (confirmed on the held-out third)"
    )
    assert (
        "Beside that, something is left that nothing in the catalogue accounts for: voltage wanders"
        " slowly" in said
    )


@pytest.mark.parametrize(
    ("size", "slow", "code"),
    [
        (3.0, True, NoteCode.UNRELATED),
        (0.5, True, NoteCode.LARGE_ERROR),
        (0.05, True, None),
        (3.0, False, None),
    ],
)
def test_a_large_error_that_goes_slowly_is_not_fine(size, slow, code):
    """An error as large as the signal: a slow one is of no sensor, white noise may be.

    The signal has a deviation of 2 / sqrt(3): the errors are 93 and 40 % of what is shown.
    """
    rng = np.random.default_rng(5)
    signal = rng.uniform(-1.0, 1.0, 1500)
    error = lfilter([1.0], [1.0, -0.95], rng.normal(size=1500)) if slow else rng.normal(size=1500)
    shown = 2.0 * signal + size * error / error.std()
    data = Dataset(STEP * np.arange(1500), {"signal": signal}, {"shown": shown})
    diagnosis = diagnose(Amplifier, data, [])
    codes = {note.code for note in diagnosis.notes}
    assert codes & {NoteCode.LARGE_ERROR, NoteCode.UNRELATED} == ({code} if code else set())
    if code:
        assert diagnosis.verdict is Verdict.UNEXPLAINED


def test_where_a_model_does_not_describe_a_record_nothing_is_named():
    """What is measured wanders on its own; a friction may follow some of it, which says nothing."""
    rng = np.random.default_rng(5)
    data = wired()
    walk = np.cumsum(rng.standard_normal(len(data.time)))
    diagnosis = diagnose(Motor, replace(data, measured={"shown": walk / np.std(walk)}), [FRICTION])
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert diagnosis.causes == []
    assert diagnosis.confirmations == {}
    (note,) = [note for note in diagnosis.notes if note.code is NoteCode.UNRELATED]
    assert wording.message(note) in wording.sentence(diagnosis)


@pytest.mark.parametrize(("fall", "stays"), [(4.0, True), (1.0, False)])
def test_a_cause_that_may_do_nothing_in_the_final_model_is_named_only_if_unseen_data_need_it(
    monkeypatch, fall, stays
):
    """It was named first; beside the second, linear regression does not know its sign.

    Its interval is then as wide as the free runs are sure: half a width of 1.96 / 4 of its value.
    """
    monkeypatch.setattr(conclusion, "free_run_gain", lambda *_: FreeRunGain(0.5, fall))
    rng = np.random.default_rng(3)
    signal = rng.standard_normal(900)
    shown = 2.0 * signal + 0.5 * np.abs(signal) + 0.1 * rng.standard_normal(900)
    table = np.column_stack([signal, np.abs(signal), signal**3])
    least, (left,) = np.linalg.lstsq(table, shown)[:2]
    error = np.sqrt(left / 900 * np.linalg.inv(table.T @ table)[2, 2])
    assert abs(least[2]) < 1.96 * error
    data = Dataset(STEP * np.arange(900), {"signal": signal}, {"shown": shown})
    asymmetric, cubic = OTHERS[1:]
    found = diagnose(Amplifier, data, [asymmetric])
    search = search_of(found)
    (step,) = found.selection.steps
    first = search.fit_from(found.selection.base.candidate.with_effect(cubic), step.chosen)
    both = search.fit_from(first.candidate.with_effect(asymmetric), step.chosen)
    steps = [replace(step, chosen=first, gains={cubic.id: 1.0}), replace(step, chosen=both)]
    judged = ConfirmedSelection(
        replace(found.selection, steps=steps),
        [predict(found.validation, one) for one in (found.selection.base, first, both)],
        {},
        [],
    )
    anew = conclude_judged(found, judged)
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
        conclusion, "undetermined_effects", lambda model, _: [*model.candidate.effects]
    )
    found = diagnose(Amplifier, data, OTHERS[1:2])
    assert found.causes == [label(OTHERS[1])]
    low, high = found.estimates[OTHERS[1].neutral].interval
    assert 0.0 < low < 0.1 < high


def test_of_an_output_that_rests_no_error_is_a_share():
    rest = np.full(50, 3.0)
    wide = np.linspace(-1.0, 1.0, 50)
    outputs = {"rests": rest, "moves": wide}
    fit = SimpleNamespace(
        noise={output: SimpleNamespace(deviation=1.0) for output in outputs},
        residual=dict.fromkeys(outputs, wide),
        innovation=dict.fromkeys(outputs, 0.1 * wide),
    )
    present = dict.fromkeys(outputs, np.ones(50, dtype=bool))
    best = SimpleNamespace(fit=fit, problem=SimpleNamespace(measured=outputs, present=present))
    assert conclusion._large_errors(best) == {"moves": pytest.approx(1.0)}


def with_friction(wave=0.0):
    """A motor with dry friction, which has a cause, and a wave beside it, which has none."""
    data = wired()
    speed = np.zeros(len(data.time))
    drive = data.inputs["drive"]
    for k in range(len(speed) - 1):
        rate = 3.75 * drive[k] - 1.25 * speed[k] - 0.8 * np.tanh(speed[k] / 0.05)
        speed[k + 1] = speed[k] + 0.1 * rate
    noise = 0.02 * coloured(0.0, 2, len(speed)) + wave * np.sin(0.9 * data.time)
    return replace(data, measured={"shown": speed + noise})


def test_beside_parameters_out_of_all_reason_no_cause_is_named_that_leaves_something(monkeypatch):
    whole = diagnose(Motor, with_friction(), [FRICTION])
    named = diagnose(Motor, with_friction(wave=0.1), [FRICTION])
    assert whole.causes == named.causes == ["coulomb_friction"]
    monkeypatch.setattr(conclusion, "implausible", lambda *_: {"gain": 159.0})
    assert conclude_again(whole).causes == whole.causes
    again = conclude_again(named)
    assert (again.verdict, again.causes) == (Verdict.UNEXPLAINED, [])
    (note,) = [note for note in again.notes if note.code is NoteCode.IMPLAUSIBLE]
    assert note.facts["ratios"] == {"gain": 159.0}


def creeping():
    """A motor so slow that its dry friction, 0.8 tanh(v / 0.01), cannot be told from drag.

    The drag of both together is 81 times nominal.
    """
    data = wired()
    drive = 0.02 * data.inputs["drive"]
    speed = np.zeros(len(data.time))
    for k in range(len(speed) - 1):
        now = speed[k]
        for _ in range(100):
            now += 1e-3 * (3.75 * drive[k] - 1.25 * now - 0.8 * np.tanh(now / 0.01))
        speed[k + 1] = now
    noise = 3e-5 * coloured(0.0, 2, len(speed))
    return replace(data, inputs={"drive": drive}, measured={"shown": speed + noise})


def test_a_cause_is_named_where_else_a_parameter_were_out_of_all_reason():
    diagnosis = diagnose(Motor, creeping(), [FRICTION])
    assert (diagnosis.verdict, diagnosis.causes) == (Verdict.CAUSE, ["coulomb_friction"])
    assert NoteCode.IMPLAUSIBLE not in {note.code for note in diagnosis.notes}
    low, high = diagnosis.estimates["drag"].interval
    assert low < 1.25 < high


def test_within_half_a_step_of_the_recorder_no_cause_is_named():
    named = diagnose(Motor, with_friction(), [FRICTION])
    coarse = Note(NoteCode.QUANTISED, "shown", {"resolution": 20.0, "share": 1.0})
    assert conclude_again(named, notes=[coarse]).causes == []
    fine = Note(NoteCode.QUANTISED, "shown", {"resolution": 0.02, "share": 1.0})
    assert conclude_again(named, notes=[fine]).causes == named.causes


@pytest.mark.parametrize(("lag", "causes"), [(0.5, ["sensor_lag(y)"]), (0.0, [])])
def test_rounding_is_judged_where_a_record_moves(lag, causes):
    """The record rests for all but a hundredth of the time, where a lag makes no error."""
    rng = np.random.default_rng(6)
    pulse = np.append(np.ones(3), np.zeros(300))
    u = np.concatenate([size * pulse for size in rng.uniform(-8.0, 8.0, 15)])
    y = lfilter([1.0 - lag], [1.0, -lag], u) + 0.1 * rng.standard_normal(u.size)
    data = Dataset(0.1 * np.arange(u.size), {"u": u}, {"y": np.round(y)})
    effects = [one for one in measurement_effects(Gain) if label(one) == "sensor_lag(y)"]
    diagnosis = diagnose(Gain, data, effects)
    assert NoteCode.QUANTISED in {note.code for note in diagnosis.notes}
    assert diagnosis.causes == causes
