"""Claims: an effect of a term adds its function to its law, and nothing where it is neutral."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fmus.kit import Component, Input, Output, Parameter, UserError, stack
from fmus.kit.law_terms import LawTerm, check_term, law_term_effect
from tests.support.oscillator_model import Oscillator

DRY = LawTerm("friction", "velocity", "dry", "none", "rubbing", "N", "m/s", scale=0.5)
# of the friction, by spring force and itself: one sees the other without its term
BY_LAW = LawTerm(
    "friction", "spring_force", "square", "none", "grip", "1/N", "N", 2.0, factor="friction"
)
OF_SPRING = LawTerm("spring_force", "friction", "linear", "none", "soft", "1", "N", 1.0)


def state_of(cls, **values):
    """Return an instance that moves."""
    one = cls(**values)
    one.elongation = 0.2
    one.velocity = 0.3
    return one


def with_terms(*terms):
    """Return the oscillator with effects of terms."""
    return stack(Oscillator, *(law_term_effect(Oscillator, t.law, t) for t in terms))


def test_a_neutral_term_leaves_every_law_its_bits():
    cls = with_terms(DRY, BY_LAW, OF_SPRING)
    assert state_of(cls).rates() == state_of(Oscillator).rates()
    assert all(law_term_effect(Oscillator, t.law, t).neutral == t.stem for t in (DRY, BY_LAW))


def test_a_term_adds_its_function():
    one = state_of(with_terms(DRY), rubbing=1.5, rubbing_width=0.2)
    assert one.friction() == pytest.approx(0.8 * 0.3 + 1.5 * math.tanh(0.3 / 0.2))


def test_a_law_as_signal_has_its_value_without_terms():
    one = state_of(with_terms(BY_LAW, OF_SPRING), grip=0.1, soft=2.0)
    friction, spring = 0.8 * 0.3, 20.0 * 0.2
    assert one.friction() == pytest.approx(friction + 0.1 * spring**2 * friction)
    assert one.spring_force() == pytest.approx(spring + 2.0 * friction)


def test_a_curve_is_flat_beyond_its_ends():
    term = LawTerm(
        "friction", "velocity", "curve", "none", "bend", "N", "m/s", places=(-1.0, 0.0, 1.0)
    )
    one = with_terms(term)(bend=1.0, bend_at_0=-2.0, bend_at_1=0.5, bend_at_2=3.0)
    added = []
    for velocity in (-5.0, -1.0, 0.0, 1.0, 9.0):
        one.velocity = velocity
        added.append(one.friction() - 0.8 * velocity)
    assert added == pytest.approx([-2.0, -2.0, 0.5, 3.0, 3.0])


def test_a_curve_shows_its_signal_with_the_range_in_which_it_was_identified():
    places = (-1.0, 0.0, 1.0)
    term = LawTerm("friction", "spring_force", "curve", "none", "bend", "N", "N", places=places)
    assert not hasattr(with_terms(term), "bend_signal"), "of an FMU without a range"
    term = replace(term, range=(-1.5, 1.25))
    one = state_of(with_terms(term), bend=1.0)
    (output,) = (o for o in one.layout.outputs if o.name == "bend_signal")
    assert (output.min, output.max, output.unit) == (-1.5, 1.25, "N")
    assert one.bend_signal() == pytest.approx(20.0 * 0.2)
    assert not output.measured, "no instrument shows it"


def test_a_curve_that_is_a_parabola_in_its_middle_is_one_there():
    places = tuple(0.5 * k - 1.0 for k in range(5))
    term = LawTerm("friction", "velocity", "curve", "none", "bend", "N", "m/s", places=places)
    values = {f"bend_at_{k}": place**2 for k, place in enumerate(places)}
    one = with_terms(term)(bend=1.0, **values)
    for velocity in (-0.4, -0.1, 0.3):
        one.velocity = velocity
        assert one.friction() - 0.8 * velocity == pytest.approx(velocity**2)


@pytest.mark.parametrize(
    "wrong",
    [
        {"law": "__init__"},
        {"signal": "__class__"},
        {"factor": "damping"},
        {"shape": "exec"},
        {"memory": "disk"},
        {"stem": "a-b"},
        {"scale": math.nan},
        {"size": 0.0},
        {"places": (math.inf,)},
        {"places": (0.0, 1.0)},
        {"shape": "curve"},
        {"shape": "curve", "places": (0.0, 1.0, 3.0)},
        {"shape": "curve", "places": (0.0, -1.0, -2.0)},
        {"period": -2.0},
    ],
)
def test_a_term_of_a_file_that_the_model_cannot_have_is_refused(wrong):
    laws = {"friction", "spring_force"}
    check_term(DRY, laws, laws | {"velocity"})
    check_term(replace(DRY, shape="curve", places=(-0.1, 0.0, 0.1)), laws, laws | {"velocity"})
    with pytest.raises(UserError, match=repr(wrong.get("stem", DRY.stem))):
        check_term(replace(DRY, **wrong), laws, laws | {"velocity"})


class Actuator(Component):
    """Strain of a charge, by a law that takes the charge."""

    name = "actuator"
    experiment = (1.0, 0.1)
    alpha = Parameter(2.0, "m/C", doc="strain over charge")
    charge = Input("C", doc="of the film")

    def strain(self, charge):
        """Of so much charge."""
        return self.alpha * charge

    @Output("m")
    def displacement(self):
        """Of the tip."""
        return self.strain(self.charge)


def test_a_law_with_arguments_grows_by_itself():
    growth = LawTerm("strain", "charge", "linear", "none", "growth", "1/C", "C", factor="strain")
    one = stack(Actuator, law_term_effect(Actuator, "strain", growth))(growth=0.5)
    one.charge = 3.0
    assert one.displacement() == pytest.approx(2.0 * 3.0 * (1.0 + 0.5 * 3.0))
