"""Claims: a term says how many values it has, and which part of them is searched in logarithms."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.diagnosis import Shape, Term
from orchestration.diagnosis.terms import FORMS, MEMORIES, Memory
from tests.support.diagnosed_mass import mass

NARROW = {Shape.CONSTANT, Shape.LINEAR, Shape.MODULUS, Shape.SQUARE, Shape.ODD_SQUARE}
NARROW |= {Shape.CUBE, Shape.ROOT, Shape.CURVE}


def test_shapes_of_a_width_search_its_logarithm() -> None:
    for shape in Shape:
        term = Term("spring", "x", shape, width=0.3)
        expected = [] if shape in NARROW else [np.log(0.3)]
        assert term.start == pytest.approx(expected), shape


def test_constants_of_a_memory_come_before_the_width() -> None:
    term = Term("spring", "x", Shape.DRY, Memory.TWO_LAGS, (2.0, 3.0), width=0.3)
    assert np.exp(term.start) == pytest.approx([2.0, 3.0, 0.3])
    assert term.freedom == 4


def test_a_curve_has_a_coefficient_at_each_knot_and_shares_a_constant_with_its_law() -> None:
    term = Term("spring", "x", Shape.CURVE, places=(-1.0, 0.0, 2.0))
    assert (term.coefficients, term.freedom) == (3, 2)


def test_a_curve_with_more_knots_has_no_more_freedom_than_a_smooth_one() -> None:
    curves = [
        Term("f", "v", Shape.CURVE, places=tuple(np.linspace(0.0, 1.0, k))) for k in (5, 9, 13)
    ]
    assert [one.freedom for one in curves] == [4, 8, 8]
    assert [one.coefficients for one in curves] == [5, 9, 13]


def test_constants_of_memories() -> None:
    expected = {Memory.NONE: 0, Memory.INTEGRAL: 0, Memory.THROUGHPUT: 0}
    expected |= {Memory.TWO_LAGS: 2, Memory.RATE_LIMIT: 2}
    assert {m: m.constants for m in Memory} == {m: expected.get(m, 1) for m in Memory}


def test_terms_of_one_source_differ_by_shape_and_constants_alone() -> None:
    one = Term("spring", "x", Shape.CUBE, Memory.LAG, (1.0,))
    assert one.source == Term("spring", "x", Shape.DRY, Memory.LAG, (2.0,)).source
    for other in (
        Term("friction", "x", Shape.CUBE, Memory.LAG, (1.0,)),
        Term("spring", "v", Shape.CUBE, Memory.LAG, (1.0,)),
        Term("spring", "x", Shape.CUBE, Memory.PLAY, (1.0,)),
        Term("spring", "x", Shape.CUBE, Memory.LAG, (1.0,), factor="spring"),
    ):
        assert one.source != other.source


def test_names_become_positions() -> None:
    model = mass()
    term = Term("spring", "v", Shape.CURVE, factor="force", places=(1.0, 2.0))
    made = term.structure(model.laws, model.signals)
    assert model.laws[made.law] == "spring"
    assert model.signals[made.signal] == "v"
    assert model.signals[made.factor] == "force"
    assert made.knots == 2
    assert list(made.places)[:3] == [1.0, 2.0, 0.0]
    plain = Term("spring", "", Shape.CONSTANT).structure(model.laws, model.signals)
    assert plain.factor == -1


def test_a_term_prints_as_a_sum() -> None:
    term = Term("spring", "x", Shape.CUBE, Memory.LAG, (0.25,), factor="spring")
    assert str(term) == "spring += cube(lag of x [0.25]) * spring"


def test_every_shape_and_memory_has_a_row() -> None:
    assert set(FORMS) == set(Shape)
    assert set(MEMORIES) == set(Memory)
    for shape, form in FORMS.items():
        assert ("{w}" in form.source) is shape.has_width, shape
