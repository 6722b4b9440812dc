"""Claims: errors of outputs are pooled by the size of their noise."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.identify.fitting.problem import Problem
from orchestration.identify.fitting.simulation_error import error_at, error_scales, pooled_error
from tests.support.cell import TRUE, Cell, measured, voltage

NOISE = 2e-3


@pytest.fixture
def problem():
    record = measured(3, 1.0, NOISE, 2000)
    names = ["R0", "R1", "tau1"]
    start = TRUE | {"ocv": 3.3, "relaxed_start": 1.0}
    return Problem(Cell, record.time, record.inputs, record.outputs, names, start)


def test_the_scale_of_an_output_is_its_noise(problem):
    assert error_scales(problem) == {"voltage": pytest.approx(NOISE, rel=0.3)}


def test_the_error_at_the_truth_is_that_of_the_noise(problem):
    """The oracle is the exact solution of the equations."""
    q = problem.position(problem.start)
    clean = voltage(problem.inputs["current"], 1.0, 3.3, **TRUE)
    size = np.sqrt(np.mean((problem.measured["voltage"] - clean) ** 2))
    assert error_at(problem, q) == pytest.approx(size / error_scales(problem)["voltage"], rel=1e-3)


def test_errors_are_root_mean_squares_over_their_scales():
    residual = {"a": np.array([3.0, -3.0]), "b": np.array([0.0, 8.0])}
    pooled = pooled_error(residual, {"a": 1.0, "b": 2.0})
    assert pooled == pytest.approx(np.sqrt((9.0 + 9.0 + 0.0 + 16.0) / 4.0))
