"""Claims: a curve adds to a law what its formula says.

Oracle: equations of motion with the missing term, integrated by SciPy.
"""

from __future__ import annotations

import re

import numpy as np
import pint
import pytest

from fmus.kit import UserError
from fmus.kit.curves import SHAPES, EffectNames, curve, per
from fmus.kit.effects import effect_name
from tests.support.pushed_mass import DAMPER, LITTLE, MASS, SPRING, A, W, follows, static

BY_HAND = {
    "linear": lambda x: x,
    "asymmetric": lambda x: abs(x),
    "quadratic": lambda x: x**2,
    "odd_quadratic": lambda x: x * abs(x),
    "cubic": lambda x: x**3,
    "quartic": lambda x: x**4,
    "saturating": lambda x: np.tanh(x / W),
    "sign": lambda x: np.tanh(x / W),
    "sign_beyond": lambda x: (
        1.0 / (1.0 + np.exp(-20.0 * (x / W - 1.0))) - 1.0 / (1.0 + np.exp(20.0 * (x / W + 1.0)))
    ),
    "levelling": lambda x: x - W * np.tanh(x / W),
    "exponential": lambda x: np.expm1(x / W),
    "square_root": lambda x: np.sign(x) * np.sqrt(abs(x)),
    "stribeck": lambda x: np.tanh(10 * x / W) * np.exp(-((x / W) ** 2)),
    "stops": lambda x: max(abs(x) - W, 0.0) * np.sign(x),
    "weir": lambda x: max(x - W, 0.0) ** 1.5,
    "upper_stop": lambda x: max(x - W, 0.0),
    "lower_stop": lambda x: min(x + W, 0.0),
}
assert BY_HAND.keys() == SHAPES.keys()


@pytest.mark.parametrize("shape", sorted(SHAPES))
@pytest.mark.parametrize("law", [SPRING, DAMPER])
def test_a_curve_in_a_law_is_what_its_formula_says(law, shape):
    effect = curve(MASS, *law, shape, "N")
    amount = A if law is SPRING or shape in ("stribeck", "weir") else LITTLE * A
    if shape == "quartic" and law is DAMPER:  # which drives the mass backwards
        amount *= 0.2
    values = {f"{law[0]}_{shape}": amount} | (
        {f"{law[0]}_{shape}_width": W} if SHAPES[shape].width else {}
    )
    nominal = next(s.nominal for s in MASS.layout.states if s.name == law[1])
    size = amount * {"square_root": nominal**0.5, "weir": nominal**-0.5}.get(
        shape, 1.0
    )  # for whole powers of units
    follows(effect, values, static(lambda x: size * BY_HAND[shape](x), 0 if law is SPRING else 1))


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_what_a_curve_is_said_to_add_somewhere_it_adds_there(shape):
    effect = curve(MASS, *SPRING, shape, "N", scale=0.123)
    amount, *bends = effect.sizes
    assert amount.parameters == (effect.neutral,)
    if amount.unit:
        place, unit = re.fullmatch(r"{} more at ([\d.]+) (\w+)", amount.phrase).groups()
        nominal = next(s.nominal for s in MASS.layout.states if s.name == SPRING[1])
        root = nominal**0.5 if shape == "square_root" else 1.0
        assert amount.quantity(A) == pytest.approx(
            A * root * BY_HAND[shape](float(place)), rel=1e-5
        )
        assert (float(place), unit, amount.unit) == (0.12, "m", "N")
    assert [bend.phrase for bend in bends] == [SHAPES[shape].bend] * bool(SHAPES[shape].bend)
    if "sets in" in SHAPES[shape].bend:
        (bend,) = bends
        place = bend.quantity(W)
        assert abs(BY_HAND[shape](0.5 * place)) < 0.1 * abs(BY_HAND[shape](2.0 * place))


def test_mistakes_are_told_in_one_line():
    with pytest.raises(UserError, match=r"no shape named 'cubik' \(did you mean cubic"):
        curve(MASS, *SPRING, "cubik")
    with pytest.raises(UserError, match="no law named 'spring'"):
        curve(MASS, "spring", "elongation", "cubic")
    with pytest.raises(UserError, match="mass_spring_damper: no input or state named 'stretch'"):
        curve(MASS, "spring_force", "stretch", "cubic")


def test_an_effect_has_the_names_that_are_given():
    names = EffectNames("hardening", ("stiffening",), "spring")
    effect = curve(MASS, *SPRING, "saturating", "N", 10.0, names=names)
    assert effect_name(effect) == "hardening(spring)"
    assert list(effect.declared) == ["stiffening", "spring_force_saturating_width"]
    assert effect.neutral == "stiffening"
    assert list(curve(MASS, *SPRING, "cubic").declared) == ["spring_force_cubic"]


@pytest.mark.parametrize(
    ("unit", "below", "power", "written"),
    [
        ("V", "A", 1, "ohm"),
        ("C", "V", 1, "F"),
        ("V", "A", 2, "V/A^2"),
        ("N*s/m", "m", 1, "(N*s/m)/m"),
        ("N", "1", 1, "N"),
    ],
)
def test_a_quotient_with_a_name_has_it(unit, below, power, written):
    """pint is the oracle for what it measures."""
    one = pint.UnitRegistry()
    assert per(unit, below, power) == written
    assert one.Quantity(1.0, written) == one.Quantity(1.0, unit) / one.Quantity(1.0, below) ** power
