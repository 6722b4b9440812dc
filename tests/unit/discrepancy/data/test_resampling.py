"""Claims: of a record that was resampled by straight lines, what was measured is used alone."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.resampling import as_measured
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.note import NoteCode
from tests.support.wired_motor import FRICTION, Motor, wired


def resampled(data, times, first=0):
    """Return a record by straight lines, from so many fine samples after its first one on."""
    count = len(data.time)
    fine = np.arange(first, times * (count - 1) + 1) / times

    def lines(values):
        return np.interp(fine, np.arange(count), values)

    return Dataset(
        lines(data.time),
        {name: lines(values) for name, values in data.inputs.items()},
        {name: lines(values) for name, values in data.measured.items()},
    )


@pytest.mark.parametrize(("times", "first"), [(2, 0), (7, 0), (10, 4), (24, 1)])
def test_what_was_measured_is_left(times, first):
    data = wired()
    kept, (note,) = as_measured(resampled(data, times, first))
    assert note.code is NoteCode.RESAMPLED
    assert note.facts["times"] == times
    start = 1 if first else 0
    assert kept.time == pytest.approx(data.time[start:])
    assert kept.inputs["drive"] == pytest.approx(data.inputs["drive"][start:])
    assert kept.measured["shown"] == pytest.approx(data.measured["shown"][start:])


@pytest.mark.parametrize(
    "y",
    [
        wired().measured["shown"],
        wired(noise=0.0).measured["shown"],
        np.abs(np.arange(1500) % 40 - 20.0),  # a triangle without noise
        np.interp(np.arange(1500), [0, 700, 740, 1500], [0.0, 1.0, -3.0, 2.0]),
        np.zeros(1500),
    ],
)
def test_other_records_are_left_alone(y):
    data = wired()
    data = Dataset(data.time, data.inputs, {"shown": y})
    assert as_measured(data) == (data, [])


def test_one_output_that_is_not_resampled_is_enough():
    data = resampled(wired(), 5)
    rng = np.random.default_rng(1)
    both = {**data.measured, "other": rng.standard_normal(len(data.time))}
    data = Dataset(data.time, data.inputs, both)
    assert as_measured(data) == (data, [])


def test_a_resampled_record_gets_the_verdict_of_the_one_that_was_measured():
    """Lines between held inputs look like a delay of half a sample."""
    diagnosis = diagnose(Motor, resampled(wired(), 6), [FRICTION])
    assert diagnosis.verdict is diagnose(Motor, wired(), [FRICTION]).verdict
    assert diagnosis.verdict in (Verdict.CONSISTENT, Verdict.RECALIBRATE)
    assert NoteCode.RESAMPLED in {note.code for note in diagnosis.notes}
