"""Claims: of data without noise the start values are the system; an autoregression whitens."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.prediction_error import PredictionError
from orchestration.identify.black_box.start_values import innovations, starts
from tests.support.black_box import response

U = np.random.default_rng(1).standard_normal((3000, 2))


def test_paths_with_denominators_of_their_own_begin_at_the_system():
    y = response([0.0, 0.5, 0.2], [1.0, -1.5, 0.7], U[:, 0])
    y = y + response([0.0, 0.0, 1.0, -0.3], [1.0, -0.9], U[:, 1]) + 3.0
    problem = PredictionError(U, y, Orders(0, (2, 2), 0, 0, (2, 1), (1, 2)))
    steiglitz_mcbride, instruments, once = map(problem.coefficients, starts(problem))
    for parts in (steiglitz_mcbride, instruments, once):
        assert parts.f[0] == pytest.approx([1.0, -1.5, 0.7], abs=0.01)
        assert parts.f[1] == pytest.approx([1.0, -0.9], abs=0.01)
        assert parts.b[0] == pytest.approx([0.5, 0.2], abs=0.02)
        assert parts.b[1] == pytest.approx([1.0, -0.3], abs=0.02)
    assert steiglitz_mcbride.offset == pytest.approx(3.0, abs=0.05)


def test_a_shared_denominator_and_the_colour_of_the_noise_begin_near_the_system():
    e = 0.2 * np.random.default_rng(2).standard_normal(len(U))
    y = response([0.0, 0.8, 0.3], [1.0, -1.2, 0.5], U[:, 0])
    y = y + response([1.0, 0.7], [1.0, -1.2, 0.5], e)
    problem = PredictionError(U[:, :1], y, Orders(2, (2,), 1, 0, (0,), (1,)))
    extended, plain = map(problem.coefficients, starts(problem))
    assert extended.a == pytest.approx([1.0, -1.2, 0.5], abs=0.03)
    assert extended.b[0] == pytest.approx([0.8, 0.3], abs=0.03)
    assert extended.c == pytest.approx([1.0, 0.7], abs=0.1)
    assert np.abs(plain.a - extended.a).max() > 1e-4
    assert all(problem.admissible(theta) for theta in starts(problem))


def test_innovations_of_a_long_autoregression_are_the_noise_behind_it():
    e = np.random.default_rng(3).standard_normal(4000)
    found = innovations(response([1.0], [1.0, -0.8], e), 1)
    assert found[50:] == pytest.approx(e[50:], abs=0.3)
    assert np.std(found[50:] - e[50:]) < 0.1
