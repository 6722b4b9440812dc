"""Claims: what is written of a diagnosis, its verdicts and its options are documented, and is what
it says it is.
"""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.sensors import transport_delay
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.diagnosis import Verdict
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.pipeline import DiagnosisOptions, diagnose
from orchestration.discrepancy.report.summary import diagnosis_summary
from orchestration.discrepancy.report.tables import RunError
from orchestration.discrepancy.report.wording import sentence
from orchestration.discrepancy.residuals.excess_variance import ExcessVariance
from orchestration.discrepancy.residuals.lines import SpectralLine
from orchestration.discrepancy.residuals.outliers import LevelShift
from orchestration.discrepancy.validation.prediction import predict
from orchestration.experiment.design import DiscriminatingExperiment, ExpectedEvidence, Rehearsal
from orchestration.experiment.design.menu import Stimulus
from orchestration.fmu.model import find_model
from orchestration.identify.changes import Change
from tests.support.command import works
from tests.support.diagnosis import rig_record
from tests.support.reference import DOCS, documented, documented_codes, fields


@pytest.fixture(scope="module")
def result():
    """A lag of the voltage's sensor, with something else that nobody looked for."""
    effects, record = (
        ["sensor_lag(voltage)", "quadratic_strain"],
        rig_record("sensor_lag.voltage", duration=200.0),
    )
    result = diagnose(record, find_model("ppy_actuator"), options=DiagnosisOptions(effects=effects))
    assert result.diagnosis.causes[:1] == ["sensor_lag(voltage)"]
    return result


def written_down(result):
    """The figures, as others read them."""
    return json.loads(json.dumps(diagnosis_summary(result), allow_nan=False))


@pytest.fixture(scope="module")
def written(result):
    """A diagnosis in which every field has something."""
    diagnosis = result.diagnosis
    (step, *_), base, voltage = (
        diagnosis.selection.steps,
        diagnosis.selection.base,
        diagnosis.residuals["voltage"],
    )
    alternative = replace(base, candidate=base.candidate.with_effect(EFFECTS["double_layer"]))
    residual = replace(
        voltage,
        lines=[SpectralLine(0.8, 1e-3, 0.0)],
        level_shifts=[LevelShift(3.0, 1e-3, 0.0)],
        tests=[ExcessVariance(9.0, 0.0)],
    )
    late = step.chosen.candidate.with_effect(transport_delay(PpyActuator, "voltage"))
    correction = replace(step, chosen=replace(step.chosen, candidate=late))
    gains = step.gains | {"double_layer": 12.5}
    named = replace(step, alternatives=[alternative], gains=gains)
    full = replace(
        diagnosis,
        verdict=Verdict.AMBIGUOUS,
        selection=replace(diagnosis.selection, steps=[named, correction]),
        residuals={"voltage": residual},
    )
    experiment = DiscriminatingExperiment(
        {"current": Stimulus("constant", {})},
        60.0,
        0.1,
        [ExpectedEvidence("a", "b", 20.0)],
        Rehearsal({"current": "A"}, ["voltage"]),
    )
    notes = [Note(NoteCode.NOT_SIMULATED, "slack", {"reason": "too stiff"})]
    figures = written_down(replace(result, diagnosis=full, experiment=experiment, notes=notes))
    change = Change(
        "R1",
        0.5,
        1.0,
        (0.4, 0.6),
        (0.9, 1.1),
        True,
        False,
        0.9,
        full.final.problem.declared["R1"],
        "an_effect",
    )
    return figures | {
        "runs": [RunError("a", True, 300, {"voltage": 0.1}).to_dict()],
        "comparison": json.loads(json.dumps([change.to_dict()])),
        "later": "as this one",
    }


@pytest.mark.slow
def test_the_fields_documented_are_those_written(written):
    assert {path for path, _ in fields(written)} == set(documented())


@pytest.mark.slow
def test_what_corrects_the_shape_of_a_cause_is_told_with_it(written):
    (cause,) = written["causes"]
    assert cause["effect"] == "sensor_lag"
    assert cause["shape_corrections"] == ["transport_delay(voltage)"]
    shape = (
        "The shape of a lag of the voltage sensor is not quite the catalogue's: a delay of the"
        " measured voltage corrects it."
    )
    assert written["headline"].startswith("Either a lag of the voltage sensor, a time constant of ")
    assert "), or a double layer, a second RC pair: this record" in written["headline"]
    assert shape in written["headline"]
    (size,) = cause["sizes"]
    (lag,) = cause["parameters"].values()
    assert size["phrase"] == "a time constant of {}"
    assert (size["value"], size["ci95"], size["unit"]) == (lag["value"], lag["ci95"], "s")


