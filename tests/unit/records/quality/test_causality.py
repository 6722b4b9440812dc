"""Claims: what follows an input is never said to move before it; what was filtered both ways is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from orchestration.records.quality import Channels, Fault, ahead_of_inputs

RNG = np.random.default_rng(3)


def driven(level: float, space: int = 150) -> Channels:
    """A first-order lag under steps, on paper, with noise of a level."""
    u = np.repeat(np.resize([1.0, -0.5, 0.3, -1.0], 3000 // space), space).astype(float)
    y = lfilter([0.1], [1.0, -0.9], u)
    return Channels(np.arange(3000.0), {"u": u}, {"y": y + level * RNG.standard_normal(3000)})


def with_output(data: Channels, y: np.ndarray) -> Channels:
    return Channels(data.time, data.inputs, {"y": y})


@pytest.mark.parametrize("level", [0.0, 1e-3, 0.1])
@pytest.mark.parametrize("space", [30, 150])
def test_what_follows_its_input_does_not_move_ahead(level, space):
    for _ in range(20 if level else 1):
        assert ahead_of_inputs(driven(level, space)) == []


def test_a_plant_that_swings_does_not_move_ahead():
    data = driven(0.0)
    swung = lfilter([0.01], [1.0, -1.98, 0.99], data.inputs["u"])
    noise = 0.01 * RNG.standard_normal(3000)
    assert ahead_of_inputs(with_output(data, swung + noise)) == []


def test_what_was_filtered_both_ways_moves_ahead():
    """Oracle: SciPy's filter, which is symmetrical in time."""
    data = driven(0.01)
    smooth = sosfiltfilt(butter(4, 0.05, output="sos"), data.outputs["y"])
    assert ahead_of_inputs(with_output(data, smooth)) == [Fault("moves_ahead", "y")]


def test_without_steps_nothing_is_said():
    data = driven(0.01)
    wave = np.sin(0.02 * data.time)
    assert ahead_of_inputs(Channels(data.time, {"u": wave}, data.outputs)) == []
    assert ahead_of_inputs(Channels(data.time, {}, data.outputs)) == []
