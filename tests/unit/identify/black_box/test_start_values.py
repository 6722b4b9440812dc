"""Claims: of data without noise the start values are the system; an autoregression whitens."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.identify.black_box.orders import Orders
from orchestration.identify.black_box.prediction_error import PredictionError
from orchestration.identify.black_box.start_values import (
    denominators,
    hannan_rissanen,
    innovations,
    noise_numerator,
)
from tests.support.black_box import response

U = np.random.default_rng(1).standard_normal((3000, 2))


def test_paths_with_denominators_of_their_own_begin_at_the_system():
    y = response([0.0, 0.5, 0.2], [1.0, -1.5, 0.7], U[:, 0])
    y = y + response([0.0, 0.0, 1.0, -0.3], [1.0, -0.9], U[:, 1]) + 3.0
    problem = PredictionError(U, y, Orders(0, (2, 2), 0, 0, (2, 1), (1, 2)))
    for first, second in denominators(problem):
        assert first == pytest.approx([1.0, -1.5, 0.7], abs=0.01)
        assert second == pytest.approx([1.0, -0.9], abs=0.01)


def test_the_numerator_of_the_noise_begins_near_that_of_the_system():
    e = 0.2 * np.random.default_rng(2).standard_normal(len(U))
    y = response([0.0, 0.8, 0.3], [1.0, -1.2, 0.5], U[:, 0])
    y = y + response([1.0, 0.7], [1.0, -1.2, 0.5], e)
    problem = PredictionError(U[:, :1], y, Orders(2, (2,), 1, 0, (0,), (1,)))
    assert noise_numerator(problem) == pytest.approx([1.0, 0.7], abs=0.1)


def test_a_noise_model_begins_near_that_of_the_noise():
    e = np.random.default_rng(3).standard_normal(4000)
    c, d = hannan_rissanen(response([1.0, 0.4], [1.0, -0.8], e), 1, 1)
    assert c == pytest.approx([1.0, 0.4], abs=0.06)
    assert d == pytest.approx([1.0, -0.8], abs=0.04)


def test_innovations_of_a_long_autoregression_are_the_noise_behind_it():
    e = np.random.default_rng(3).standard_normal(4000)
    found = innovations(response([1.0], [1.0, -0.8], e), 1)
    assert found[50:] == pytest.approx(e[50:], abs=0.3)
    assert np.std(found[50:] - e[50:]) < 0.1
