"""Claims: the verdict follows from what the best model does not account for."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit.sensors import measurement_effects
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy import conclude as conclusion
from orchestration.discrepancy.candidates import label
from orchestration.discrepancy.conclude import Verdict, errors_fall
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.report import wording
from tests.support.conclusion import conclude_again
from tests.support.diagnosis import FEW, coloured, short_record
from tests.support.gain import Gain
from tests.support.regression_model import STEP, Amplifier
from tests.support.several import Cell, measured
from tests.support.wired_motor import FRICTION, Motor, wired, with_dry_friction


@pytest.fixture(scope="module")
def diagnosis():
    return diagnose(Cell, measured(3, 4.0), [])


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


@pytest.mark.slow
def test_a_wrong_unit_is_no_cause():
    data = short_record("strain_saturation")
    wrong = data.measured | {"displacement": 1e3 * data.measured["displacement"]}
    diagnosis = diagnose(PpyActuator, replace(data, measured=wrong), FEW[:1])
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert NoteCode.IMPLAUSIBLE in {note.code for note in diagnosis.notes}
    assert "look at units, signs and columns first" in wording.sentence(diagnosis)


@pytest.mark.slow
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
    assert said.startswith("Strain that levels off at large charge: ")
    assert "Confirmed on the held-out third." in said
    assert (
        "Beside that, something is left that no known effect explains: voltage wanders slowly"
        in said
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


@pytest.mark.slow
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
    assert wording.message(note).lower() in wording.sentence(diagnosis).lower()


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


@pytest.mark.slow
def test_within_half_a_step_of_the_recorder_no_cause_is_named():
    named = diagnose(Motor, with_dry_friction(0.8), [FRICTION])
    coarse = Note(NoteCode.QUANTISED, "shown", {"resolution": 20.0, "share": 1.0})
    assert conclude_again(named, notes=[coarse]).causes == []
    fine = Note(NoteCode.QUANTISED, "shown", {"resolution": 0.02, "share": 1.0})
    assert conclude_again(named, notes=[fine]).causes == named.causes


@pytest.mark.slow
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
