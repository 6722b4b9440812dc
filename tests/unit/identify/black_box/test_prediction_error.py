"""Prediction errors against the difference equation, and their derivatives against differences."""

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.identify.black_box import (
    input_output_data,
)
from orchestration.identify.black_box.orders import orders
from orchestration.identify.black_box.prediction_error import PredictionError
from tests.support.black_box import box_jenkins_record

COUNTS = [{"na": 2, "nb": [2, 1], "nc": 2}, {"nb": [2, 3], "nf": [2, 1], "nc": 1, "nd": 2}]


@pytest.mark.parametrize("counts", COUNTS, ids=str)
@pytest.mark.parametrize("offset", [True, False])
def test_derivatives_are_those_of_differences(counts, offset):
    record = box_jenkins_record(4, 60)
    data = input_output_data(record.inputs, record.output, 1.0)
    problem = PredictionError(
        data.inputs, data.output, orders(data, nk=[0, 2], **counts), offset=offset
    )
    theta = 0.2 * np.random.default_rng(0).standard_normal(problem.size)
    step = 1e-6
    for i, column in enumerate(problem.jacobian(theta).T):
        there, back = theta.copy(), theta.copy()
        there[i] += step
        back[i] -= step
        assert column == pytest.approx(
            (problem.errors(there) - problem.errors(back)) / (2 * step), abs=1e-6
        )


def test_prediction_errors_are_those_of_the_difference_equation():
    record = box_jenkins_record(6, 80)
    data = input_output_data(record.inputs, record.output, 1.0)
    problem = PredictionError(
        data.inputs, data.output, orders(data, [1, 2], nk=[0, 1], nf=[1, 1], nc=1, nd=1)
    )
    # b1, f1, b2, b3, f2, c, d, the offset and the free responses t1 and t2
    theta = np.array([0.4, -0.6, 0.2, 0.1, -0.3, 0.5, -0.7, 0.9, 1.5, -2.0])
    first = path(theta[[0]], theta[1], record.inputs[:, [0]][2:], theta[8])
    delayed = np.column_stack([record.inputs[1:-1, 1], record.inputs[:-2, 1]])
    second = path(theta[2:4], theta[4], delayed, theta[9])
    disturbance = record.output[2:] - first - second - theta[7]
    errors = []
    before = e = 0.0
    for v in disturbance:
        e = v + theta[6] * before - theta[5] * e
        before = v
        errors.append(e)
    assert problem.errors(theta) == pytest.approx(np.array(errors), abs=1e-12)


def path(numerator, pole, inputs, transient):
    """Step the difference equation of a path with one pole and a free response."""
    outputs = []
    w = 0.0
    for k, u in enumerate(inputs):
        w = -pole * w + numerator @ u + (transient if k == 0 else 0.0)
        outputs.append(w)
    return np.array(outputs)


def test_rounding_of_filters_with_poles_near_one_cancels_between_delayed_inputs():
    """An output without noise is a combination of slopes by B and the free responses; a filter for
    each delayed input, with rounding of its own, would leave some 1e-8 of it.
    """
    u = np.cumsum(np.random.default_rng(1).standard_normal(6000))
    f, d = np.poly([0.999] * 3), np.poly([0.9, 0.8, 0.7])
    data = input_output_data(u, lfilter([0.0, 0.3, -0.5, 0.21], f, u), 1.0)
    problem = PredictionError(data.inputs, data.output, orders(data, 3, 1, nf=3, nc=3, nd=3))
    parts = problem.coefficients(np.zeros(problem.size))._replace(f=(f,), c=f, d=d)
    rows = problem.linear_slopes(parts)
    through = lfilter(d, f, problem.present_output)
    left = through - rows.T @ np.linalg.lstsq(rows.T, through, rcond=None)[0]
    assert np.linalg.norm(left) < 1e-9 * np.linalg.norm(through)
