"""Claims: a curve that is a shape is told to be that one, with the amount and the width that it
has.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit.curves import SHAPES
from orchestration.discrepancy.laws.evidence import Basis, Curve
from orchestration.discrepancy.laws.shapes import likenesses, shape_name, zero_of

BASIS = Basis(np.linspace(-2.0, 2.0, 21))
FORMS = {
    "linear": lambda x: x,
    "asymmetric": abs,
    "quadratic": lambda x: x * x,
    "odd_quadratic": lambda x: x * abs(x),
    "cubic": lambda x: x**3,
    "quartic": lambda x: x**4,
    "saturating": lambda x: np.tanh(x / 0.6),
    "sign": lambda x: np.sign(x) * min(abs(x) / 0.05, 1.0),
    "sign_beyond": lambda x: np.sign(x) * float(abs(x) > 0.9),
    "levelling": lambda x: x - 0.7 * np.tanh(x / 0.7),
    "exponential": lambda x: np.exp(x / 0.9) - 1.0,
    "stops": lambda x: x - np.clip(x, -0.8, 0.8),
    "upper_stop": lambda x: max(x - 0.8, 0.0),
    "lower_stop": lambda x: min(x + 0.8, 0.0),
}


def known(values, share=0.01):
    """A curve of which everything is known to about a hundredth."""
    size = share * np.abs(values).max()
    return Curve(
        100.0, values, size**2 * np.eye(len(values)), (100.0 * size) ** 2 * np.eye(len(values)), 0.0
    )


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize("amount", [0.003, 700.0])
def test_a_shape_is_named(name, amount):
    values = amount * np.array([FORMS[name](x) for x in BASIS.knots])
    found = likenesses(BASIS, known(values), 1.0)
    near = [one.shape for one in found[:3]]
    assert name in near
    one = next(one for one in found if one.shape == name)
    if not SHAPES[name].width:
        assert one.amount == pytest.approx(amount, rel=0.02)


def test_a_curve_that_is_known_exactly_is_named_too():
    curve = known(BASIS.knots**2)
    exact = Curve(100.0, curve.values, 0.0 * curve.covariance, curve.prior, 0.0)
    assert likenesses(BASIS, exact, 1.0)[0].shape == "quadratic"


@pytest.mark.parametrize(("width", "name"), [(0.02, "sign"), (0.5, "saturating")])
def test_a_saturation_that_is_abrupt_is_a_step(width, name):
    assert shape_name("sign", width, 2.0) == shape_name("saturating", width, 2.0) == name


def test_all_shapes_are_told_the_nearest_first():
    found = likenesses(BASIS, known(BASIS.knots**3), 1.0)
    assert {one.shape for one in found} == set(SHAPES)
    assert [one.distance for one in found] == sorted(one.distance for one in found)
    assert found[0].shape == "cubic"


def test_what_the_model_can_do_itself_is_no_likeness():
    """Of a curve without a slope, because the model has one, a cubic is held against what it has
    beside a slope.
    """
    straight = np.column_stack([np.ones(21), BASIS.knots])
    free = np.eye(21) - straight @ np.linalg.pinv(straight)
    values = free @ BASIS.knots**3
    curve = Curve(100.0, values, 1e-4 * free, 100.0 * free, 0.0)
    best = likenesses(BASIS, curve, 1.0)[0]
    assert best.shape == "cubic"
    assert best.amount == pytest.approx(1.0, rel=0.02)


def test_a_covariance_that_rounding_has_made_singular_does_no_harm():
    values = BASIS.knots**2
    rank_one = np.outer(values, values)
    found = likenesses(
        BASIS, Curve(100.0, values, 1e-6 * rank_one, rank_one + 1e-9 * np.eye(21), 0.0), 1.0
    )
    assert found
    assert np.isfinite([one.distance for one in found]).all()


def test_what_is_all_the_models_own_looks_like_nothing():
    basis, nothing = Basis(np.linspace(0.0, 1.0, 5)), np.zeros((5, 5))
    assert likenesses(basis, Curve(0.0, np.zeros(5), nothing, nothing, 0.0), 1.0) == []


def test_a_constant_stands_beside_a_shape_where_the_curve_has_one():
    cube = BASIS.knots**3
    plain, raised = (
        likenesses(BASIS, known(values), 1.0)[0] for values in (3.0 * cube, 3.0 * cube + 6.0)
    )
    assert (plain.shape, plain.beside) == ("cubic", 0.0)
    assert raised.shape == "cubic"
    assert (raised.amount, raised.beside) == pytest.approx((3.0, 2.0), rel=0.02)


@pytest.mark.parametrize(
    ("low", "high", "zero"),
    [(273.0, 323.0, 298.0), (-2.0, 2.0, 0.0), (0.0, 5.0, 0.0), (8.0, 14.0, 0.0), (-55, -50, -52)],
)
def test_what_never_comes_near_nothing_is_counted_from_the_middle(low, high, zero):
    assert zero_of(Basis(np.linspace(low, high, 9))) == pytest.approx(zero, abs=0.6)


def test_an_exponential_over_an_absolute_temperature_is_one():
    basis = Basis(np.linspace(283.0, 323.0, 21))
    values = 0.4 * np.exp((basis.knots - 290.0) / 12.0)
    zero = zero_of(basis)
    best = likenesses(basis, known(values), 20.0, zero=zero)[0]
    assert best.shape == "exponential"
    assert best.width == pytest.approx(12.0, rel=0.5), (
        "one of a few widths, with which a fit begins"
    )
