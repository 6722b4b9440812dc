"""Long records: searched in a stretch, fitted to every sample and judged by every sample."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

from fmus.kit.sensors import measurement_effects
from orchestration.discrepancy import diagnosis as diagnosing
from orchestration.discrepancy.candidates import label
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.diagnosis import Diagnosis, diagnose
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.selection import all_samples
from tests.support.several import STEP, TRUE, Cell

NOISE = 1e-3  # V
SAMPLES = 45_000  # of which two thirds are fitted to
EFFECTS = [e for e in measurement_effects(Cell) if label(e).startswith("sensor_lag")]


def voltage(current: np.ndarray, ocv: float, R0: float, R1: float, tau1: float) -> np.ndarray:
    """Voltage (n,) of a cell at rest at first, under a current held from sample to sample."""
    decay = np.exp(-STEP / tau1)
    relaxed = lfilter([0.0, 1.0 - decay], [1.0, -decay], current)
    return ocv - R0 * current - R1 * relaxed


def long_record(lag: float = 0.0, from_sample: int = 0) -> Dataset:
    """A record of more than an hour whose voltage is shown with a lag of a time constant, s."""
    random = np.random.default_rng(5)
    current = np.repeat(random.uniform(-2.0, 2.0, SAMPLES // 15), 15)
    shown = voltage(current, 3.3, **TRUE)
    if lag:
        decay = np.exp(-STEP / lag)
        # of a held value the sensor shows what it has come to at the next sample
        late = lfilter([1.0 - decay], [1.0, -decay], shown - 3.3) + 3.3
        shown = np.where(np.arange(SAMPLES) < from_sample, shown, late)
    noisy = shown + NOISE * random.standard_normal(SAMPLES)
    return Dataset(STEP * np.arange(SAMPLES), {"current": current}, {"voltage": noisy})


def notes(diagnosis: Diagnosis) -> list[NoteCode]:
    """Codes of the notes."""
    return [note.code for note in diagnosis.notes]


@pytest.fixture(scope="module")
def lagging():
    return diagnose(Cell, long_record(lag=0.3), EFFECTS)


@pytest.mark.slow
def test_an_effect_is_named_as_in_a_short_record(lagging):
    short = diagnose(Cell, long_record(lag=0.3).part(0, 3000), EFFECTS)
    assert lagging.causes == short.causes == ["sensor_lag(voltage)"]
    assert NoteCode.SEARCHED_IN_PART in notes(lagging)
    assert NoteCode.SEARCHED_IN_PART not in notes(short)


@pytest.mark.slow
def test_an_effect_for_which_all_samples_do_not_speak_is_noted_and_not_named(monkeypatch, lagging):
    assert NoteCode.NOT_IN_ALL_SAMPLES not in notes(lagging)
    monkeypatch.setattr(all_samples, "ACCEPT", np.inf)
    monkeypatch.setattr(all_samples, "whitens_residual", lambda before, after: False)
    monkeypatch.setattr(diagnosing, "_shows_more", lambda selected, fitted: False)
    diagnosis = diagnose(Cell, long_record(lag=0.3).part(0, 33_000), EFFECTS)
    assert diagnosis.causes == []
    subjects = {note.code: note.subject for note in diagnosis.notes}
    assert subjects[NoteCode.NOT_IN_ALL_SAMPLES] == "sensor_lag(voltage)"


@pytest.mark.slow
def test_every_sample_is_fitted_to_and_judged_by(lagging):
    assert lagging.final.fit.samples == SAMPLES
    assert lagging.selection.best.fit.samples == len(lagging.estimation.time) == SAMPLES * 2 // 3
    assert lagging.validation.judged.sum() == SAMPLES // 3


def test_parameters_are_those_of_a_fit_to_all_samples():
    data = long_record()
    diagnosis = diagnose(Cell, data, EFFECTS)
    assert diagnosis.causes == []
    names = ["ocv", *TRUE]
    scale = np.array([3.3, *TRUE.values()])

    def residual(q):
        return data.measured["voltage"] - voltage(data.inputs["current"], *(q * scale))

    oracle = dict(zip(names, least_squares(residual, np.ones(4)).x * scale, strict=True))
    for name, value in oracle.items():
        low, high = diagnosis.estimates[name].interval
        assert abs(diagnosis.final.fit.values[name] - value) < 0.05 * (high - low)


@pytest.mark.slow
def test_what_acts_later_only_does_not_go_unseen():
    diagnosis = diagnose(Cell, long_record(lag=0.3, from_sample=12_000), EFFECTS)
    assert diagnosis.causes or diagnosis.verdict == "unexplained"


@pytest.mark.slow
def test_structure_without_a_cause_is_searched_for_in_a_longer_stretch():
    diagnosis = diagnose(Cell, long_record(lag=0.3), [])
    assert diagnosis.verdict == "unexplained"
    assert NoteCode.SEARCHED_IN_PART not in notes(diagnosis)  # by then all of it was searched
