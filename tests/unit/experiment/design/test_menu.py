"""Claims: stimuli are what they say, and stay between the limits of their inputs."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input
from fmus.ppy_actuator.model import PpyActuator
from orchestration.experiment.design.menu import (
    Stimulus,
    limits_of_inputs,
    menus,
    operating_values,
    shapes_between,
)
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


class Heated(Component):
    """Inputs of a plant at an operating point that is not zero."""

    name = "heated"
    valve = Input("1", min=0, max=1)
    supply = Input("K", start=293.0, min=250, max=400, doc="nobody sets it")
    pump = Input("1", start=False, type="boolean")


def test_an_input_that_stood_still_while_others_moved_stays_where_it_was():
    declared = Heated.layout.inputs
    recorded = {
        "valve": np.array([0.4, 0.5, 0.5, 0.4, 0.4]),
        "supply": np.full(5, 353.15),
        "pump": np.ones(5),
    }
    kept = {"supply": (353.15, 353.15), "pump": (1.0, 1.0)}
    assert limits_of_inputs(declared, recorded, {}) == {"valve": (0.0, 1.0), **kept}
    rig = {"supply": (340.0, 360.0)}
    assert limits_of_inputs(declared, recorded, rig)["supply"] == (340.0, 360.0)
    # where nothing moved, that says nothing
    recorded["valve"] = np.full(5, 0.4)
    assert limits_of_inputs(declared, recorded, {})["supply"] == (250.0, 400.0)


def test_what_rests_does_so_where_it_was_recorded():
    declared = Heated.layout.inputs
    recorded = {"valve": np.array([0.4, 0.5, 0.5, 0.4]), "supply": np.array([353.0, 354.0, 353.0])}
    operating = operating_values(declared, recorded)
    assert operating == {"valve": 0.4, "supply": 353.0, "pump": 0.0}
    shapes = menus(operating, {"valve": (0.0, 1.0)}, duration=60.0, step=1.0, shortest=2.0)
    ramps, pulses, resting = shapes["valve"][6:9]
    assert ramps.keys["levels"][0] == pulses.keys["initial"] == resting.keys["value"] == 0.4


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
