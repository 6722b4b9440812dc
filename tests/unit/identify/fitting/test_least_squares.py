"""The search for a least sum of squares: where it ends, and how it steps back."""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.errors import UserError
from orchestration.identify.fitting.least_squares import SearchEndedError, minimise


def valley(steepness):
    """Rosenbrock's function as two residuals, and their Jacobian; its only minimum is at (1, 1)."""

    def rows(q):
        return np.array([steepness * (q[1] - q[0] ** 2), 1.0 - q[0]])

    def slopes(q):
        return np.array([[-2.0 * steepness * q[0], steepness], [-1.0, 0.0]])

    return rows, slopes


@pytest.mark.parametrize(("steepness", "start"), [(10.0, -1.2), (10.0, -10.0), (1000.0, -10.0)])
def test_a_search_goes_on_along_a_narrow_valley(steepness, start):
    wide = np.full(2, 1e9)
    found = minimise(*valley(steepness), np.array([start, 1.0]), -wide, wide, 1e-12)
    assert found.converged
    assert found.q == pytest.approx([1.0, 1.0], rel=1e-4)


@pytest.mark.parametrize("origin", [0.5, -300.0])
def test_where_coordinates_have_their_origin_does_not_matter(origin):
    """As with the unit of a parameter that is searched in its logarithm."""
    rows, slopes = valley(10.0)
    begin, wide, ways = np.array([-1.25, 1.0]), np.full(2, 1e9), []
    for shift in (0.0, origin):
        way = []

        def shifted(q, shift=shift, way=way):
            way.append(q - shift)
            return rows(q - shift)

        minimise(
            shifted, lambda q, shift=shift: slopes(q - shift), begin + shift, -wide, wide, 1e-12
        )
        ways.append(way)
    assert len(ways[0]) == len(ways[1])
    assert np.array(ways[1]) == pytest.approx(np.array(ways[0]), abs=1e-6)


def test_it_leaves_a_bound_that_it_starts_at():
    low = np.array([-2.0, -5.0])
    found = minimise(*valley(10.0), low, low, np.full(2, 5.0), 1e-12)
    assert found.q == pytest.approx([1.0, 1.0], rel=1e-4)


