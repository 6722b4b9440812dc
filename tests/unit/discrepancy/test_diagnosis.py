"""From a record to a verdict, on records of the emulated rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit import Component, Output, Parameter
from fmus.kit.errors import UserError
from fmus.kit.sensors import sensor_gain
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.conclude import conclude
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import (
    diagnose,
    fit,
    judge,
    screen,
    searched_parameters,
    select,
)
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.selection import Search, scoring
from tests.support.diagnosis import FEW, coloured, short_record
from tests.support.several import Cell, measured


def test_physical_parameters_and_continuous_starts_are_searched():
    starts = ["charge_start", "kelvin_elongation_start", "maxwell_elongation_start"]
    assert searched_parameters(PpyActuator) == [
        "R1",
        "R2",
        "C",
        "alpha",
        "k1",
        "b1",
        "k2",
        "b2",
        *starts,
    ]


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


def test_the_five_steps_are_the_diagnosis():
    data = measured(3, 4.0)
    record = screen(Cell, data, None, {}, ())
    search = Search(record.parts.estimation, Cell, searched_parameters(Cell))
    selected = select(fit(search, record), [])
    concluded = conclude(selected.search, judge(selected), selected.data)
    whole = diagnose(Cell, data, [])
    assert concluded.verdict is whole.verdict
    assert concluded.notes == whole.notes
    assert concluded.estimates == whole.estimates
    assert concluded.judged_errors == whole.judged_errors


def test_without_excitation_the_model_is_fitted_and_nothing_selected():
    data = measured(3, 4.0)
    still = replace(data, inputs={"current": np.zeros(data.time.size)})
    record = screen(Cell, still, None, {}, ())
    search = Search(record.parts.estimation, Cell, searched_parameters(Cell))
    fitted = fit(search, record)
    assert not fitted.informative
    selected = select(fitted, [sensor_gain(Cell, "voltage")])
    assert selected.selection.steps == []
    assert not selected.data.informative
    assert NoteCode.UNKNOWN_START in {note.code for note in selected.data.notes}
