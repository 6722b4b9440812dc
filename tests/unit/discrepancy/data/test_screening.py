"""Which data a diagnosis rests on: not what is too short, full of gaps, not excited or no
measurement.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from demonstrations.records import draw
from fmus.kit.errors import UserError
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.screening import (
    OVER_RECORD,
    has_transient,
    telling_of_simulation,
)
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.note import Note, NoteCode, UnusableRecordError
from orchestration.discrepancy.report.wording import message
from orchestration.records.quality import FAULTS
from tests.support.diagnosis import FEW, coloured, short_record
from tests.support.pace import slow_but
from tests.support.wired_motor import FRICTION, Motor, wired

LIMIT = 0.8  # V, of a recorder


def test_a_record_that_is_too_short_is_refused():
    with pytest.raises(UserError, match="3 samples are too few for a diagnosis; 225 are the least"):
        diagnose(PpyActuator, Dataset(np.arange(3.0), {}, {"voltage": np.zeros(3)}), FEW)


def test_numbers_that_no_sensor_gives_are_refused():
    data = short_record()
    for size, refusal in ((1e300, "values beyond"), (1e-200, "values all within")):
        with pytest.raises(UserError, match=f"voltage: {refusal}"):
            diagnose(
                PpyActuator,
                replace(data, measured={"voltage": size * data.measured["voltage"]}),
                FEW,
            )


def test_a_record_of_which_nothing_can_be_used_is_refused_with_the_reasons():
    data = short_record()
    with pytest.raises(UnusableRecordError) as refusal:
        diagnose(PpyActuator, replace(data, measured={"voltage": np.zeros(data.time.size)}), FEW)
    about = {(note.subject, note.code) for note in refusal.value.notes}
    assert about == {("voltage", NoteCode.DEAD_CONSTANT), ("", NoteCode.NOTHING_USABLE)}
    assert not any(note.held_out for note in refusal.value.notes)


def test_of_two_records_it_is_told_of_which_nothing_can_be_used():
    data = short_record()
    dead = replace(data, measured={"voltage": np.zeros(data.time.size)})
    with pytest.raises(UnusableRecordError) as refusal:
        diagnose(PpyActuator, data, FEW, holdout=dead)
    assert all(note.held_out for note in refusal.value.notes)
    note, _ = sorted(refusal.value.notes, key=lambda note: note.code)
    assert (
        message(note)
        == "in the record held out: voltage: constant at 0 while inputs move: a dead sensor, or"
        " nothing drives it; it is not used"
    )


def test_an_output_full_of_gaps_is_left_out_with_a_note():
    data = short_record()
    gaps = data.measured["voltage"].copy()
    gaps[::3] = np.nan
    diagnosis = diagnose(PpyActuator, replace(data, measured=data.measured | {"voltage": gaps}), [])
    assert list(diagnosis.residuals) == ["displacement"]
    assert Note(NoteCode.MANY_GAPS, "voltage") in diagnosis.notes


def test_an_output_that_ends_early_does_not_take_the_record_with_it():
    data = short_record()
    short = data.measured["displacement"].copy()
    short[80:] = np.nan
    diagnosis = diagnose(
        PpyActuator, replace(data, measured=data.measured | {"displacement": short}), []
    )
    assert list(diagnosis.residuals) == ["voltage"]
    (note,) = (note for note in diagnosis.notes if note.code is NoteCode.ENDS_EARLY)
    assert (note.subject, note.facts) == ("displacement", {"time": pytest.approx(15.8)})


def test_what_only_one_of_two_records_has_is_not_judged():
    data, other = short_record(), short_record()
    dead = data.measured | {"displacement": np.zeros(len(data.time))}
    for estimation, holdout in (
        (replace(data, measured=dead), other),
        (other, replace(data, measured=dead)),
    ):
        diagnosis = diagnose(PpyActuator, estimation, [], holdout=holdout)
        assert list(diagnosis.after) == ["voltage"]
        (note,) = (note for note in diagnosis.notes if note.code is NoteCode.DEAD_CONSTANT)
        assert note.held_out is (holdout is not other)


@pytest.mark.slow
def test_inputs_that_only_jitter_tell_nothing():
    data = short_record()
    jitter = {
        name: 0.5 + 1e-5 * coloured(0.0, k, u.size)
        for k, (name, u) in enumerate(data.inputs.items())
    }
    noise = {name: 1e-3 * np.ptp(y) * coloured(0.0, 7, y.size) for name, y in data.measured.items()}
    diagnosis = diagnose(PpyActuator, replace(data, inputs=jitter, measured=noise), FEW)
    assert (diagnosis.verdict, diagnosis.causes, diagnosis.changed) == ("ambiguous", [], [])
    assert NoteCode.EXCITATION_BELOW_NOISE in {note.code for note in diagnosis.notes}


@pytest.mark.parametrize(("size", "settles"), [(0.0, False), (0.1, False), (1.0, True)])
def test_what_settles_moves_by_more_than_noise(size, settles):
    time = np.arange(500.0)
    decay = size * np.exp(-time / 60.0) + 0.03 * coloured(0.0, 1, time.size)
    assert has_transient(Dataset(time, {}, {"y": decay})) is settles


def test_without_excitation_nothing_is_named():
    idle = short_record()
    still = {name: np.full_like(values, values[0]) for name, values in idle.inputs.items()}
    noise = {name: 1e-3 * coloured(0.0, 3, values.size) for name, values in idle.measured.items()}
    diagnosis = diagnose(PpyActuator, Dataset(idle.time, still, noise), FEW)
    assert diagnosis.causes == []
    assert diagnosis.verdict == "ambiguous"
    assert diagnosis.inconclusive
    assert diagnosis.notes[0].code is NoteCode.NO_EXCITATION


@pytest.mark.parametrize(
    ("reason", "part"),
    [
        ("not finite: x at 1 s", "from where it starts: not finite: x at 1 s; give other values"),
        ("not finite: d(x)/d(k) at 0 s", "infinite there, as that of sqrt(x) is at 0"),
    ],
)
def test_a_start_that_cannot_be_simulated_is_told_with_the_model(reason, part):
    with (
        pytest.raises(UserError, match=re.escape(part)) as told,
        telling_of_simulation(PpyActuator, OVER_RECORD),
    ):
        raise UserError(reason)
    assert str(told.value).startswith("ppy_actuator cannot be simulated over the record")


@pytest.mark.parametrize("fault", slow_but(["clipped", "dead", "stuck"], "clipped"))
def test_a_fault_of_the_data_is_no_cause(fault):
    data = short_record(rate=10.0)
    outputs = {name: values.copy() for name, values in data.measured.items()}
    if fault == "clipped":
        outputs["voltage"] = np.clip(outputs["voltage"], -LIMIT, LIMIT)
    else:
        first = round(0.6 * data.time.size) if fault == "dead" else 0
        outputs["displacement"][first:] = outputs["displacement"][first]
    diagnosis = diagnose(PpyActuator, replace(data, measured=outputs), FEW)
    assert fault in {FAULTS[note.code].kind for note in diagnosis.notes if note.code in FAULTS}
    assert diagnosis.causes == []
    assert diagnosis.verdict == "recalibrate"  # the rig is off nominal by up to 15 %
    if fault == "clipped":
        low, high = diagnosis.estimates["R1"].interval
        truth = draw(None, 1, duration=300.0, rate=10.0).truth.parameters
        assert low < truth.R1 < high


def test_a_resampled_record_gets_the_verdict_of_the_one_that_was_measured():
    """Lines between held inputs look like a delay of half a sample."""
    data = wired()
    fine = np.linspace(data.time[0], data.time[-1], 6 * (data.time.size - 1) + 1)

    def lines(columns):
        return {name: np.interp(fine, data.time, values) for name, values in columns.items()}

    resampled = Dataset(fine, lines(data.inputs), lines(data.measured))
    diagnosis = diagnose(Motor, resampled, [FRICTION])
    assert diagnosis.verdict is diagnose(Motor, wired(), [FRICTION]).verdict
    assert diagnosis.verdict in (Verdict.CONSISTENT, Verdict.RECALIBRATE)
    assert NoteCode.RESAMPLED in {note.code for note in diagnosis.notes}
