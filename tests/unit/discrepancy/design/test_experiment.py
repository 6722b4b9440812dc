"""Claims: a designed experiment keeps to the limits, runs, tells alternatives apart, and its
evidence is as expected.

The oracle is the emulated rig, which shares no code with the models: it makes the designed
experiment with the one or the other variation hidden, and both models are fitted to what it
measures.
"""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np
import pytest

from fmus.kit.errors import UserError
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.design.expected_evidence import at_rest, respond
from orchestration.discrepancy.design.experiment import design_experiment
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.selection.ranking import ALTERNATIVE
from orchestration.discrepancy.selection.stepwise import Selection
from orchestration.experiment.design import ENOUGH
from orchestration.experiment.execution import run
from orchestration.experiment.reading import read
from tests.support.ambiguous import HIDDEN, TIME, ambiguous, fitted, measured
from tests.support.pace import slow_but

LIMITS = {"current": (-1.3, 1.3), "force": (0.0, 3.0)}
HIGHEST = 30.0


@cache
def designed(hidden):
    data, selection = ambiguous(hidden)
    return design_experiment(selection, data, LIMITS, HIGHEST)


def figure(experiment, true_model):
    return next(e.bic for e in experiment.expected if e.true_model == true_model)


@pytest.mark.slow
@pytest.mark.parametrize("hidden", HIDDEN)
def test_what_a_dull_record_cannot_tell_apart_the_designed_experiment_does(hidden):
    _, selection = ambiguous(hidden)
    (step,) = selection.steps
    assert abs(step.alternatives[0].fit.bic - step.chosen.fit.bic) < ALTERNATIVE
    experiment = designed(hidden)
    assert experiment.is_worthwhile
    time = experiment.step * np.arange(round(experiment.duration / experiment.step) + 1)
    inputs = {name: stimulus.values(time) for name, stimulus in experiment.stimuli.items()}
    record = measured(hidden, time, inputs, seed=2)
    (other,) = set(HIDDEN) - {hidden}
    seen = fitted(record, other).fit.bic - fitted(record, hidden).fit.bic
    assert 0.5 < seen / figure(experiment, hidden) < 2.0
    named = diagnose(PpyActuator, record, [EFFECTS[name] for name in HIDDEN])
    assert named.causes[:1] == [hidden]
    assert named.selection.steps[0].alternatives == []


@pytest.mark.parametrize("hidden", slow_but(HIDDEN, "double_layer"))
def test_the_limits_of_the_rig_are_kept(hidden):
    experiment = designed(hidden)
    assert experiment.duration == pytest.approx(TIME[-1])
    time = np.arange(0.0, experiment.duration, 0.001)
    for name, (low, high) in LIMITS.items():
        values = experiment.stimuli[name].values(time)
        assert low <= values.min()
        assert values.max() <= high
        jumps = time[1:][np.abs(np.diff(values)) > 0.1]
        assert np.diff(jumps).min(initial=1.0) > 0.5 / HIGHEST


def test_the_experiment_runs_as_it_is_written(tmp_path):
    experiment = designed("double_layer")
    path = tmp_path / "separate.toml"
    path.write_text(experiment.toml("ppy_actuator", "what for"), encoding="utf-8")
    result = run(read(str(path)))
    time = result.time.to_numpy()
    assert time[-1] == pytest.approx(TIME[-1])
    for name, stimulus in experiment.stimuli.items():
        assert np.array_equal(result[name].to_numpy(), stimulus.values(time))
    model = ambiguous("double_layer")[1].steps[0].chosen
    inputs = {name: stimulus.values(time) for name, stimulus in experiment.stimuli.items()}
    expected = respond(model, time, inputs, at_rest(model)).signals
    for output, values in expected.items():
        assert np.abs(result[output].to_numpy() - values).max() < 1e-5 * np.ptp(values)
    comments = [
        line for line in path.read_text(encoding="utf-8").splitlines() if line.startswith("#")
    ]
    assert comments[0] == "# what for"
    for e in experiment.expected:
        assert (
            f"#   if {e.true_model} is right, against {e.candidate} refitted: {e.bic:.1f}"
            in comments
        )
    assert "# Limits kept: current -1.3 to 1.3 A; force 0 to 3 N." in comments


def test_what_no_experiment_tells_apart_is_said():
    data, selection = ambiguous("double_layer")
    experiment = design_experiment(selection, data, {"current": (0.0, 0.0)}, HIGHEST)
    assert experiment.least < ENOUGH
    assert not experiment.is_worthwhile
    assert experiment.sentence.startswith(
        "No experiment within these limits that was looked at tells"
    )
    assert (
        tomllib.loads(experiment.toml("ppy_actuator", "what for"))["inputs"]["current"]["value"]
        == "0.0 A"
    )


def test_without_rivals_every_input_is_moved():
    data, selection = ambiguous("double_layer")
    experiment = design_experiment(Selection(selection.base), data, LIMITS, HIGHEST)
    assert experiment.expected == []
    assert {s.kind for s in experiment.stimuli.values()} == {"multilevel"}
    assert tomllib.loads(experiment.toml("ppy_actuator", "what for"))["component"] == "ppy_actuator"


def test_limits_of_no_input_or_that_leave_nothing_are_refused():
    data, selection = ambiguous("double_layer")
    with pytest.raises(
        UserError, match="limits of voltage: there is no such input; there are current, force"
    ):
        design_experiment(selection, data, {"voltage": (0.0, 1.0)})
    with pytest.raises(UserError, match="limits of force: 3 to 0 N leaves nothing"):
        design_experiment(selection, data, {"force": (3.0, 0.0)})
