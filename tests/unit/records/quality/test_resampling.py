"""Claims: of a record that was resampled or filtered, what tells something is used alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from orchestration.records.quality import Channels, as_measured, without_oversampling
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


def filtered_decay(corner):
    """A decay in noise, of which SciPy's filter leaves what is slower than a corner."""
    time = 0.01 * np.arange(6000.0)
    noise = 0.02 * np.random.default_rng(1).standard_normal(6000)
    y = 2.0 * np.exp(-time / 12.0) + noise
    if corner:
        y = sosfiltfilt(butter(4, corner, output="sos"), y)
    return Channels(time, {}, {"y": y})


def test_of_what_was_filtered_as_many_samples_count_as_tell_it():
    """Oracle: the sampling theorem, with the corner of the filter as the highest frequency."""
    kept, (note,) = without_oversampling(filtered_decay(0.01))
    assert note.code == "oversampled"
    samples_of_a_period = 2.0 / 0.01 / note.facts["times"]
    assert 8.0 < samples_of_a_period < 40.0
    restored = CubicSpline(kept.time, kept.outputs["y"])(filtered_decay(0.01).time[:-100])
    assert restored == pytest.approx(filtered_decay(0.01).outputs["y"][:-100], abs=1e-3)


def test_a_record_with_noise_keeps_its_samples():
    for data in (filtered_decay(0.0), wired().channels):
        assert as_measured(data)[1] == without_oversampling(data)[1] == []


def test_an_input_that_was_held_does_what_it_did():
    time = np.arange(4000.0)
    u = np.sin(0.004 * time)
    kept, (note,) = without_oversampling(Channels(time, {"u": u}, {"y": np.cos(0.004 * time)}))
    times = note.facts["times"]
    whole = len(kept.time) - 1
    assert kept.inputs["u"][:whole] == pytest.approx(u[: whole * times].reshape(-1, times).mean(1))
    smooth = Channels(time, {"u": u}, {"y": np.cos(0.004 * time)}, frozenset(["u"]))
    assert without_oversampling(smooth)[0].inputs["u"] == pytest.approx(u[::times])
