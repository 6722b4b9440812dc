"""Claims: columns that are mixed up are told, and not what is wrong with a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Output
from fmus.kit.sensors import measurement_effects
from orchestration.discrepancy import diagnosis as whole_diagnosis
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.note import MIXED_UP, Note, NoteCode
from orchestration.discrepancy.report import wording
from tests.support.gain import Gain
from tests.support.wired_motor import FRICTION, STEP, Motor, wired, with_dry_friction


class TwiceShown(Motor):
    """A motor of which the acceleration is shown too."""

    @Output("m/s^2")
    def second(self):
        """As measured."""
        return self.acceleration()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "code"),
    [
        ({"exchanged": True}, NoteCode.EXCHANGED),
        ({"drive_sign": -1.0}, NoteCode.OTHER_SIGN),
        pytest.param({"shown_sign": -1.0}, NoteCode.OTHER_SIGN, marks=pytest.mark.slow),
    ],
)
def test_columns_that_are_mixed_up_are_told_and_nothing_is_named(how, code):
    diagnosis = diagnose(Motor, wired(**how), [FRICTION])
    (note,) = [note for note in diagnosis.notes if note.code in MIXED_UP]
    assert note.code is code
    # exchanged, what is fed is held where the course of the other column was smooth
    assert note.facts["instead"] < 0.1 < 0.3 < note.facts["share"]
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert diagnosis.causes == []
    assert wording.message(note).lower() in wording.sentence(diagnosis).lower()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "columns", "unit"),
    [
        ({"drive_sign": 1e3}, "drive", "mm/s"),
        ({"shown_sign": 1e-3}, "shown", "km/s"),
        ({"drive_sign": 3.6}, "", ""),  # km/h are 3.6 times, which another motor may do as well
        ({"clock": 1e3}, "time", "ms"),
        ({"clock": 1.0 / 60.0}, "time", "min"),
    ],
)
def test_another_unit_is_told_where_it_brings_parameters_to_reason(how, columns, unit):
    diagnosis = diagnose(Motor, wired(**how), [FRICTION])
    told = [note for note in diagnosis.notes if note.code in MIXED_UP]
    if not columns:
        assert told == []
        return
    (note,) = told
    assert note.code is NoteCode.OTHER_UNIT
    # the gain alone tells of a factor, be it of the drive or of what is shown
    told = {f"{note.facts['columns']} in {note.facts['unit']}", *note.facts["others"]}
    assert f"{columns} in {unit}" in told
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert diagnosis.causes == []
    assert wording.message(note).lower() in wording.sentence(diagnosis).lower()


@pytest.mark.parametrize(
    ("code", "instead", "is_named"),
    [
        (NoteCode.OTHER_UNIT, 0.2, True),
        (NoteCode.EXCHANGED, 0.2, True),
        (NoteCode.EXCHANGED, 0.001, False),
    ],
)
def test_a_cause_that_comes_nearer_than_another_reading_is_named(
    monkeypatch, code, instead, is_named
):
    """A record may look misread because of what the model lacks, here dry friction."""
    facts = {"columns": "drive", "unit": "mm/s", "others": (), "share": 0.4, "instead": instead}
    reading = Note(code, "", facts)
    monkeypatch.setattr(whole_diagnosis, "mixed_up_columns", lambda search, base: [reading])
    diagnosis = diagnose(Motor, with_dry_friction(0.5), [FRICTION])
    assert (reading in diagnosis.notes) is not is_named
    assert bool(diagnosis.causes) is is_named
    assert (diagnosis.verdict is Verdict.UNEXPLAINED) is not is_named


@pytest.mark.slow
def test_a_gain_of_a_sensor_does_not_stand_for_a_sign(monkeypatch):
    """However near it comes: with the sign changed, parameters are a specimen's, too."""
    facts = {"columns": "shown", "others": (), "share": 0.9, "instead": 0.2}
    sign = Note(NoteCode.OTHER_SIGN, "", facts)
    monkeypatch.setattr(whole_diagnosis, "mixed_up_columns", lambda search, base: [sign])
    gain = next(one for one in measurement_effects(Motor) if one.id == "sensor_gain")
    diagnosis = diagnose(Motor, wired(shown_sign=-1.0), [gain])
    assert sign in diagnosis.notes
    assert diagnosis.causes == []


@pytest.mark.parametrize("noise", [0.02, 0.6])
def test_of_what_is_as_it_should_be_nothing_is_said(noise):
    diagnosis = diagnose(Motor, wired(noise=noise), [FRICTION])
    assert not [note for note in diagnosis.notes if note.code in MIXED_UP]
    assert diagnosis.verdict in (Verdict.CONSISTENT, Verdict.RECALIBRATE)


def test_a_reading_that_explains_nothing_is_not_told():
    """What is measured has to do with nothing, and is as large as nothing that the model does."""
    data = wired()
    noise = 100.0 * np.random.default_rng(4).standard_normal(len(data.time))
    diagnosis = diagnose(Motor, replace(data, measured={"shown": 1e4 + noise}), [])
    assert [note for note in diagnosis.notes if note.code in MIXED_UP] == []


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda y: np.diff(y, prepend=y[0]) / STEP, NoteCode.DIFFERENTIATED),
        (lambda y: STEP * np.cumsum(y), NoteCode.INTEGRATED),
    ],
)
def test_outputs_that_were_differentiated_or_integrated_are_told(change, code):
    """Of a static gain, which neither its rate nor its integral can be."""
    rng = np.random.default_rng(5)
    u = np.convolve(rng.standard_normal(1540), np.hanning(41) / 20.0, "valid")
    y = 2.0 * u + 0.002 * rng.standard_normal(1500)
    data = Dataset(STEP * np.arange(1500), {"u": u}, {"y": change(y)}, ["u"])
    diagnosis = diagnose(Gain, data, [])
    (note,) = [note for note in diagnosis.notes if note.code in MIXED_UP]
    assert (note.code, note.facts["columns"]) == (code, "y")
    assert diagnosis.verdict is Verdict.UNEXPLAINED


@pytest.mark.slow
@pytest.mark.parametrize("level", [0.0, 4.0])
def test_outputs_that_lost_their_sign_are_told(level):
    """Where a level was left on them, they never came near to zero, and lost nothing."""
    data = wired()
    shown = np.abs(level + data.measured["shown"])
    diagnosis = diagnose(Motor, replace(data, measured={"shown": shown}), [FRICTION])
    codes = {note.code for note in diagnosis.notes if note.code in MIXED_UP}
    assert (NoteCode.UNSIGNED in codes) == (level == 0.0)


def test_a_copied_column_is_told_and_nothing_is_named():
    data = wired()
    columns = {"shown": data.measured["shown"], "second": data.inputs["drive"]}
    diagnosis = diagnose(TwiceShown, replace(data, measured=columns), [])
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert diagnosis.causes == []
    assert "a column was copied" in wording.sentence(diagnosis)
