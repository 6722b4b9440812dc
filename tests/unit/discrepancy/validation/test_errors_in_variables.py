"""Claims: bias by noise on a measured input is estimated, intervals bear it, and it is no cause.

The records are SciPy's; the noise on the inputs is not seen by the actuator that is simulated.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.errors import UserError
from fmus.kit.sensors import sensor_drift, sensor_lag
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.selection.input_noise import input_noise_std
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import Selection, Step, select
from orchestration.discrepancy.validation.errors_in_variables import (
    drop_indefensible,
    estimate_input_noise,
)
from tests.support.diagnosis import short_record
from tests.support.gain import Gain
from tests.support.intersample_records import TRUE, record, stimulus
from tests.support.pace import slow_but

AT_REST = tuple(PpyActuator.layout.start_parameters)
SENSORS = [sensor_lag(PpyActuator, "voltage"), sensor_drift(PpyActuator, "voltage")]


def test_the_bias_is_that_of_attenuation():
    """Least squares on a noisy regressor is short by the share of noise in its power (Fuller 1987,
    section 1.1).
    """
    time = 0.1 * np.arange(20000)
    u, noise = stimulus("triangle", time, 1, 10.0), 0.05
    random = np.random.default_rng(5)
    measured = {"y": 2.0 * u + 0.02 * random.standard_normal(len(u))}
    data = Dataset(time, {"u": u + noise * random.standard_normal(len(u))}, measured, frozenset())
    search = Search(data, Gain, ["factor"])
    base = search.nominal()
    found = estimate_input_noise(search, base)
    attenuation = noise**2 / (np.mean(u**2) + noise**2)
    assert base.fit.values["factor"] / 2.0 - 1.0 == pytest.approx(-attenuation, rel=0.3)
    assert found.deviation["u"] == pytest.approx(noise, rel=0.05)
    assert float(found.bias[0]) == pytest.approx(
        -attenuation, rel=0.3
    )  # of a coordinate that is a logarithm


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_the_input_that_is_most_of_what_is_left_is_held_against_a_claim_in_full(seed):
    """A lag takes off noise that the plant never saw, and gains little where there is other noise
    beside it.
    """
    time, random = 0.1 * np.arange(4000), np.random.default_rng(seed)
    u = stimulus("triangle", time, 1, 10.0)
    measured = {"y": 2.0 * u + 0.02 * random.standard_normal(len(u))}
    data = Dataset(time, {"u": u + 0.02 * random.standard_normal(len(u))}, measured, frozenset())
    search = Search(data, Gain, ["factor"])
    base = search.nominal()
    lagging = base.candidate.with_effect(sensor_lag(Gain, "y"))
    chosen = search.fit_from(lagging, base, base.fit.values | {"y_lag_time": 0.005})
    gain = chosen.delta_bic(base, 1)
    assert gain > 100.0  # of which a search may be more suspicious by itself
    claimed = Selection(base, [Step(chosen, gain, gain, 0.0, [], [])], tried=1)
    kept, notes = drop_indefensible(claimed, search, estimate_input_noise(search, base))
    assert kept.steps == []
    assert [note.code for note in notes] == [NoteCode.INPUT_NOISE_DOES_THE_SAME]
    assert 0.5 < notes[0].facts["gain"] / claimed.steps[0].gain < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", slow_but(["triangle", "square", "multilevel"], "square"))
def test_noise_on_an_input_is_told_and_no_cause(kind):
    """A lag keeps noise of the current from the voltage, and a drift follows its integral: neither
    is there.
    """
    for seed in range(3):
        data = record(kind, kind != "triangle", seed, force="multilevel", input_noise=0.005)
        diagnosis = diagnose(PpyActuator, data, SENSORS, held=AT_REST)
        assert diagnosis.causes == []
        assert diagnosis.verdict == "recalibrate"
        noted = {
            note.subject: note.facts["share"]
            for note in diagnosis.notes
            if note.code is NoteCode.INPUT_NOISE
        }
        assert noted == pytest.approx({"current": 0.005, "force": 0.005}, rel=0.25)
        assert diagnosis.intersample["current"].linear is (kind == "triangle")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["triangle", "square"])
def test_intervals_bear_noise_on_an_input(kind):
    """Without it they would be half as wide as the errors are."""
    deviations = []
    for seed in range(20, 28):
        data = record(kind, kind != "triangle", seed, input_noise=0.005)
        diagnosis = diagnose(PpyActuator, data, [], held=AT_REST)
        for name in ("R1", "R2", "C", "alpha"):
            low, high = diagnosis.estimates[name].interval
            deviations.append(
                (diagnosis.estimates[name].value - TRUE[name]) / ((high - low) / 3.92)
            )
    assert np.mean(np.abs(deviations) < 1.96) >= 0.88
    assert np.std(deviations) < 1.3


def test_noise_that_the_outputs_follow_is_an_input():
    data = record("square", True, 1, restless=0.005)
    assert input_noise_std(data.inputs["current"]) > 0.0
    diagnosis = diagnose(PpyActuator, data, [], held=AT_REST)
    assert NoteCode.INPUT_NOISE not in {note.code for note in diagnosis.notes}


@pytest.mark.slow
def test_what_is_there_is_named_through_noise_on_the_inputs():
    data = short_record("strain_saturation")
    random = np.random.default_rng(1)
    noisy = {
        n: u + 0.005 * np.ptp(u) * random.standard_normal(len(u)) for n, u in data.inputs.items()
    }
    diagnosis = diagnose(
        PpyActuator, replace(data, inputs=noisy), [EFFECTS["strain_saturation"], *SENSORS]
    )
    assert diagnosis.causes[:1] == ["strain_saturation"]


@pytest.fixture(scope="module")
def saturating():
    """A search in a record with noise on its inputs, what it named, and that noise."""
    data = short_record("strain_saturation")
    random = np.random.default_rng(1)
    noisy = {
        n: u + 0.005 * np.ptp(u) * random.standard_normal(len(u)) for n, u in data.inputs.items()
    }
    search = Search(replace(data, inputs=noisy), PpyActuator, ["R1", "R2", "C", "alpha"])
    selection = select(search, [EFFECTS["strain_saturation"]])
    return search, selection, estimate_input_noise(search, selection.base)


@pytest.mark.slow
def test_what_could_not_be_held_against_noise_is_not_claimed(saturating, monkeypatch):
    search, selection, noise = saturating
    assert [
        step.chosen.effect_name for step in drop_indefensible(selection, search, noise)[0].steps
    ] == ["strain_saturation"]

    def fails(self, fitted):
        raise UserError("too stiff")

    monkeypatch.setattr(Search, "refit", fails)
    kept, notes = drop_indefensible(selection, search, noise)
    assert kept.steps == []
    assert [(note.code, note.subject) for note in notes] == [
        (NoteCode.NOT_SIMULATED, "strain_saturation")
    ]


@pytest.mark.slow
def test_what_was_named_is_held_against_noise_though_the_time_is_spent(saturating, monkeypatch):
    search, selection, noise = saturating
    monkeypatch.setattr(search, "budget", Budget(0.0))
    assert drop_indefensible(selection, search, noise)[0].steps == selection.steps
