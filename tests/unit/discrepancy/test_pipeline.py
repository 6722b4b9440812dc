"""Record and model in; verdict, extended model, gain and next experiment out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.discrepancy import pipeline
from orchestration.discrepancy.candidates.candidate import label
from orchestration.discrepancy.data.dataset import dataset_of
from orchestration.discrepancy.diagnosis import Verdict
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.pipeline import DiagnosisOptions, diagnose
from orchestration.fmu.model import find_model
from tests.support.diagnosis import rig_record


@pytest.fixture(scope="module")
def actuator():
    return find_model("ppy_actuator")


def at_rest(record):
    """Return the same record while no input moves."""
    still = {name: np.full_like(record.time, 0.5) for name in ("current", "force")}
    return replace(record, signals=record.signals | still)


# --- from a record to data
# ------------------------------------------------------------------------------------------


def test_inputs_and_outputs_of_a_record_are_those_of_the_model(actuator):
    record = rig_record()
    data = dataset_of(record, actuator, {})
    assert (set(data.inputs), set(data.measured)) == (
        {"current", "force"},
        {"voltage", "displacement"},
    )
    assert all(data.inputs[n] is record.signals[n] for n in data.inputs)
    assert data.linear is None
    assert dataset_of(record, actuator, {}, interpolate=True).linear is True


def test_an_input_that_is_absent_is_constant(actuator):
    record = rig_record(None, "current", "voltage")
    assert np.array_equal(
        dataset_of(record, actuator, {}).inputs["force"], np.zeros(record.time.size)
    )
    given = dataset_of(record, actuator, {"force": 0.7, "R1": 0.5}).inputs
    assert set(given) == {"current", "force"}
    assert np.array_equal(given["force"], np.full(record.time.size, 0.7))


def test_what_is_given_of_an_input_goes_before_what_was_recorded(actuator):
    assert set(dataset_of(rig_record(), actuator, {"force": 0.7}).inputs["force"]) == {0.7}


def test_an_absent_input_is_noted_unless_it_is_given(actuator):
    record, noted = rig_record(None, "current", "voltage"), []
    for given in ({}, {"force": 0.7}):
        notes = diagnose(record, actuator, options=DiagnosisOptions(given, effects=[])).notes
        noted.append([note for note in notes if note.code is NoteCode.ABSENT_INPUT])
    facts = {"record": "lab record.csv", "value": 0.0, "unit": "N"}
    assert noted == [[Note(NoteCode.ABSENT_INPUT, "force", facts)], []]


# --- what follows from it
# -------------------------------------------------------------------------------------------


def test_a_cause_comes_with_its_model_and_its_gain(actuator):
    result = diagnose(
        rig_record("strain_saturation"),
        actuator,
        options=DiagnosisOptions(effects=["strain_saturation"]),
    )
    assert result.diagnosis.verdict is Verdict.CAUSE
    assert "strain_saturation_coefficient" in {p.name for p in result.component.layout.parameters}
    assert result.gain.before == pytest.approx(result.diagnosis.before, rel=1e-6)
    assert result.gain.after == pytest.approx(result.diagnosis.after, rel=1e-6)
    assert result.experiment is None


def test_where_nothing_moves_there_is_no_model_but_an_experiment(actuator):
    limits = {"current": (-1.0, 1.0), "force": (0.0, 2.0)}
    result = diagnose(
        at_rest(rig_record()), actuator, options=DiagnosisOptions(effects=[], limits=limits)
    )
    assert result.diagnosis.inconclusive
    assert (result.component, result.gain) == (None, None)
    assert result.experiment.limits == limits
    assert result.experiment.expected == []


def test_another_record_is_what_is_judged_by(actuator):
    other = rig_record("strain_saturation", "current", "force", "voltage")
    result = diagnose(rig_record(), actuator, other, DiagnosisOptions(effects=[]))
    assert list(result.gain.after) == ["voltage"]
    assert not result.diagnosis.validation.continued
    assert result.holdout is other


@pytest.mark.parametrize(
    ("wanted", "considered"),
    [
        (["sensor_lag"], ["sensor_lag(voltage)", "sensor_lag(displacement)"]),
        (["sensor_lag(voltage)", "slack"], ["slack", "slack(smooth)", "sensor_lag(voltage)"]),
        pytest.param([], [], marks=pytest.mark.slow),
    ],
)
def test_effects_are_considered_by_id_or_by_output(actuator, wanted, considered):
    result = diagnose(at_rest(rig_record()), actuator, options=DiagnosisOptions(effects=wanted))
    assert [label(effect) for effect in result.effects] == considered


def test_what_fails_afterwards_does_not_take_the_diagnosis_with_it(actuator, monkeypatch):
    def fails(*arguments):
        raise UserError("no compiler")

    monkeypatch.setattr(pipeline, "measure_gain", fails)
    monkeypatch.setattr(pipeline, "design_experiment", fails)
    moving, idle = (
        diagnose(r, actuator, options=DiagnosisOptions(effects=[]))
        for r in (rig_record(), at_rest(rig_record()))
    )
    assert moving.gain is None
    assert Note(NoteCode.FMU_FAILED, "", {"reason": "no compiler"}) in moving.notes
    assert idle.experiment is None
    assert Note(NoteCode.NO_EXPERIMENT, "", {"reason": "no compiler"}) in idle.notes


# --- refusals
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            DiagnosisOptions(effects=["slac"]),
            r"effects: no effect named 'slac' \(did you mean slack\?\)",
        ),
        (
            DiagnosisOptions(effects=["sensor_lag(force)"]),
            r"effects: no effect named 'sensor_lag\(force\)'",
        ),
        (
            DiagnosisOptions(hold=["R3"]),
            r"hold: ppy_actuator has no parameter named 'R3' \(did you mean",
        ),
    ],
)
def test_names_that_are_unknown_are_refused(actuator, options, message):
    with pytest.raises(UserError, match=message):
        diagnose(rig_record(), actuator, options=options)


def test_a_model_without_equations_is_refused(actuator):
    with pytest.raises(
        UserError, match=r"ppy_actuator is an FMU without equations; name a component or file\.py"
    ):
        diagnose(rig_record(), replace(actuator, cls=None))


def test_a_record_to_judge_by_must_have_an_output_of_the_other(actuator):
    other = rig_record(None, "current", "displacement")
    with pytest.raises(
        UserError, match=r"lab record\.csv: it has none of the outputs of the record, voltage"
    ):
        diagnose(
            rig_record(None, "current", "voltage"), actuator, other, DiagnosisOptions(effects=[])
        )


def test_the_same_record_twice_is_refused_however_it_is_written(actuator):
    """On another clock, and rounded: noise is never the same."""
    record, options = rig_record(), DiagnosisOptions(effects=[])
    signals = {n: np.array([float(f"{x:.8g}") for x in v]) for n, v in record.signals.items()}
    same = replace(record, time=record.time + 100.0, signals=signals, source=Path("same.csv"))
    told = r"same\.csv: this is the same record as lab record\.csv"
    with pytest.raises(UserError, match=told):
        diagnose([record, same], actuator, options=options)
    with pytest.raises(UserError, match=told):
        diagnose(record, actuator, same, options)