def test_what_hardly_does_anything_stays_about_where_it_is():
    """Take no steps along what changes nothing but rounding errors.

    A step of one is a large one.
    """
    slope = np.array([[1.0, 1e-9], [0.0, 0.0]])
    found = minimise(
        lambda q: slope @ q - [3.0, 1.0],
        lambda q: slope,
        np.zeros(2),
        np.full(2, -1e9),
        np.full(2, 1e9),
    )
    assert found.q == pytest.approx([3.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("rows", [2_048, 5_000])
def test_many_rows_have_the_solution_of_linear_least_squares(rows):
    """They are decomposed block by block, the last of which may be short."""
    random = np.random.default_rng(6)
    slope = random.standard_normal((rows, 3)) * np.linspace(0.1, 3.0, rows)[:, np.newaxis]
    values = random.standard_normal(rows)
    wide = np.full(3, 1e9)
    found = minimise(lambda q: values + slope @ q, lambda q: slope, np.zeros(3), -wide, wide, 1e-12)
    assert found.q == pytest.approx(np.linalg.lstsq(slope, -values)[0], abs=1e-7)


def test_there_is_nothing_to_search_where_it_starts_without_error():
    rows, slopes = valley(10.0)
    assert minimise(rows, slopes, np.ones(2), -np.ones(2), 2.0 * np.ones(2))[:2] == (
        pytest.approx(np.ones(2)),
        True,
    )


def test_a_search_that_used_up_its_trials_has_not_converged():
    wide = np.full(2, 5.0)
    assert not minimise(
        *valley(10.0), np.array([-1.2, 1.0]), -wide, wide, 1e-14, trials=3
    ).converged


def test_what_another_step_promises_is_the_rest_of_the_fall_where_residuals_are_linear():
    random = np.random.default_rng(4)
    table = random.standard_normal((30, 3))
    target = random.standard_normal(30)
    wide = np.full(3, 1e9)
    far = np.full(3, 50.0)
    begun = minimise(
        lambda q: table @ q - target, lambda q: table, far, -wide, wide, 1e-9, trials=2
    )
    least = np.linalg.lstsq(table, target)[1][0]
    cost = float(np.sum((table @ begun.q - target) ** 2))
    assert not begun.converged
    assert cost > 2.0 * least
    assert begun.promised == pytest.approx(cost - least, rel=1e-6)


def test_a_bound_is_kept_and_reached():
    found = minimise(
        *valley(10.0), np.array([-1.2, 1.0]), np.full(2, -5.0), np.array([0.5, 5.0]), 1e-14
    )
    assert found.q == pytest.approx([0.5, 0.25], rel=1e-4)
    assert found.q[0] == 0.5  # not merely close


def test_a_coordinate_between_equal_bounds_stays():
    end = np.array([0.5, -1.0])
    found = minimise(*valley(10.0), np.array([0.5, 3.0]), end, np.array([0.5, 5.0]), 1e-14)
    assert found.q == pytest.approx([0.5, 0.25], rel=1e-4)
    assert minimise(*valley(10.0), np.array([9.0, 9.0]), end, end)[:2] == (pytest.approx(end), True)


def test_the_search_steps_back_from_what_is_not_finite():
    def rows(q):
        return np.array([np.log(q[0]) - 1.0 if q[0] > 0.0 else np.inf])

    q = minimise(
        rows,
        lambda q: np.array([[1.0 / q[0]]]),
        np.array([9.0]),
        np.array([-1.0]),
        np.array([99.0]),
    ).q
    assert q == pytest.approx([np.e], rel=1e-3)


def test_the_search_steps_back_from_what_is_refused_but_does_not_start_there():
    def rows(q):
        if q[0] <= 0.0:
            raise UserError("no logarithm")
        return np.array([np.log(q[0]) - 1.0])

    ends = np.array([-1.0]), np.array([99.0])
    q = minimise(rows, lambda q: np.array([[1.0 / q[0]]]), np.array([9.0]), *ends).q
    assert q == pytest.approx([np.e], rel=1e-3)
    with pytest.raises(UserError, match="no logarithm"):
        minimise(rows, lambda q: np.array([[1.0 / q[0]]]), np.array([-0.5]), *ends)


@pytest.mark.parametrize("start", [1.0, 9.0])
def test_the_start_is_a_point_even_if_all_others_are_refused(start):
    asked = []

    def rows(q):
        asked.append(q.copy())
        if len(asked) > 1:
            raise UserError("there is no time left")
        return q - 3.0

    found = minimise(
        rows, lambda q: np.eye(1), np.array([start]), np.array([-9.0]), np.array([9.0])
    )
    assert found.q == pytest.approx([start])
    assert not found.converged


def test_a_search_that_starts_at_what_is_not_finite_is_refused():
    with pytest.raises(UserError, match="not finite"):
        minimise(
            lambda q: np.array([np.nan]), lambda q: np.eye(1), np.zeros(1), -np.ones(1), np.ones(1)
        )


@pytest.mark.parametrize("start", [np.inf, -np.inf, np.nan])
def test_a_start_that_is_not_finite_is_refused(start):
    low, high = np.full(1, -np.inf), np.full(1, np.inf)
    with pytest.raises(UserError, match="starts at a point that is not finite"):
        minimise(lambda q: q, lambda q: np.eye(1), np.array([start]), low, high)


def test_a_search_that_is_ended_keeps_its_best_point():
    asked = []

    def rows(q):
        asked.append(q.copy())
        if len(asked) > 6:
            raise SearchEndedError("there is no time left")
        return valley(10.0)[0](q)

    wide = np.full(2, 1e9)
    found = minimise(rows, valley(10.0)[1], np.array([-1.2, 1.0]), -wide, wide, 1e-12)
    costs = [float((valley(10.0)[0](q) ** 2).sum()) for q in asked[:6]]
    assert not found.converged
    assert found.q == pytest.approx(asked[int(np.argmin(costs))])


def test_slopes_are_asked_for_once_at_a_point():
    """They may be differences, each of a simulation of its own."""
    asked = []

    def slopes(q):
        asked.append(q.tobytes())
        return np.array([[1.0, 0.0], [0.0, 2.0 * q[1]], [1.0, 1.0]])

    found = minimise(
        lambda q: np.array([q[0] - 1.0, q[1] ** 2 - 4.0, q.sum() - 3.0]),
        slopes,
        np.array([5.0, 5.0]),
        np.full(2, -10.0),
        np.full(2, 10.0),
    )
    assert found.q == pytest.approx([1.0, 2.0], abs=1e-3)
    assert (
        len(asked) <= len(set(asked)) + 1
    )  # the best point once more if a search begins anew there


def test_a_search_that_starts_where_a_slope_is_not_finite_is_refused():
    with pytest.raises(UserError, match="derivatives are not finite"):
        minimise(
            lambda q: q,
            lambda q: np.full((1, 1), np.inf),
            np.ones(1),
            -np.ones(1),
            2.0 * np.ones(1),
        )


@pytest.mark.parametrize("size", [1e160, 1e300])
def test_what_runs_away_where_a_search_starts_leaves_it_there(size):
    """Its square is no number, so that no way down is known; nothing warns, and nothing ends."""
    found = minimise(
        lambda q: size * (q + 1.0), lambda q: size * np.eye(2), np.ones(2), -np.ones(2), np.ones(2)
    )
    assert not found.converged
    assert found.q == pytest.approx([1.0, 1.0])


def test_where_derivatives_are_no_numbers_a_search_ends_at_the_best():
    def slopes(q):
        return np.array([[1.0 if q[0] > 2.5 else np.nan]])

    found = minimise(lambda q: q - 1.0, slopes, np.array([3.0]), np.zeros(1), np.full(1, 9.0))
    assert not found.converged
    assert 1.0 <= found.q[0] < 3.0
