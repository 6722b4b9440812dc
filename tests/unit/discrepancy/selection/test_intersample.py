"""Claims: what inputs do between samples is found from the record, and estimates are unbiased for
it.

The records are SciPy's: currents that are functions of time between the samples, or held.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter, sawtooth

from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.selection.intersample import InterpolationBasis, Intersample, spread
from orchestration.fmu.model import find_model
from tests.support.diagnosis import short_record
from tests.support.intersample_records import NOISE, TRUE, record
from tests.support.pace import slow_but

AT_REST = ("charge_start", "kelvin_elongation_start", "maxwell_elongation_start")
SMOOTH, STEPS = ("chirp", "multisine", "triangle"), ("square", "prbs", "multilevel")


def judged(data: Dataset):
    return diagnose(PpyActuator, data, [], held=AT_REST)


def standardised(diagnosis, name: str) -> float:
    """Error of an estimate over its standard error."""
    estimate = diagnosis.estimates[name]
    low, high = estimate.interval
    return float((estimate.value - TRUE[name]) / ((high - low) / 3.92))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "held"),
    slow_but(
        [*((k, False) for k in SMOOTH), *((k, True) for k in (*STEPS, "chirp", "every sample"))],
        ("triangle", False),
        ("square", True),
    ),
)
def test_the_series_resistance_is_unbiased(kind, held):
    """Held in place of smooth or the reverse, it would be off by T/2C: 4 %, dozens of standard
    errors.
    """
    deviations = []
    for seed in range(6):
        diagnosis = judged(record(kind, held, seed, force="multilevel"))
        assert diagnosis.intersample["current"].linear is not held
        assert not diagnosis.intersample["force"].linear
        assert diagnosis.verdict == "recalibrate"
        deviations.append(standardised(diagnosis, "R1"))
    assert abs(np.mean(deviations)) < 3.3 / np.sqrt(6)
    assert np.abs(deviations).max() < 4.0


def test_inputs_may_differ():
    """A current in steps beside a force that is smooth: the force alone goes linearly."""
    chosen = judged(record("square", True, 1, force="multisine", force_held=False)).intersample
    assert {name: choice.linear for name, choice in chosen.items()} == {
        "current": False,
        "force": True,
    }


def test_a_held_chirp_is_found_by_the_fits_and_said():
    diagnosis = judged(record("chirp", True, 1))
    choice = diagnosis.intersample["current"]
    assert (choice.basis, choice.linear) == (InterpolationBasis.FIT, False)
    assert choice.margin > 100.0
    (note,) = [note for note in diagnosis.notes if note.code is NoteCode.INTERSAMPLE]
    assert wording.message(note).startswith(
        "current: taken to be held between samples, as the outputs tell (BIC falls"
    )


def test_what_is_given_is_not_asked_of_the_record():
    data = record("chirp", True, 1)
    given = {linear: judged(replace(data, linear=linear)) for linear in (True, False)}
    for linear, diagnosis in given.items():
        assert diagnosis.intersample["current"].linear is linear
        assert diagnosis.intersample["current"].basis is InterpolationBasis.GIVEN
        assert NoteCode.INTERSAMPLE not in {note.code for note in diagnosis.notes}
    assert given[False].after["voltage"] < given[True].after["voltage"]


def test_where_the_fits_do_not_tell_it_is_said_what_hangs_on_it():
    """Of the voltage alone, and that for a few seconds, R1 and half a sample of the charge are the
    same.
    """
    diagnosis = judged(
        record("multisine", False, 2, duration=40.0, rate=10.0, outputs=("voltage",), noise=3.0)
    )
    choice = diagnosis.intersample["current"]
    assert (choice.linear, choice.basis, choice.dependent_parameter) == (
        True,
        InterpolationBasis.COURSE,
        "R1",
    )
    assert choice.factor == pytest.approx(1.0 + 0.1 / (2.0 * TRUE["C"] * TRUE["R1"]), rel=0.01)
    (note,) = [note for note in diagnosis.notes if note.code is NoteCode.INTERSAMPLE_OPEN]
    assert "the other way, R1 would be 1.0" in wording.message(note)
    assert abs(choice.margin) < 10.0
    estimate = diagnosis.estimates["R1"]
    low, high = estimate.interval
    assert low < TRUE["R1"] < high
    assert low < choice.factor * estimate.value < high


@pytest.mark.parametrize("seed", range(2))
def test_a_lag_that_takes_over_half_a_sample_has_an_interval_of_both(seed):
    """Held or not, a lag of first order does nearly the same with another time: half a sample more
    or less.
    """
    time = np.arange(2000) / 20.0
    command = 2.2 * sawtooth(2.0 * np.pi * time / 18.0 + 0.4, 0.5)
    decay = np.exp(-0.05 / 0.3)
    current = lfilter([0.0, 1.0 - decay], [1.0, -decay], np.clip(command, -1.05, 1.05))  # held
    noisy = current + 0.04 * np.random.default_rng(seed).standard_normal(2000)
    data = Dataset(time, {"current_command": command}, {"current": noisy})
    given = {"response_time": 0.3, "current_limit": 1.05}
    diagnosis = diagnose(find_model("galvanostat").cls, data, [], given)
    choice = diagnosis.intersample["current_command"]
    assert (choice.linear, choice.dependent_parameter) == (False, "response_time")
    low, high = diagnosis.estimates["response_time"].interval
    assert low < 0.3 < high


@pytest.mark.parametrize("apart", [0.0, 1.0, 4.0, -12.0])
@pytest.mark.parametrize("margin", [0.0, 3.0, 9.0])
def test_an_interval_holds_95_percent_of_both_ways(apart, margin):
    """By a million draws from the two, weighted by their BIC."""
    random = np.random.default_rng(5)
    other = random.random(1_000_000) < 1.0 / (1.0 + np.exp(margin / 2.0))
    drawn = 0.02 * random.standard_normal(1_000_000) + np.where(other, 0.02 * apart, 0.0)
    fit = SimpleNamespace(covariance=SimpleNamespace(standard_errors=np.array([0.02, np.inf])))
    model = SimpleNamespace(fit=fit, problem=SimpleNamespace(names=["R1", "C"]))
    choice = Intersample(
        True, InterpolationBasis.COURSE, margin, shift={"R1": 0.02 * apart, "C": 1.0}
    )
    more = spread({"current": choice}, model)
    half = 1.96 * np.hypot(0.02, more[0])
    assert np.mean(np.abs(drawn) < half) == pytest.approx(0.95, abs=0.002)
    assert more[1] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "hidden", slow_but(["strain_lag", "transport_delay", "sensor_lag", "diffusion"], "strain_lag")
)
def test_what_the_model_lacks_is_not_taken_for_the_input(hidden):
    """Inputs of the rig are held; a lag that the model does not have looks like part of a
    sample.
    """
    chosen = diagnose(PpyActuator, short_record(hidden), []).intersample
    assert {choice.linear for choice in chosen.values()} == {False}


@pytest.mark.slow
def test_outliers_do_not_tell_what_an_input_does():
    """One sample in fifty is dozens of deviations off; what the others ask for is to be heard."""
    deviations = []
    for seed in range(4):
        data = record("triangle", True, seed, force="multilevel")
        random = np.random.default_rng([seed, 23])
        hit = random.random(data.time.size) < 0.02
        off = {
            o: hit * random.uniform(20.0, 60.0, hit.size) * random.choice([-1.0, 1.0], hit.size)
            for o in NOISE
        }
        measured = {o: y + NOISE[o] * off[o] for o, y in data.measured.items()}
        diagnosis = judged(replace(data, measured=measured))
        assert not diagnosis.intersample["current"].linear
        deviations.append(standardised(diagnosis, "R1"))
    assert np.abs(deviations).max() < 4.0
