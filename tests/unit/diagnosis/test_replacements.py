"""Claims: the shape that a law has is among the few that are proposed for one in its place."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from orchestration.diagnosis import Shape, Term, fit, nominal_point, weights_of
from orchestration.diagnosis.courses import Courses, courses_of
from orchestration.diagnosis.fitting import not_fitted
from orchestration.diagnosis.replacements import other_shapes, replacements
from orchestration.diagnosis.screening import Candidate, Screen
from tests.support.diagnosed_mass import START, D, K, M, integrated, problem_of, pushed

SIZE, SCALE = 2.0, 0.2  # N, m
CUBIC = 60.0  # N/m^3
SQUARE = Term("spring", "x", Shape.ODD_SQUARE, size=SIZE, scale=SCALE)


@cache
def along_square() -> Courses:
    """Return the courses of a spring with an odd square, fitted to one whose excess is cubic."""
    record = pushed(300, smooth=True)
    states = integrated(
        record,
        lambda x, u, t: [x[1], (u - K * x[0] - CUBIC * x[0] ** 3 - D * x[1]) / M],
        START,
        1e-7,
    )
    noise = 1e-4 * np.random.default_rng(0).standard_normal((300, 1))
    problem = problem_of([replace(record, outputs=states[:, :1] + noise)])
    start = nominal_point(problem, (SQUARE,))
    plain = not_fitted(problem, nominal_point(problem), [np.ones(1)])
    assert plain is not None
    fitted = fit(problem, (SQUARE,), [start], weights_of(plain.errors))
    assert fitted is not None
    along = courses_of(fitted, problem.records, fitted.point.starts)
    assert along is not None
    return along


def test_the_shape_of_the_law_is_proposed_with_its_size() -> None:
    proposed = {term.shape: values for term, values in replacements(along_square(), SQUARE)}
    assert len(proposed) <= 6
    explaining = proposed[Shape.CUBE][1]
    assert explaining == pytest.approx([CUBIC * SCALE**3 / SIZE], rel=0.2)


def test_a_start_is_nearest_to_the_function_that_was_fitted() -> None:
    along = along_square()
    (fitted,) = along.fitted.values_of(SQUARE)
    z = along.values["x"] / SCALE
    for term, (nearest, _) in replacements(along, SQUARE):
        if term.shape is Shape.CUBE:
            expected = fitted * np.sum(z**3 * z * np.abs(z)) / np.sum(z**6)
            assert nearest == pytest.approx([expected], rel=1e-6)


def test_a_term_in_its_own_place_has_its_own_coefficient() -> None:
    along = along_square()
    seen = along.values["x"]
    column = along.model.shape_values(SQUARE, seen)
    own = Candidate(SQUARE, column, np.full(len(seen), SIZE), 0.0)
    screen = Screen(along, [own], SQUARE)
    (coefficients,), _ = screen.solve([0])
    assert coefficients == pytest.approx(
        along.fitted.values_of(SQUARE), rel=0.1
    )  # starts have another prior


def test_a_product_has_no_other_shape_that_is_the_product_the_other_way() -> None:
    curve = Term("heating", "power", Shape.CURVE, factor="fan", places=(0.0, 1.0))
    assert Shape.LINEAR not in {term.shape for term in other_shapes(curve, 0.0, 1.0)}
    in_percent = replace(curve, factor="heating")
    assert Shape.LINEAR in {term.shape for term in other_shapes(in_percent, 0.0, 1.0)}


def test_a_term_becomes_a_curve_with_more_knots_over_the_range_of_its_signal() -> None:
    plain = Term("friction", "velocity", Shape.DRY)
    curves = [one for one in other_shapes(plain, -1.0, 3.0) if one.shape is Shape.CURVE]
    ends = [(one.places[0], one.places[-1], len(one.places)) for one in curves]
    assert sorted(ends) == [(-1.0, 3.0, 9), (-1.0, 3.0, 13)]
    finest = next(one for one in curves if len(one.places) == 13)
    assert Shape.CURVE not in {one.shape for one in other_shapes(finest, -1.0, 3.0)}
