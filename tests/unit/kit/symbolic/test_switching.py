"""Claims: event indicators change their sign where laws switch and there only; they are of order
one, have no steps of rounding, and a place has one of them.
"""

import math

import casadi as ca
import numpy as np
import pytest

import fmus
from fmus.kit import (
    Component,
    Input,
    Output,
    Parameter,
    State,
    absolute,
    clip,
    floor,
    maximum,
    minimum,
    sqrt,
    stack,
    where,
)
from fmus.kit.sensors import transport_delay
from fmus.kit.symbolic import trace


def switching(law, unit="m", nominal=1e-3, **parameters):
    """A component whose only output is a law of its input ``x`` and of parameters."""

    def y(self):
        """The law."""
        return law(self)

    declared = {name: Parameter(value, unit, nominal=nominal) for name, value in parameters.items()}
    x = Input(unit, nominal=nominal, doc="what moves")
    body = {"name": "switching", "x": x, "y": Output(unit)(y)}
    return type("Switching", (Component,), body | declared)


def evaluated(cls, x, **parameters):
    """Indicators, shape (n, points), at values of the input."""
    graph = trace(cls)
    function = ca.Function("z", graph.arguments, [graph.indicators])
    points = [graph.point(x=float(each), **parameters) for each in x]
    return np.array([function(0.0, *point).full()[:, 0] for point in points]).T


def crossings(cls, x, **parameters):
    """Values of the input between which an indicator changes its sign."""
    z = evaluated(cls, x, **parameters)
    return sorted(float(x[k]) for row in z for k in np.flatnonzero(np.diff(np.sign(row))))


GRID = np.linspace(-5e-3, 5e-3, 1000)  # meets no place exactly


def test_a_limit_has_a_place_on_either_side():
    cls = switching(lambda m: clip(m.x, m.low, m.high), low=-1e-3, high=2e-3)
    assert crossings(cls, GRID) == pytest.approx([-1e-3, 2e-3], abs=1.1e-5)
    assert crossings(cls, GRID, low=-3e-3, high=1e-3) == pytest.approx([-3e-3, 1e-3], abs=1.1e-5)


def test_a_limit_that_moves_has_its_places_too():
    cls = switching(lambda m: minimum(maximum(m.x, m.low), m.x * m.x / m.high), low=1e-3, high=1e-3)
    # where x meets the lower limit, and where the larger of both meets the square
    assert crossings(cls, GRID) == pytest.approx([-1e-3, 1e-3, 1e-3], abs=1.1e-5)


def test_one_place_in_several_forms_has_one_indicator():
    cls = switching(
        lambda m: (
            absolute(m.x - m.p)
            + where(m.x > m.p, m.x, 2.0 * m.x)
            + maximum(2.0 * m.p, 2.0 * m.x)
            + maximum(m.p - m.x, 1e-16)
        ),
        p=1e-3,
    )
    assert evaluated(cls, GRID).shape == (1, 1000)


def test_of_places_near_to_each_other_none_is_lost():
    cls = switching(lambda m: absolute(m.x - m.p) + absolute(m.x - m.p - 1e-8), p=1e-3)
    assert evaluated(cls, GRID).shape == (2, 1000)


@pytest.mark.parametrize("nominal", [1e-9, 1e-3, 1.0, 1e6])
def test_an_indicator_is_of_order_one_and_its_factor_exact(nominal):
    cls = switching(
        lambda m: absolute(m.x) + clip(m.x, -m.p, m.p), nominal=nominal, p=0.5 * nominal
    )
    x = np.linspace(-1.0, 1.0, 200) * nominal
    z = evaluated(cls, x)
    assert z.shape == (3, 200)
    assert np.all(np.abs(z).max(axis=1) > 0.3)
    assert np.all(np.abs(z).max(axis=1) < 5.0)
    factors = z[0] / x
    assert math.frexp(factors[0])[0] == 0.5
    assert np.all(factors == factors[0])


def test_a_limit_that_stands_for_none_is_met_when_it_is_set():
    cls = switching(lambda m: minimum(m.x, m.limit), limit=1e12)
    z = evaluated(cls, [0.9e-3, 1.1e-3], limit=1e-3)
    assert z[0, 0] < -1e-8 < 1e-8 < z[0, 1]  # hosts see 1e-10


def test_rounding_makes_no_steps():
    """Of a converter of 16 counts between -1.6 and 1.5 mm: it is at its ends where the signal is,
    to half a count.
    """
    count = 2e-4
    cls = switching(lambda m: clip(m.q * floor(m.x / m.q + 0.5), -8.0 * m.q, 7.0 * m.q), q=count)
    assert crossings(cls, GRID) == pytest.approx([-8.0 * count, 7.0 * count], abs=1.1e-5)
    steps = np.abs(np.diff(evaluated(cls, GRID)))
    assert steps.max() < 1.01 * steps.min()


def test_a_number_that_stands_still_is_rounded():
    """As a number of periods in a time, which a signal is compared with."""
    cls = switching(lambda m: where(m.x > floor(m.p), 1.0, 0.0), unit="1", nominal=1.0, p=2.7)
    assert crossings(cls, np.linspace(-5.0, 5.0, 1000)) == pytest.approx([2.0], abs=0.011)


def test_what_parameters_decide_is_no_place():
    cls = switching(lambda m: where(m.p > 0.0, m.x, 0.0) + absolute(m.p), p=1e-3)
    assert evaluated(cls, GRID).size == 0


class Domain(Component):
    """A root beside a switch: no number at half of the points."""

    name = "domain"

    x = State("1", rate="falling", doc="falls")

    def falling(self):
        return -(maximum(self.x, 0.25) ** 0.5) + absolute((self.x - 0.25) ** 0.5 - 0.5)


def test_where_an_expression_is_no_number_others_count():
    graph = trace(Domain)
    z = ca.Function("z", graph.arguments, [graph.indicators])(0.0, *graph.point(x=0.75)).full()
    assert z.shape == (2, 1)
    assert np.all((np.abs(z) > 0.1) & (np.abs(z) < 10.0))


def test_a_place_without_a_number_where_values_are_typical_is_kept():
    """It lies far away, where its root exists; near by it is like no other place."""
    cls = switching(
        lambda m: maximum(m.x, m.low) + minimum(sqrt(m.x - m.far), m.high),
        low=1e-3,
        far=10.0,
        high=2.0,
    )
    assert evaluated(cls, [11.0]).shape == (2, 1)
    assert crossings(cls, np.linspace(10.0, 20.0, 1000)) == pytest.approx([14.0], abs=0.011)


def test_a_delay_has_an_indicator_for_each_place_of_its_register():
    """And five more: for its ends, the latest sample and what was before the start."""
    cls = fmus.component("ppy_actuator")
    own = trace(cls).indicators.numel()
    delayed = trace(stack(cls, transport_delay(cls, "voltage"))).indicators.numel()
    assert delayed - own == 64 + 5
