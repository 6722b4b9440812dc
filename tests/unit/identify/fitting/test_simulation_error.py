"""Claims: a search from anywhere ends no farther off than least squares from the truth.

Oracles: records drawn of state matrices, and SciPy's least squares on their simulation by matrix
exponentials.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import qmc

from orchestration.discrepancy.diagnosis import searched_parameters
from orchestration.fmu.model import find_model
from orchestration.identify.fitting.least_squares import Minimum
from orchestration.identify.fitting.prediction_error import fit_free_run
from orchestration.identify.fitting.problem import Problem
from orchestration.identify.fitting.simulation_error import (
    _WeightedErrors,
    error_scales,
    halton_points,
    pooled_error,
    starting_points,
)
from studies.clean.records import Case, draw

# records and starting points from which a trust region with other units than these ends far off, or
# early
HARD = [
    (Case("Actuator", "square", "12 bit", 2026112300096, at_rest=False), 1),
    (Case("Actuator", "square", "12 bit", 2026112300096, at_rest=False), 2),
    (Case("Actuator", "closed loop", "outliers", 2026112300152, at_rest=False), 2),
    (Case("VoiceCoil", "multisine", "12 bit", 2026112300139), 0),
]


def from_the_truth(drawn, scales):
    """Return the pooled error of least squares that starts at the true parameters."""
    names, rest = list(drawn.plant.nominal), [f"{n}_start" for n in drawn.plant.states]
    sizes = {n: max(abs(drawn.truth[n]), 1e-6) for n in rest}

    def errors(q):
        values = {n: drawn.truth[n] * np.exp(x) for n, x in zip(names, q, strict=False)}
        values |= {
            n: drawn.truth[n] + sizes[n] * x for n, x in zip(rest, q[len(names) :], strict=True)
        }
        simulated = drawn.simulated(values)
        return np.concatenate([(y - simulated[o]) / scales[o] for o, y in drawn.outputs.items()])

    found = least_squares(errors, np.zeros(len(names) + len(rest)), x_scale="jac").fun
    return float(np.sqrt(np.mean(found**2)))


@pytest.mark.parametrize(("case", "begin"), HARD, ids=str)
def test_a_search_ends_no_farther_off_than_least_squares_from_the_truth(case, begin):
    drawn = draw(case)
    cls, given = find_model(drawn.plant.model).cls, dict(drawn.plant.settings)
    if case.plant == "VoiceCoil":
        given |= {"sample_period": drawn.step}
    problem = Problem(
        cls,
        drawn.time,
        drawn.inputs,
        drawn.outputs,
        searched_parameters(cls),
        given,
        linear=drawn.smooth,
    )
    scales = error_scales(problem)
    physical = np.array([not problem.declared[name].starts for name in problem.names])
    found = fit_free_run(problem, [starting_points(problem)[begin]], physical)
    assert found.converged
    assert pooled_error(found.residual, scales) < 1.001 * from_the_truth(drawn, scales)


@pytest.mark.parametrize("dimensions", [1, 3, 40])
def test_points_are_of_a_halton_sequence(dimensions):
    expected = qmc.Halton(dimensions, scramble=False).random(5)[1:]
    np.testing.assert_array_equal(halton_points(4, dimensions), expected)


@pytest.mark.parametrize(
    ("cost", "promised", "goes_on"),
    [(130.0, 30.0, False), (130.0, 45.0, True), (399.0, 350.0, True), (401.0, 350.0, False)],
    ids=["ends where the best did", "ends below", "far off yet", "too far off"],
)
def test_a_search_from_elsewhere_goes_on_where_it_may_end_below_the_best(cost, promised, goes_on):
    """The best has 100, and a fall of a tenth of that is clear, with 100 samples."""
    errors = _WeightedErrors(SimpleNamespace(samples=100), {}, None)
    costs = {"best": 100.0, "begun": cost, "ended": 60.0}
    searched = []

    def search(begin, tolerance, trials=200):
        searched.append(begin)
        return Minimum("ended", True) if begin == "begun" else Minimum("begun", False, promised)

    errors.search, errors.cost = search, costs.get
    end = errors.better_minimum(Minimum("best", True), "start", 1e-6)
    assert searched == (["start", "begun"] if goes_on else ["start"])
    assert end.q == ("ended" if goes_on else "best")
