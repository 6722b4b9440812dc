"""Claims: of a record that was resampled or filtered, what tells something is used alone."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.records.quality import Channels, as_measured
from tests.support.wired_motor import wired


def resampled(data, times, first=0):
    """Return a record by straight lines, from so many fine samples after its first one on."""
    count = len(data.time)
    fine = np.arange(first, times * (count - 1) + 1) / times

    def lines(values):
        return np.interp(fine, np.arange(count), values)

    return Channels(
        lines(data.time),
        {name: lines(values) for name, values in data.inputs.items()},
        {name: lines(values) for name, values in data.outputs.items()},
    )


@pytest.mark.parametrize(("times", "first"), [(2, 0), (7, 0), (10, 4), (24, 1)])
def test_what_was_measured_is_left(times, first):
    data = wired().channels
    kept, (note,) = as_measured(resampled(data, times, first))
    assert note.code == "resampled"
    assert note.facts["times"] == times
    start = 1 if first else 0
    assert kept.time == pytest.approx(data.time[start:])
    assert kept.inputs["drive"] == pytest.approx(data.inputs["drive"][start:])
    assert kept.outputs["shown"] == pytest.approx(data.outputs["shown"][start:])


@pytest.mark.parametrize(
    "y",
    [
        wired().channels.outputs["shown"],
        wired(noise=0.0).channels.outputs["shown"],
        np.abs(np.arange(1500) % 40 - 20.0),  # a triangle without noise
        np.interp(np.arange(1500), [0, 700, 740, 1500], [0.0, 1.0, -3.0, 2.0]),
        np.zeros(1500),
    ],
)
def test_other_records_are_left_alone(y):
    data = wired().channels
    data = Channels(data.time, data.inputs, {"shown": y})
    assert as_measured(data) == (data, [])


def test_one_output_that_is_not_resampled_is_enough():
    data = resampled(wired().channels, 5)
    rng = np.random.default_rng(1)
    both = {**data.outputs, "other": rng.standard_normal(len(data.time))}
    data = Channels(data.time, data.inputs, both)
    assert as_measured(data) == (data, [])


def test_a_record_with_noise_keeps_its_samples():
    assert as_measured(wired().channels)[1] == []
