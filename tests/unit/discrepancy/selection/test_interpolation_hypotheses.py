"""Claims: what inputs do between samples is asked once more with effects, as a hidden lag looks
like half a sample.

The plant is a galvanostat, whose loop is a lag of 0.3 s, and a current clamp that lags by 0.25 s,
both discretised exactly at a fiftieth of the sample period.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import chirp, lfilter, sawtooth

from fmus.kit.generic import asymmetric_friction
from fmus.kit.sensors import sensor_lag, sensor_offset, transport_delay
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.selection import interpolation_hypotheses
from orchestration.discrepancy.selection.interpolation_hypotheses import Hypothesis, by_effects
from orchestration.discrepancy.selection.intersample import InterpolationBasis, Intersample
from orchestration.fmu.model import find_model
from studies.plants.models.cell import Cell
from tests.support.pace import slow_but

STEP, FINE, COUNT = 0.1, 50, 800
TIME = STEP * np.arange(COUNT)
COURSES = {
    "chirp": 0.8 * chirp(TIME, 0.02, 80.0, 0.6, phi=-90.0),
    "triangle": 0.9 * sawtooth(2.0 * np.pi * TIME / 9.0 + 0.4, 0.5),
}
GALVANOSTAT = find_model("galvanostat").cls
EFFECTS = [make(GALVANOSTAT, "current") for make in (sensor_lag, transport_delay, sensor_offset)]


def lagging(values, time):
    decay = np.exp(-STEP / FINE / time)
    return lfilter([0.0, 1.0 - decay], [1.0, -decay], values)


def record(course, held):
    command = COURSES[course]
    fine = np.arange(COUNT * FINE) * STEP / FINE
    fed = np.repeat(command, FINE) if held else np.interp(fine, TIME, command)
    current = lagging(lagging(fed, 0.3), 0.25)[::FINE]
    noisy = current + 0.01 * np.random.default_rng(1).standard_normal(COUNT)
    return Dataset(TIME, {"current_command": command}, {"current": noisy})


def judged(data, effects):
    return diagnose(
        GALVANOSTAT,
        data,
        effects,
        {"response_time": 0.3, "current_limit": 5.0},
        held=["current_limit"],
    )


@pytest.mark.slow
@pytest.mark.parametrize(("course", "held"), [("chirp", True), ("triangle", False)])
def test_a_lag_is_found_where_a_model_without_it_takes_the_input_the_wrong_way(course, held):
    data = record(course, held)
    assert judged(data, []).intersample["current_command"].linear is held
    diagnosis = judged(data, EFFECTS)
    assert diagnosis.intersample["current_command"].linear is not held
    assert diagnosis.causes == ["sensor_lag(current)"]
    total = sum(diagnosis.estimates[n].value for n in ("response_time", "current_lag_time"))
    assert total == pytest.approx(
        0.55, abs=0.01
    )  # which lag is which is not to be told, how late both are is


@pytest.mark.slow
def test_what_is_given_stands():
    data = replace(record("chirp", True), linear=True)
    assert (
        judged(data, EFFECTS[:1]).intersample["current_command"].basis is InterpolationBasis.GIVEN
    )


@pytest.mark.parametrize(
    ("choice", "open"),
    [
        (Intersample(True, InterpolationBasis.COURSE, separation=4.0), True),
        (Intersample(True, InterpolationBasis.COURSE, separation=3.0), False),
        (Intersample(True, InterpolationBasis.GIVEN, separation=40.0), False),
        (Intersample(False, InterpolationBasis.COURSE, separation=40.0), False),
        (Intersample(False, InterpolationBasis.FIT, separation=40.0), True),
        (Intersample(False, InterpolationBasis.DEFAULT, separation=40.0), True),
    ],
)
def test_which_inputs_are_open(choice, open):
    """An input that rests between its own steps is held; ten times minus twice the log-likelihood
    tells.
    """
    assert choice.open is open


def test_nothing_is_looked_at_where_time_is_spent():
    search = SimpleNamespace(budget=SimpleNamespace(spent=lambda: True))
    chosen = {"u": Intersample(True, InterpolationBasis.COURSE, separation=40.0)}
    way = Hypothesis(search, SimpleNamespace(model=None), chosen)
    assert by_effects(way, []) is way


@pytest.mark.parametrize(("named", "taken"), [(["a lag"], "other"), ([], "first")])
def test_the_other_way_is_taken_only_if_it_names_something(monkeypatch, named, taken):
    steps = {"first": [], "other": named}
    monkeypatch.setattr(interpolation_hypotheses, "score", lambda search, base, effects: None)
    monkeypatch.setattr(
        interpolation_hypotheses,
        "by_effects",
        lambda hypothesis, effects: Hypothesis("other", None, {}),
    )
    monkeypatch.setattr(
        interpolation_hypotheses,
        "select",
        lambda search, *rest: SimpleNamespace(steps=steps[search]),
    )
    monkeypatch.setattr(
        interpolation_hypotheses, "revised", lambda search, selection, effects: selection
    )
    monkeypatch.setattr(interpolation_hypotheses, "explaining", lambda search, selection: selection)
    monkeypatch.setattr(interpolation_hypotheses, "_by_extended_model", lambda *judged: judged)
    way, selection = interpolation_hypotheses.selected("first", None, {}, [])
    assert (way.search, selection.steps) == (taken, steps[taken])


@pytest.mark.slow
@pytest.mark.parametrize("held", slow_but([True, False], True))
def test_the_extended_model_decides_how_an_input_goes(held):
    """A cell whose drop is larger in discharge, under a triangle that a generator holds, or not.

    Half a sample moves the resistances by a percent, dozens of their standard errors, and what the
    bend makes is larger than that. The pair is solved exactly at a fiftieth of the sample period.
    """
    step = 0.5
    truth = {"ocv": 3.3, "R0": 0.024, "R1": 0.0215, "tau1": 17.4}
    current = 2.0 * sawtooth(2.0 * np.pi * step * np.arange(1200) / 60.0, 0.5)
    fine = np.arange(1200 * FINE) / FINE
    fed = np.repeat(current, FINE) if held else np.interp(fine, np.arange(1200), current)
    decay = np.exp(-step / FINE / truth["tau1"])
    relaxed = lfilter([0.0, 1.0 - decay], [1.0, -decay], fed)[::FINE]
    bend = 0.02 * np.abs(current)
    shown = truth["ocv"] - truth["R0"] * current - truth["R1"] * relaxed - bend
    noisy = shown + 2e-4 * np.random.default_rng(3).standard_normal(1200)
    data = Dataset(step * np.arange(1200), {"current": current}, {"voltage": noisy})
    effect = asymmetric_friction(Cell, "drop", "current", unit="V", nominal=0.05)
    diagnosis = diagnose(Cell, data, [effect])
    assert diagnosis.causes == ["asymmetric_friction"]
    for name, value in truth.items():
        estimate = diagnosis.estimates[name]
        low, high = estimate.interval
        # that of either way is 95 % of both, so that it ends 1.3 standard errors beyond the other
        assert abs(estimate.value - value) < 1.1 * max(estimate.value - low, high - estimate.value)
