"""Common signals of controllers of a displacement by a current. Oracle: thesis table 2-2."""

import pytest

from fmus.controllers import (
    AdaptiveController,
    DisplacementController,
    Feedforward,
    LearningController,
    StateFeedback,
)

CONTROLLERS = (
    AdaptiveController,
    DisplacementController,
    Feedforward,
    LearningController,
    StateFeedback,
)


@pytest.mark.parametrize("cls", CONTROLLERS)
def test_the_largest_current_is_that_of_the_galvanostat(cls):
    limit = cls.declared["current_limit"]
    assert (limit.start, limit.unit, limit.source) == (1.3, "A", "thesis table 2-2 (HA-151)")


@pytest.mark.parametrize("cls", CONTROLLERS)
def test_lengths_are_shown_in_millimetres_and_sampled_with_the_controller(cls):
    lengths = [v for v in cls.layout.discretes if v.unit == "m" and v.name != "sensitivity"]
    assert lengths
    for length in lengths:
        assert (length.display, length.period, length.nominal) == ("mm", "sample_period", 1e-4)
