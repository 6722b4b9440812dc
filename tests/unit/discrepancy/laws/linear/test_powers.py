"""With which power laws hang on a parameter. Oracle: laws written down here, and how a power keeps
its sign.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus.kit import Component, Input, Output, Parameter, State
from fmus.kit.functions import exp
from fmus.kit.symbolic.perturbed import PerturbedLaws
from orchestration.discrepancy.laws.linear.powers import LEAST, MOST, affine_powers, moved, reach
from orchestration.discrepancy.laws.linear.response import SimulatedCourse


class Wall(Component):
    name = "wall"
    heat = Input("W")
    conductance = Parameter(2.0, "W/K")
    resistance = Parameter(3.0, "K/W")
    capacity = Parameter(5.0, "J/K")
    bend = Parameter(0.2, "1")
    unused = Parameter(1.0, "1")
    warmth = State("K", rate="warming", start=1.0)
    seen = Output("K")

    def loss(self):
        return self.conductance * self.warmth + self.warmth / self.resistance

    def glow(self):
        return self.bend * self.bend * exp(self.warmth)

    def warming(self):
        return (self.heat - self.loss() - self.glow()) / self.capacity


VALUES = {"conductance": 2.0, "resistance": 3.0, "capacity": 5.0, "bend": 0.2, "unused": 1.0}
TIME = np.linspace(0.0, 10.0, 501)


def test_powers_are_those_that_are_written():
    course = SimulatedCourse.of(
        TIME, {"heat": np.sin(TIME)}, {"warmth": 1.0 + 0.3 * np.cos(TIME)}, True
    )
    names = ["conductance", "resistance", "capacity", "bend", "unused", "warmth_start"]
    found = affine_powers(PerturbedLaws(Wall), course, VALUES | {"warmth_start": 1.0}, names)
    assert found == pytest.approx([1.0, -1.0, -1.0, 2.0, 1.0, 1.0], abs=0.01)


@pytest.mark.parametrize("power", [1.0, -1.0, 2.0, -0.5])
def test_a_step_goes_where_the_power_goes(power):
    """To first order p^n changes by n times the relative change of p; that much it changes in the
    end.
    """
    least, most = reach(np.array([power]))
    for step in np.linspace(least[0], most[0], 7):
        q = moved(np.array([step]), np.array([power]), np.array([True]))
        assert np.exp(power * q[0]) == pytest.approx(1.0 + power * step)
    assert sorted(power * np.array([least[0], most[0]])) == pytest.approx([LEAST, MOST])


def test_what_is_no_logarithm_moves_by_its_size_at_most():
    steps = np.array([-3.0, 0.4])
    assert moved(steps, np.ones(2), np.zeros(2, dtype=bool)) == pytest.approx([-1.0, 0.4])
