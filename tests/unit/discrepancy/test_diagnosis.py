"""From a record to a verdict, on records of the emulated rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Component, Output, Parameter
from fmus.kit.errors import UserError
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Verdict, diagnose, searched
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.selection import scoring
from tests.support.diagnosis import FEW, coloured, short_record


def test_what_is_searched():
    starts = ["charge_start", "kelvin_elongation_start", "maxwell_elongation_start"]
    assert searched(PpyActuator) == ["R1", "R2", "C", "alpha", "k1", "b1", "k2", "b2", *starts]


def test_a_hidden_saturation_is_named_and_its_gain_holds():
    diagnosis = diagnose(PpyActuator, short_record("strain_saturation"), FEW)
    assert diagnosis.causes[:1] == ["strain_saturation"]
    assert diagnosis.after["displacement"] < 0.7 * diagnosis.before["displacement"]
    assert diagnosis.selection.steps[0].gain > 50.0


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_a_clean_record_has_no_cause(colour):
    diagnosis = diagnose(PpyActuator, short_record(noise_colour=colour), FEW)
    assert diagnosis.causes == []
    assert diagnosis.verdict == "recalibrate"  # the rig is off nominal by up to 15 %


@pytest.mark.parametrize(("name", "nominal"), [("R1", 0.43), ("alpha", 6.8e-5)])
def test_a_changed_parameter_is_recalibrated(name, nominal):
    """Also one that may be negative, whose size is far from one."""
    diagnosis = diagnose(PpyActuator, short_record(changed={name: 1.4}, spread=0.0), FEW)
    assert diagnosis.verdict == "recalibrate"
    assert diagnosis.changed[0] == name
    low, high = diagnosis.estimates[name].interval
    assert low < 1.4 * nominal < high


def test_a_hum_is_not_explained():
    assert diagnose(PpyActuator, short_record("hum"), FEW[:1]).verdict == "unexplained"


def test_an_effect_that_cannot_be_simulated_is_told(monkeypatch):
    def fails(problem, effect):
        raise UserError("no derivative there")

    monkeypatch.setattr(scoring, "score_directions", fails)
    diagnosis = diagnose(PpyActuator, short_record(), FEW[:1])
    assert diagnosis.notes == [
        Note(NoteCode.NOT_SIMULATED, "strain_saturation", {"reason": "no derivative there"})
    ]
    assert (
        wording.message(diagnosis.notes[0])
        == "strain_saturation was not judged: no derivative there"
    )


def test_a_model_without_states_or_inputs_can_be_diagnosed():
    class Gauge(Component):
        """A line over time that is wrongly scaled."""

        name = "gauge"
        slope = Parameter(2.0, "V/s", min=0, doc="slope")

        @Output("V", doc="what is shown")
        def shown(self):
            return self.slope * self.time

    time = 0.1 * np.arange(600)
    data = Dataset(time, {}, {"shown": 2.5 * time + 1e-3 * coloured(0.0, 1, 600)})
    for holdout in (None, data):
        diagnosis = diagnose(Gauge, data, [], holdout=holdout)
        assert diagnosis.estimates["slope"].value == pytest.approx(2.5, rel=1e-3)
        assert diagnosis.causes == []


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
        "Beside that, something is left that nothing in the catalogue accounts for: voltage wanders slowly"
        in said
    )
