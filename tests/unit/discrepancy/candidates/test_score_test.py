"""Claims: score directions are derivatives by a switch, or differences where it goes one way."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import stack, transport_delay
from orchestration.discrepancy.candidates.score_test import score_directions, start_values
from orchestration.identify.fitting.problem import Problem
from tests.support.regression_model import OFFSET, Amplifier, offset_record


def problem_with(effect):
    data = offset_record(30.0, 1)
    cls = stack(Amplifier, effect)
    names = [p.name for p in effect.layout.parameters if p.name in vars(effect)["declared"]]
    return data, Problem(cls, data.time, data.inputs, data.measured, names, {})


def test_a_switch_that_goes_both_ways_is_scored_by_its_derivative():
    """An offset takes off of the residual what it adds to the output, per searched coordinate."""
    data, problem = problem_with(OFFSET)
    (direction,) = score_directions(problem, OFFSET)
    size = problem.scales[0].size
    assert direction.gradient["shown"] == pytest.approx(np.full(data.time.size, -size), rel=1e-6)
    assert direction.least < 0.0 < direction.most
    found = start_values(direction, problem, OFFSET.neutral, 0.3)
    assert found[OFFSET.neutral] == pytest.approx(0.3 * size)


def test_a_delay_is_scored_by_differences():
    """Half a sample more than a whole number of samples shows the input that many and one ago."""
    delay = transport_delay(Amplifier, "shown")
    data, problem = problem_with(delay)
    u = data.inputs["signal"]
    differences = [d for d in score_directions(problem, delay) if d.least > 0.0]
    for direction in differences:
        (seconds,) = direction.values.values()
        late = int(np.ceil(seconds / 0.1 - 1e-9))
        expected = 2.0 * (u[late:] - u[:-late])
        assert direction.gradient["shown"][late:] == pytest.approx(expected, abs=1e-5)
    assert len(differences) > 3
