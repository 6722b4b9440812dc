"""Claims: stimuli are what they say, and stay between the limits of their inputs."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.ppy_actuator.model import PpyActuator
from orchestration.experiment.design.menu import Stimulus, limits_of_inputs, shapes_between
from tests.support.ambiguous import DULL


def test_a_stimulus_says_what_it_is():
    ramp = Stimulus("ramps", {"times": [0.0, 1.0], "levels": [0.0, 2.0]})
    assert ramp.values(np.array([0.0, 0.25, 3.0])) == pytest.approx([0.0, 0.5, 2.0])


def test_limits_that_nobody_gave_are_what_the_record_shows():
    declared = PpyActuator.layout.inputs
    assert limits_of_inputs(declared, DULL, {"force": (0.0, 3.0)}) == {
        "current": (-0.2, 0.4),
        "force": (0.0, 3.0),
    }


def test_all_shapes_stay_between_the_limits_and_the_broadest_comes_first():
    shapes = shapes_between(-1.0, 3.0, 0.5, duration=600.0, step=0.1, shortest=0.5, seed=1)
    time = 0.1 * np.arange(6001)
    for shape in shapes:
        values = shape.values(time)
        assert values.min() >= -1.0
        assert values.max() <= 3.0
    assert shapes[0].kind == "multilevel"
    assert np.ptp(shapes[0].values(time)) == pytest.approx(4.0)
    held = shapes_between(2.0, 2.0, 2.0, duration=600.0, step=0.1, shortest=0.5, seed=1)
    assert [shape.kind for shape in held] == ["constant"]
