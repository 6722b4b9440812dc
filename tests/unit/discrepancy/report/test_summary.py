"""Claims: what is written of a diagnosis, its verdicts and its options are documented; figures of the decision hold."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmus.kit.sensors import sensor_drift, sensor_lag
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.cli.diagnose import as_json
from orchestration.discrepancy.candidates.outlook import LinearisedModel
from orchestration.discrepancy.data.holdout import HELD_OUT
from orchestration.discrepancy.design.experiment import DiscriminatingExperiment, ExpectedEvidence
from orchestration.discrepancy.design.stimuli import Stimulus
from orchestration.discrepancy.diagnosis import diagnose, searched
from orchestration.discrepancy.report import system_summary
from orchestration.discrepancy.report.wording import sentence
from orchestration.discrepancy.residuals.lines import LevelShift, SpectralLine
from orchestration.discrepancy.selection.search import Dataset, Search
from orchestration.rig.emulator.records import draw
from tests.support.command import works
from tests.support.system.closed_loop import watched

DOCS = Path(__file__).parents[4] / "docs"
# whose keys are names of the model; every other key is a field
NAMED = {
    "parameters": "PARAMETER", "holdout_fit_percent": "OUTPUT", "holdout_nrmse_before": "OUTPUT",
    "holdout_nrmse_after": "OUTPUT", "left": "OUTPUT", "outputs": "OUTPUT", "inputs": "INPUT", "fed": "INPUT",
}  # fmt: skip
FIELD = re.compile(r"^\| `([^`]+)` \|([^|]*)\| *([^|]*)\|$", re.M)


def fields(value, path=""):
    """Every field that holds a figure or a text with it, names replaced by what they are names of."""
    if isinstance(value, dict):
        within = path.rpartition(".")[2]
        for key, more in value.items():
            yield from fields(more, f"{path}.{NAMED.get(within, key)}".lstrip("."))
    elif isinstance(value, list):
        for more in value:
            yield from fields(more, f"{path}[]")
    else:
        yield path, value


def documented(system):
    page, of_a_system = (DOCS / "reference" / "diagnosis.md").read_text(encoding="utf-8").split("## Of a system")
    return {name: (unit.strip(), what) for name, unit, what in FIELD.findall(of_a_system if system else page)}


@pytest.fixture(scope="module")
def found():
    """A lag of the voltage's sensor, with something else that nobody looked for."""
    drawn = draw("sensor_lag.voltage", 1, duration=300.0, rate=5.0)
    data = Dataset(drawn.time, drawn.inputs, drawn.outputs)
    found = diagnose(PpyActuator, data, [sensor_lag(PpyActuator, "voltage"), EFFECTS["double_layer"]])
    assert found.causes[:1] == ["sensor_lag(voltage)"]
    return found


@pytest.fixture(scope="module")
def written(found):
    """A diagnosis in which every field has something, as others read it."""
    (step, *_), voltage = found.selection.steps, found.left["voltage"]
    rival = replace(found.selection.base, candidate=found.selection.base.candidate.with_effect(EFFECTS["double_layer"]))
    left = replace(
        voltage,
        lines=[SpectralLine(0.8, 1e-3, 0.0)],
        jumps=[LevelShift(3.0, 1e-3, 0.0)],
        excess_variance_at_input_steps=0.0,
    )
    made = replace(
        found,
        verdict="ambiguous",
        selection=replace(found.selection, steps=[replace(step, rivals=[rival])]),
        left={"voltage": left},
        notes=["a note"],
    )
    trial = DiscriminatingExperiment(
        {"current": Stimulus("constant", {})}, 60.0, 0.1, [ExpectedEvidence("a", "b", 20.0)], found.final
    )
    return json.loads(json.dumps(as_json(made, None, trial), allow_nan=False))


def test_the_fields_documented_are_those_written(written):
    assert {path for path, _ in fields(written)} == set(documented(system=False))


def test_the_fields_documented_of_a_system_are_those_written(tmp_path):
    saturation = {"actuator.strain_saturation_coefficient": 0.3}
    found = watched(tmp_path, hidden=EFFECTS["strain_saturation"], values=saturation)
    written = json.loads(json.dumps(system_summary.summary(found), allow_nan=False))
    assert {path for path, _ in fields(written)} == set(documented(system=True))


def test_units_are_told_of_numbers_and_of_nothing_else(written):
    """A number without a unit beside it is one, ``1`` included; words and truths have none."""
    shown = documented(system=False)
    for path, value in fields(written):
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        assert bool(shown[path][0]) == number, path


def test_percent_and_shares_are_what_is_said(found):
    """Held against NumPy: 100 (1 - |y - yhat| / |y - mean(y)|), and the share that is taken off."""
    part = slice(found.validation.first, None)
    for output, y in found.validation.data.measured.items():
        for model, errors in ((found.selection.base, found.before), (found.selection.best, found.after)):
            left = y[part] - found.validation.simulated(model)[output][part]
            share = np.linalg.norm(left) / np.linalg.norm(y[part] - y[part].mean())
            assert errors[output] == pytest.approx(share)
        fit = found.as_json()["baseline"]["holdout_fit_percent"][output]
        assert fit == pytest.approx(100.0 * (1.0 - found.before[output]))


def test_delta_bic_of_an_alternative_is_the_evidence_for_it(written, found):
    """Here the rival is the base model itself, for which there is none but the price of looking."""
    step = found.selection.steps[0]
    (alternative,) = written["alternatives"]
    assert (alternative["effect"], alternative["instead_of"]) == ("double_layer", found.causes[0])
    fall = found.selection.base.fit.bic - step.chosen.fit.bic
    assert alternative["delta_bic"] == pytest.approx(step.gain - fall)


def test_the_colour_of_the_base_swallows_a_drift_as_the_decision_says():
    text = (DOCS / "decisions" / "0012-naming-causes.md").read_text(encoding="utf-8")
    ((scored, outlook),) = re.findall(r"scored ([\d.]+), and ([\d.]+) with", text)
    drawn = draw("sensor_drift", 1)
    first = Dataset(drawn.time, drawn.inputs, drawn.outputs).part(0, round(drawn.time.size * (1.0 - HELD_OUT)))
    search = Search(first, PpyActuator, searched(PpyActuator))
    origin = search.look(search.nominal(), [sensor_drift(PpyActuator, "voltage")])
    model = LinearisedModel(origin.evidence.problem, origin.evidence.fit)
    ((_, (lead,)),) = origin.seen.values()
    change = lead.columns, lead.least, lead.most
    assert [model.falls(*change)[0], model.outlook(*change).fall] == pytest.approx(
        [float(scored), float(outlook)], rel=0.02
    )


@pytest.mark.parametrize("verdict", ["consistent", "recalibrate", "cause", "ambiguous", "unexplained"])
def test_every_verdict_is_documented(found, verdict):
    assert sentence(replace(found, verdict=verdict))
    assert f"| `{verdict}` |" in (DOCS / "how-to" / "diagnose.md").read_text(encoding="utf-8")
    assert f"`{verdict}`" in documented(system=False)["verdict"][1]


def test_every_option_is_documented(tmp_path):
    options = set(re.findall(r"(?<!\S)--[a-z]+", works("diagnose", "--help", cwd=tmp_path))) - {"--help"}
    text = (DOCS / "how-to" / "diagnose.md").read_text(encoding="utf-8")
    assert len(options) >= 10
    assert [name for name in options if name not in text] == []
