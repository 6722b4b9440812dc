"""The least-squares search against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares, rosen

from orchestration.identify.levenberg_marquardt import minimise


def test_the_search_finds_what_scipy_finds():
    def rows(q):
        return np.array([10.0 * (q[1] - q[0] ** 2), 1.0 - q[0]])

    def slopes(q):
        return np.array([[-20.0 * q[0], 10.0], [-1.0, 0.0]])

    wide, start = np.array([5.0, 5.0]), np.array([-1.2, 1.0])
    assert rosen(minimise(rows, slopes, start, -wide, wide, 1e-14, 200)) < 1e-12
    bound = np.array([0.5, 5.0])
    expected = least_squares(rows, [-1.2, 1.0], slopes, bounds=(-wide, bound)).x
    assert minimise(rows, slopes, start, -wide, bound, 1e-14, 200) == pytest.approx(expected, rel=1e-4)


def test_the_search_steps_back_from_what_is_not_finite():
    def rows(q):
        return np.array([np.log(q[0]) - 1.0 if q[0] > 0.0 else np.inf])

    q = minimise(rows, lambda q: np.array([[1.0 / q[0]]]), np.array([9.0]), np.array([-1.0]), np.array([99.0]))
    assert q == pytest.approx([np.e], rel=1e-3)
