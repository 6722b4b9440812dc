"""Claims: the response of an FMU to a small change of an input is identified where it is linear."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.diagnosis.foreign.response import identify_responses
from orchestration.identify.fitting.any_fmu import FmuWithDifferences
from orchestration.identify.fitting.simulation_input import SimulationInput
from tests.support.lag import TAU, TIME, U


def test_the_response_is_that_of_the_lag(lag):
    with FmuWithDifferences(lag, (), ["x"], {"tau": TAU}) as fmu:
        (found,) = identify_responses(
            fmu, SimulationInput(TIME, {"u": U}, {}), ["x"], ["u"]
        ).values()
    assert found.a == pytest.approx(np.array([[-1.0 / TAU]]), rel=1e-6)
    assert found.b * found.c == pytest.approx([1.0 / TAU], rel=1e-6)
    assert found.fit > 99.9


def test_without_an_even_clock_there_are_no_responses(lag):
    uneven = np.sort(np.random.default_rng(1).uniform(0.0, TIME[-1], TIME.size))
    with FmuWithDifferences(lag, (), ["x"], {"tau": TAU}) as fmu:
        assert identify_responses(fmu, SimulationInput(uneven, {"u": U}, {}), ["x"], ["u"]) == {}
