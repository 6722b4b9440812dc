"""Claims: a polynomial model rests, decays and integrates as its equation does on paper."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.identify.black_box import arx, box_jenkins, input_output_data, output_error
from tests.support.black_box import BOX_JENKINS, box_jenkins_record, fit, response


@pytest.fixture(scope="module")
def model():
    record = box_jenkins_record(11, 1500)
    return box_jenkins(
        input_output_data(record.inputs, record.output, 0.1), [2, 2], [2, 1], 1, 1, [1, 2]
    ).model


def test_free_run_starts_where_it_is_told(model):
    truth = {"A": [1.0, BOX_JENKINS["f2_1"]]}
    held = np.tile([0.7, -0.4], (50, 1))
    gain = [np.sum(b) / np.sum(f) for b, f in zip(model.b, model.f, strict=True)]
    level = model.output_offset + gain @ (held[0] - model.input_offsets)
    assert model.simulate(held, before=[0.7, -0.4]) == pytest.approx(np.full(50, level))
    assert model.simulate(np.tile(model.input_offsets, (5, 1))) == pytest.approx(
        np.full(5, model.output_offset)
    )
    # away from rest: the initial state is found from what was measured
    decay = 5.0 * (-truth["A"][1]) ** np.arange(50)
    assert model.simulate(held, level + decay) == pytest.approx(level + decay, abs=0.05)


def test_a_model_that_integrates_rests_nowhere_but_at_its_offsets():
    u = np.random.default_rng(2).standard_normal(400)
    y = response([0.0, 0.3], [1.0, -1.0], u - np.mean(u))
    model = arx(input_output_data(u, y, 1.0), 1, 1).model
    assert abs(model.poles()[0]) == pytest.approx(1.0, abs=1e-6)
    exact = type(model)(**{**vars(model), "a": np.array([1.0, -1.0])})
    with pytest.raises(UserError, match="a model that integrates rests only at"):
        exact.simulate(u, before=[1.0])
    assert fit(y, exact.simulate(u, y)) > 99.0


def test_a_free_run_in_the_middle_of_a_dead_time_knows_what_is_on_its_way():
    """The last part of a run without noise, against all of it."""
    u = np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], 40), 7)
    y = response([*np.zeros(9), 0.1], [1.0, -0.9], u)
    model = output_error(input_output_data(u, y, 1.0), 1, 1, 9).model
    for first in (154, 156, 159):  # behind a step at 154
        assert fit(y[first:], model.simulate(u[first:], y[first:])) > 99.99


def test_poles_zeros_and_noise_are_those_of_the_coefficients(model):
    """The second path has a pole at -f and a zero at -b3/b2; noise is (1 + c q^-1)/(1 + d q^-1)."""
    b, f = model.b[1], model.f[1]
    assert model.poles(1) == pytest.approx([-f[1]])
    assert model.zeros(1) == pytest.approx([-b[3] / b[2]])
    (c,), (d,) = model.c[1:], model.d[1:]
    assert model.noise_response(4) == pytest.approx(
        [1.0, c - d, -d * (c - d), d**2 * (c - d)], rel=1e-12
    )
