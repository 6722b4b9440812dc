"""Claims: reduced errors are those of a dense least squares, their slopes those of differences."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.prediction_error import PredictionError
from orchestration.identify.black_box.variable_projection import ReducedPredictionError
from tests.support.black_box import box_jenkins_record
from tests.support.random_starts import Criterion

ORDERS = Orders(0, (2, 3), 2, 0, (2, 1), (1, 0))
COUNTS = {"nb": (2, 3), "nf": (2, 1), "nc": 2, "nd": 0, "nk": (1, 0)}
X = 0.8 * np.random.default_rng(0).standard_normal(5)


@pytest.fixture(scope="module")
def reduced():
    record = box_jenkins_record(3, 300)
    inputs = record.inputs - record.inputs.mean(axis=0)
    return ReducedPredictionError(
        PredictionError(inputs, record.output - record.output.mean(), ORDERS)
    )


def test_errors_are_those_of_a_dense_least_squares(reduced):
    record = box_jenkins_record(3, 300)
    oracle = Criterion(record.inputs, record.output, COUNTS)
    assert reduced.errors(X) == pytest.approx(oracle.errors(X), abs=1e-8)
    assert reduced.problem.errors(reduced.theta(X)) == pytest.approx(reduced.errors(X), abs=1e-8)


def test_the_slope_of_the_cost_is_that_of_differences(reduced):
    slope = 2.0 * reduced.jacobian(X).T @ reduced.errors(X)
    step = 1e-5 * np.eye(len(X))
    cost = [[np.sum(reduced.errors(X + sign * h) ** 2) for sign in (1, -1)] for h in step]
    differences = [(there - back) / 2e-5 for there, back in cost]
    assert slope == pytest.approx(differences, rel=1e-5, abs=1e-6)


def test_coordinates_are_those_of_the_polynomials_at_a_point(reduced):
    assert reduced.coordinates(reduced.polynomials(X)) == pytest.approx(X, abs=1e-9)


def test_every_point_is_a_stable_model_with_stationary_noise():
    record = box_jenkins_record(3, 300)
    problem = PredictionError(record.inputs, record.output, Orders(0, (1, 1), 0, 3, (1, 1), (1, 1)))
    reduced = ReducedPredictionError(problem)
    *paths, _, d = reduced.polynomials(np.full(reduced.size, 5.0))
    assert all(np.abs(np.roots(p)).max() < 1.0 for p in paths)
    assert np.abs(np.roots(d)).max() <= np.exp(-1.0 / problem.samples)
