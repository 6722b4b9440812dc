"""Claims: whether samples were taken evenly, or when their stamps say, is found from the record,
without bias.

The records are SciPy's: of samples that were taken late and say so, and of even ones with stamps
that are off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import diagnose
from orchestration.discrepancy.note import NoteCode
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.selection.clock import evened
from tests.support.intersample_records import TRUE, record
from tests.support.pace import slow_but

AT_REST = ("charge_start", "kelvin_elongation_start", "maxwell_elongation_start")
KINDS = [("chirp", False), ("multilevel", True)]


def mistaken(data: Dataset, jitter: float, seed: int) -> Dataset:
    """The same samples with stamps that are off."""
    off = np.clip(
        jitter * np.random.default_rng([seed, 17]).standard_normal(data.time.size), -0.04, 0.04
    )
    return replace(data, time=data.time + off)


def judged(data: Dataset):
    diagnosis = diagnose(PpyActuator, data, [], held=AT_REST)
    return diagnosis, [note for note in diagnosis.notes if note.code is NoteCode.EVEN_CLOCK]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "held"), slow_but(KINDS, ("chirp", False)))
def test_stamps_that_are_off_are_left_out(kind, held):
    deviations = []
    for seed in range(4):
        even = record(kind, held, seed, force="multilevel", noise=0.3)
        diagnosis, notes = judged(mistaken(even, 0.01, seed))
        assert [note.facts["jitter"] for note in notes] == [pytest.approx(0.01, rel=0.15)]
        assert "were taken evenly, as the outputs tell (BIC falls" in wording.message(notes[0])
        assert diagnosis.verdict == "recalibrate"
        steps = np.diff(diagnosis.validation.data.time)
        assert steps == pytest.approx(np.full(steps.size, 0.1), abs=1e-4)
        for name in ("R1", "R2", "C", "alpha"):
            estimate = diagnosis.estimates[name]
            low, high = estimate.interval
            deviations.append((estimate.value - TRUE[name]) / ((high - low) / 3.92))
    assert np.abs(deviations).max() < 4.0
    assert np.mean(np.square(deviations)) < 2.0  # 16 degrees of freedom: 0.99 quantile


@pytest.mark.parametrize(("kind", "held"), slow_but(KINDS, ("multilevel", True)))
def test_stamps_that_are_true_stay(kind, held):
    for seed in range(4):
        data = record(kind, held, seed, force="multilevel", jitter=0.02, noise=0.3)
        assert np.std(np.diff(data.time)) > 0.01
        diagnosis, notes = judged(data)
        assert notes == []
        assert np.array_equal(
            diagnosis.estimation.time, data.time[: diagnosis.estimation.time.size]
        )


def test_there_is_no_other_clock_where_stamps_are_even_or_samples_are_missing():
    data = record("chirp", False, 1, duration=40.0)
    assert evened(data) is None
    missing = np.delete(np.arange(data.time.size), [100, 200, 201])
    assert evened(mistaken(data, 0.01, 1).where(missing)) is None


def test_every_run_has_a_clock_of_its_own():
    runs = {
        label: mistaken(record("chirp", False, k, duration=40.0), 0.01, k)
        for k, label in enumerate("ab")
    }
    whole = evened(Dataset.joined(runs))
    assert whole is not None
    for part in whole.by_run().values():
        assert np.diff(part.time) == pytest.approx(np.full(part.time.size - 1, 0.1), abs=2e-4)
        assert abs(part.time[0]) < 5e-3
