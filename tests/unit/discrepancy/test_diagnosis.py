"""From records to a verdict: of the emulated rig, and exact solutions of a cell's equations."""

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
    Verdict,
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
from orchestration.records.runs import base_name
from tests.support.diagnosis import FEW, coloured, short_record
from tests.support.regression_model import GAIN, OFFSET, OTHERS, Amplifier
from tests.support.several import (
    OCVS,
    STARTS,
    TRUE,
    Cell,
    current,
    joined_pieces,
    measured,
    several,
    voltage,
    with_gaps,
)


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


@pytest.mark.slow
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

    def to_be_simulated(model, effects, linear):
        return [(effect, None) for effect in effects]

    monkeypatch.setattr(scoring, "score_directions", to_be_simulated)
    monkeypatch.setattr(scoring, "simulated_directions", fails)
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
    noise = {"voltage": 1e-3 * coloured(0.0, 1, data.time.size)}
    still = replace(data, inputs={"current": np.zeros(data.time.size)}, measured=noise)
    record = screen(Cell, still, None, {}, ())
    search = Search(record.parts.estimation, Cell, searched_parameters(Cell))
    fitted = fit(search, record)
    assert not fitted.informative
    selected = select(fitted, [sensor_gain(Cell, "voltage")])
    assert selected.selection.steps == []
    assert not selected.data.informative
    assert NoteCode.NO_EXCITATION in {note.code for note in selected.data.notes}


def test_what_follows_a_gap_starts_where_it_then_was():
    diagnosis = diagnose(Cell, joined_pieces(with_gaps((300, 450))), [], TRUE, held=["ocv"])
    assert diagnosis.verdict is Verdict.CONSISTENT
    truth = current(3, 900)
    state = (3.3 - TRUE["R0"] * truth - voltage(truth, 4.0, 3.3, **TRUE)) / TRUE["R1"]
    for name, true in {"relaxed_start@1": state[0], "relaxed_start@2": state[450], **TRUE}.items():
        if name == "ocv":
            continue
        e = diagnosis.estimates[name]
        assert e.value == pytest.approx(true, abs=e.interval[1] - e.interval[0]), name
    assert {choice.linear for choice in diagnosis.intersample.values()} == {False}


# --- several records at once, exact solutions of the cell's equations
# -------------------------------------------------------------------------------------------

SHARED = ("R0", "R1", "tau1")
NOISE = 1e-3


@pytest.fixture(scope="module")
def several_records():
    """Diagnose six records with one open circuit voltage, which is known; two are held out."""
    return diagnose(Cell, several(), [], held=["ocv"])


@pytest.fixture(scope="module")
def differing():
    """Diagnose six records of which every one has an open circuit voltage of its own."""
    return diagnose(Cell, several(ocvs=OCVS), [], each=["ocv"])


def test_parameters_are_of_all_records_and_starts_of_each(several_records):
    names = {*SHARED, *(f"relaxed_start@{label}" for label in STARTS)}
    assert set(several_records.estimates) == names, "once the gain is known all records are fitted"
    assert {base_name(n) for n in several_records.selection.best.problem.names} == {
        *SHARED,
        "relaxed_start",
    }


def test_the_truth_of_several_records_is_found(several_records):
    """Every start is another: one for all of them would be off by many times its interval."""
    truth = TRUE | {f"relaxed_start@{label}": start for label, start in STARTS.items()}
    for name, e in several_records.estimates.items():
        half = 0.5 * (e.interval[1] - e.interval[0])
        assert e.value == pytest.approx(truth[name], abs=2.0 * half), name
    assert several_records.verdict is Verdict.RECALIBRATE
    assert set(several_records.changed) == {"R0", "R1", "tau1"}


def test_records_held_out_are_followed_as_closely_as_their_noise_allows(several_records):
    validation = several_records.validation
    assert [run.label for run in validation.data.runs] == ["e", "f"]
    y = validation.data.measured["voltage"][validation.judged]
    assert several_records.before["voltage"] == pytest.approx(NOISE / np.std(y), rel=0.15)


def test_what_differs_from_record_to_record_is_each_its_own_and_no_change(differing):
    for label, ocv in OCVS.items():
        assert differing.estimates[f"ocv@{label}"].value == pytest.approx(ocv, abs=1e-3)
    assert set(differing.changed) <= set(SHARED)
    y = differing.validation.data.measured["voltage"][differing.validation.judged]
    assert differing.before["voltage"] == pytest.approx(NOISE / np.std(y), rel=0.15)


@pytest.mark.slow
def test_what_differs_without_being_said_so_leaves_an_error():
    records = several("abc", ocvs=OCVS)
    shared = diagnose(Cell, records, [])
    y = shared.validation.data.measured["voltage"][shared.validation.judged]
    assert shared.before["voltage"] > 5.0 * NOISE / np.std(y)


def test_more_records_tell_parameters_more_closely():
    one, four = (
        diagnose(Cell, data, [], held=["ocv"])
        for data in (measured(0, STARTS["a"]), several("abcd"))
    )
    for name in SHARED:
        widths = [
            e.interval[1] - e.interval[0] for e in (one.estimates[name], four.estimates[name])
        ]
        assert widths[1] < 0.7 * widths[0]


@pytest.mark.parametrize("gain", [GAIN, 1.5 * GAIN])
def test_a_record_without_noise_is_followed_exactly(gain):
    """No residual has a size that anything could be held against; nothing warns."""
    time = 0.1 * np.arange(400)
    signal = np.sin(time) + 0.3 * np.sin(3.7 * time)
    data = Dataset(time, {"signal": signal}, {"shown": gain * signal})
    diagnosis = diagnose(Amplifier, data, [OFFSET, *OTHERS])
    assert diagnosis.causes == []
    assert diagnosis.estimates["gain"].value == pytest.approx(gain)
    assert diagnosis.changed == ([] if gain == GAIN else ["gain"])
