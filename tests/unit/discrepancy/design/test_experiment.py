"""Claims: a designed experiment keeps to the limits, runs, tells alternatives apart, and its evidence is as expected.

The oracle is the emulated rig, which shares no code with the models: it makes the designed experiment with the one or
the other variation hidden, and both models are fitted to what it measures.
"""

from __future__ import annotations

import tomllib
from functools import cache, partial

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit.errors import UserError
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.candidates.candidate import Candidate, own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import HELD_OUT
from orchestration.discrepancy.design.expected_evidence import (
    _covariance,
    at_rest,
    expected_delta_bic_linear,
    respond,
)
from orchestration.discrepancy.design.experiment import ENOUGH, design
from orchestration.discrepancy.design.stimuli import Stimulus, limits_of_inputs
from orchestration.discrepancy.diagnosis import diagnose, searched
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.selection.ranking import ALTERNATIVE
from orchestration.discrepancy.selection.stepwise import Selection, Step
from orchestration.experiment.reading import read
from orchestration.experiment.run import run
from orchestration.experiment.waveforms import steps
from orchestration.identify.noise.autoregression import yule_walker
from orchestration.identify.noise.model import Noise
from orchestration.identify.prediction_error import fit
from orchestration.identify.problem import Problem
from orchestration.rig.emulator.bench import NOISE
from orchestration.rig.emulator.emulator import EmulatedRig, RigParameters
from orchestration.rig.emulator.variations import CATALOGUE
from tests.support.pace import slow_but

TIME = 0.2 * np.arange(1501)
RIG = RigParameters(R1=0.40, R2=2.5, C=2.6, alpha=7.2e-5, k1=6000.0, b1=1.8e6, k2=1.05e4, b2=1.9e6)
LIMITS = {"current": (-1.3, 1.3), "force": (0.0, 3.0)}
HIGHEST = 30.0
HIDDEN = {
    "double_layer": {"transfer_resistance": 0.1, "layer_time": 0.4},
    "diffusion": {"diffusing_share": 0.15},
}
DULL = {
    "current": steps(TIME, [20.0, 70.0, 150.0, 200.0, 260.0], [0.3, -0.2, 0.4, 0.0, 0.3]),
    "force": 0.5 + 0.0 * TIME,
}


def measured(hidden, time, inputs, seed=1):
    """A record of the rig."""
    physics = partial(CATALOGUE[hidden].physics, **HIDDEN[hidden])
    rig = EmulatedRig(RIG, seed, NOISE["voltage"], NOISE["displacement"], hidden=physics)
    return Dataset(time, inputs, rig.run(time, inputs["current"], inputs["force"]))


def fitted(data, effect=None):
    """A model fitted to what a diagnosis fits to, from either side of the effect's neutral value."""
    part = data.part(0, round(len(data.time) * (1.0 - HELD_OUT)))
    candidate = (
        Candidate((), PpyActuator)
        if effect is None
        else Candidate((), PpyActuator).with_effect(EFFECTS[effect])
    )
    physical = searched(PpyActuator)
    problem = Problem(
        candidate.cls, part.time, part.inputs, part.measured, [*physical, *candidate.parameters], {}
    )
    believed = np.array([n in physical and not problem.declared[n].starts for n in problem.names])
    begin = {own_parameters(EFFECTS[effect])[0]: 0.1} if effect else {}
    return FittedCandidate(
        candidate, problem, fit(problem, problem.position(problem.start | begin), None, believed)
    )


@cache
def ambiguous(hidden):
    """The dull record, and an ambiguous verdict on it."""
    data = measured(hidden, TIME, DULL)
    true_model, candidate = (
        fitted(data, name) for name in sorted(HIDDEN, key=lambda name: name != hidden)
    )
    return data, Selection(fitted(data), [Step(true_model, 0.0, 0.0, 0.0, [candidate], [])])


@cache
def designed(hidden):
    data, selection = ambiguous(hidden)
    return design(selection, data, LIMITS, HIGHEST)


def figure(experiment, true_model):
    return next(e.bic for e in experiment.expected if e.true_model == true_model)


@pytest.mark.parametrize("hidden", slow_but(HIDDEN, "double_layer"))
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
    model = experiment.model
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
    experiment = design(selection, data, {"current": (0.0, 0.0)}, HIGHEST)
    assert experiment.least < ENOUGH
    assert not experiment.is_worthwhile
    assert wording.experiment(experiment).startswith(
        "No experiment within these limits that was looked at tells"
    )
    assert (
        tomllib.loads(experiment.toml("ppy_actuator", "what for"))["inputs"]["current"]["value"]
        == "0.0 A"
    )


def test_without_rivals_every_input_is_moved():
    data, selection = ambiguous("double_layer")
    experiment = design(Selection(selection.base), data, LIMITS, HIGHEST)
    assert experiment.expected == []
    assert {s.kind for s in experiment.stimuli.values()} == {"multilevel"}
    assert tomllib.loads(experiment.toml("ppy_actuator", "what for"))["component"] == "ppy_actuator"


def test_limits_that_nobody_gave_are_what_the_record_shows():
    data, selection = ambiguous("double_layer")
    assert limits_of_inputs(selection.base, data, {"force": (0.0, 3.0)}) == {
        "current": (-0.2, 0.4),
        "force": (0.0, 3.0),
    }
    with pytest.raises(
        UserError, match="limits of voltage: there is no such input; there are current, force"
    ):
        design(selection, data, {"voltage": (0.0, 1.0)})
    with pytest.raises(UserError, match="limits of force: 3 to 0 N leaves nothing"):
        design(selection, data, {"force": (3.0, 0.0)})


def test_a_model_expects_nothing_against_itself():
    _, selection = ambiguous("double_layer")
    model = selection.steps[0].chosen
    shown = respond(model, TIME, DULL, at_rest(model))
    assert expected_delta_bic_linear(model, model, shown, shown) == pytest.approx(0.0, abs=1.0)


def test_the_covariance_of_noise_is_that_of_its_samples():
    """Closed form of AR(1); of a sum with a sine, what Yule and Walker make of many samples."""
    noise = Noise(np.array([0.9]), 2.0)
    assert _covariance(noise) == pytest.approx(4.0 / (1.0 - 0.81) * 0.9 ** np.arange(5))
    assert yule_walker(_covariance(noise), 10_000)[0] == pytest.approx([0.9])
    samples = lfilter([2.0], [1.0, -0.9], np.random.default_rng(1).standard_normal(400_000))
    lagged = np.array([samples[: samples.size - k] @ samples[k:] for k in range(5)]) / samples.size
    assert _covariance(noise) == pytest.approx(lagged, rel=0.03)


def test_a_stimulus_says_what_it_is():
    ramp = Stimulus("ramps", {"times": [0.0, 1.0], "levels": [0.0, 2.0]})
    assert ramp.values(np.array([0.0, 0.25, 3.0])) == pytest.approx([0.0, 0.5, 2.0])