@pytest.mark.slow
def test_units_are_told_of_numbers_and_of_nothing_else(written):
    """A number without a unit beside it is one, ``1`` included; words and truths have none."""
    shown = documented()
    for path, value in fields(written):
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        assert bool(shown[path][0]) == number, path


@pytest.mark.slow
def test_percent_and_shares_are_what_is_said(result):
    """Held against NumPy: 100 (1 - |y - yhat| / |y - mean(y)|), and the share that is taken off."""
    diagnosis, figures = result.diagnosis, diagnosis_summary(replace(result, gain=None))
    validation, part = diagnosis.validation, slice(diagnosis.validation.first, None)
    for output, y in validation.data.measured.items():
        for model, when, errors in (
            (diagnosis.selection.base, "before", diagnosis.before),
            (diagnosis.selection.best, "after", diagnosis.after),
        ):
            residual = y[part] - predict(validation, model).simulated[output][part]
            share = np.linalg.norm(residual) / np.linalg.norm(y[part] - y[part].mean())
            assert errors[output] == pytest.approx(share)
            assert figures["gain"][f"holdout_nrmse_{when}"][output] == pytest.approx(share)
        fit = figures["baseline"]["holdout_fit_percent"][output]
        assert fit == pytest.approx(100.0 * (1.0 - diagnosis.before[output]))


@pytest.mark.slow
def test_the_gain_is_that_of_the_fmus_where_they_were_run(result):
    gain = replace(result.gain, before={"voltage": 0.5}, after={"voltage": np.nan})
    figures = diagnosis_summary(replace(result, gain=gain))["gain"]
    assert figures["holdout_nrmse_before"] == {"voltage": 0.5}
    assert figures["holdout_nrmse_after"] == {"voltage": None}


@pytest.mark.slow
def test_delta_bic_of_an_alternative_is_the_evidence_for_it(written, result):
    """As it was when it was held against what was named, whatever was fitted since."""
    step = result.diagnosis.selection.steps[0]
    (alternative,) = written["alternatives"]
    assert (alternative["effect"], alternative["instead_of"]) == (
        "double_layer",
        result.diagnosis.causes[0],
    )
    assert alternative["delta_bic"] == 12.5
    assert step.gains[step.chosen.effect_name] == step.gain
    assert {
        candidate.effect_name: gain for candidate, gain in step.rejected
    }.items() <= step.gains.items()


@pytest.mark.slow
def test_a_note_is_written_as_code_subject_and_sentence(written):
    assert written["notes"] == [
        {"code": "not_simulated", "subject": "slack", "message": "slack was not judged: too stiff"}
    ]


@pytest.mark.slow
def test_what_is_not_known_is_null():
    """A record of the voltage says nothing about springs: only what is believed of them, nothing
    where they start.
    """
    record = rig_record("double_layer", "current", "force", "voltage", outputs=("voltage",))
    written = written_down(
        diagnose(
            record, find_model("ppy_actuator"), options=DiagnosisOptions(effects=["double_layer"])
        )
    )
    (cause,) = written["causes"]
    assert cause["effect"] == "double_layer"
    known = written["parameters"]
    low, high = known["k1"]["ci95"]
    assert 5.0 * low < known["k1"]["nominal"] < 0.2 * high
    assert known["maxwell_elongation_start"]["ci95"] == [None, None]


@pytest.mark.slow
@pytest.mark.parametrize("verdict", Verdict)
def test_every_verdict_is_documented(result, verdict):
    assert sentence(replace(result.diagnosis, verdict=verdict))
    assert f"| `{verdict}` |" in (DOCS / "how-to" / "diagnose.md").read_text(encoding="utf-8")
    assert f"`{verdict}`" in documented()["verdict"][1]


def test_every_code_of_a_note_is_documented():
    assert documented_codes() == set(NoteCode)


def test_every_option_is_documented(tmp_path):
    options = set(re.findall(r"(?<!\S)--[a-z]+", works("diagnose", "--help", cwd=tmp_path))) - {
        "--help"
    }
    text = (DOCS / "how-to" / "diagnose.md").read_text(encoding="utf-8")
    assert len(options) >= 10
    assert [name for name in options if name not in text] == []
