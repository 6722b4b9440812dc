"""The least-squares searches against SciPy's, and how they step back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares, rosen

from fmus.kit.errors import UserError
from orchestration.identify import levenberg_marquardt, trust_region

SEARCHES = pytest.mark.parametrize("minimise", [levenberg_marquardt.minimise, trust_region.minimise])


@SEARCHES
def test_the_search_finds_what_scipy_finds(minimise):
    def rows(q):
        return np.array([10.0 * (q[1] - q[0] ** 2), 1.0 - q[0]])

    def slopes(q):
        return np.array([[-20.0 * q[0], 10.0], [-1.0, 0.0]])

    wide, start = np.array([5.0, 5.0]), np.array([-1.2, 1.0])
    found = minimise(rows, slopes, start, -wide, wide, 1e-14, 200)
    assert rosen(found.q) < 1e-12
    assert found.converged
    assert not minimise(rows, slopes, start, -wide, wide, 1e-14, 3).converged
    bound = np.array([0.5, 5.0])
    expected = least_squares(rows, [-1.2, 1.0], slopes, bounds=(-wide, bound)).x
    at_bound = minimise(rows, slopes, start, -wide, bound, 1e-14, 200).q
    assert at_bound == pytest.approx(expected, rel=1e-4)
    assert at_bound[0] == bound[0]  # not merely close


@SEARCHES
def test_the_search_steps_back_from_what_is_not_finite(minimise):
    def rows(q):
        return np.array([np.log(q[0]) - 1.0 if q[0] > 0.0 else np.inf])

    q = minimise(rows, lambda q: np.array([[1.0 / q[0]]]), np.array([9.0]), np.array([-1.0]), np.array([99.0])).q
    assert q == pytest.approx([np.e], rel=1e-3)


@SEARCHES
def test_the_search_steps_back_from_what_is_refused_but_does_not_start_there(minimise):
    def rows(q):
        if q[0] <= 0.0:
            raise UserError("no logarithm")
        return np.array([np.log(q[0]) - 1.0])

    ends = np.array([-1.0]), np.array([99.0])
    q = minimise(rows, lambda q: np.array([[1.0 / q[0]]]), np.array([9.0]), *ends).q
    assert q == pytest.approx([np.e], rel=1e-3)
    with pytest.raises(UserError, match="no logarithm"):
        minimise(rows, lambda q: np.array([[1.0 / q[0]]]), np.array([-0.5]), *ends)


@SEARCHES
@pytest.mark.parametrize(("steepness", "start"), [(10.0, -10.0), (1000.0, -10.0)])
def test_a_search_goes_on_along_a_narrow_valley(minimise, steepness, start):
    """Rosenbrock's function: it has one minimum, and dozens of steps lead there."""

    def rows(q):
        return np.array([steepness * (q[1] - q[0] ** 2), 1.0 - q[0]])

    def slopes(q):
        return np.array([[-2.0 * steepness * q[0], steepness], [-1.0, 0.0]])

    wide = np.full(2, 1e9)
    found = minimise(rows, slopes, np.array([start, 1.0]), -wide, wide, 1e-12)
    assert found.converged
    assert found.q == pytest.approx([1.0, 1.0], rel=1e-4)
