"""Claims: an arm adds a memory to a law, which begins in equilibrium.

Oracle: equations of motion with the missing term, integrated by SciPy.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from fmus.kit import Component, Input, Output, Parameter, State, UserError, stack
from fmus.kit.arms import lag_effect, storing_wall
from fmus.kit.curves import EffectNames
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.sampling import Sampling
from tests.support.pushed_mass import ARM_CASES, MASS, SPRING, Tank, follows


@pytest.mark.parametrize("name", sorted(ARM_CASES))
def test_an_arm_in_a_law_is_what_its_formula_says(name):
    follows(*ARM_CASES[name])


@pytest.mark.parametrize("kind", ["lagging", "leading", "play"])
def test_what_remembers_a_state_begins_in_equilibrium_with_it(kind):
    """The level stands at a metre; a memory that began at zero would let a settled part flow."""
    steady = {"inflow": np.full(50, 0.1)}
    remembering = stack(Tank, lag_effect(Tank, "outflow", "level", kind, 5.0, "m^3/s"))
    values = {f"outflow_{kind}": 0.01 if kind != "lagging" else 0.02, "level_start": 1.0}
    values |= {"outlet": 0.08} if kind == "lagging" else {}  # what is remembered flows, too
    found = CompiledModel(remembering).run(np.arange(50.0), steady, values).signals["height"]
    assert found == pytest.approx(np.ones(50), abs=1e-9)


def test_mistakes_are_told_in_one_line():
    with pytest.raises(UserError, match="no arm named 'laging'"):
        lag_effect(MASS, *SPRING, "laging", 1.0)
    with pytest.raises(UserError, match="hysteresis is over a state, which 'force' is not"):
        lag_effect(MASS, "spring_force", "force", "hysteresis", 1.0)


@pytest.mark.parametrize(
    ("sampling", "at_once"), [(None, 0.01), (Sampling(25e-6, 0.05), 25e-6), (Sampling(60.0), 0.6)]
)
def test_a_play_is_followed_at_once_on_the_clock_of_its_record(sampling, at_once):
    effect = lag_effect(MASS, *SPRING, "play", 0.1, sampling=sampling)
    model = stack(MASS, effect)()
    model.elongation = 0.5
    assert model.spring_force_play_state_rate() == pytest.approx((0.5 - 0.1) / at_once)


def test_variables_are_named_after_the_law_and_the_effect():
    effect = lag_effect(MASS, *SPRING, "leading", 1.0, names=EffectNames("maxwell"))
    own = "spring_force_maxwell"
    assert list(effect.declared) == [own, f"{own}_constant", f"{own}_state"]
    assert effect.neutral == own


class Room(Component):
    """A room that a heater warms and that loses heat to the outside."""

    name = "room"
    loss = Parameter(50.0, "W/K")
    capacity = Parameter(4e6, "J/K")
    outdoor = Input("K")
    heating = Input("W")
    inside = State("K", rate="warming", start=290.0)

    def flow(self):
        """Heat to the outside."""
        return self.loss * (self.inside - self.outdoor)

    def warming(self):
        """Balance."""
        return (self.heating - self.flow()) / self.capacity

    @Output("K")
    def shown(self):
        """As measured."""
        return self.inside


def test_a_wall_is_two_resistances_and_a_capacity():
    """A conductance G to the store and H from there on, which in series are the room's own."""
    inner, outer, store, capacity = 200.0, 80.0, 9e6, 4e6
    loss = inner * outer / (inner + outer)
    time = 1800.0 * np.arange(400)
    outdoor = 280.0 + 8.0 * np.sin(time / 4e4)
    heating = np.where(time % 1e5 < 4e4, 3000.0, 0.0)

    share = inner / (inner + outer)
    a = np.array([[-inner / capacity, inner / capacity], [inner / store, -(inner + outer) / store]])
    b = np.array([[1.0 / capacity, 0.0], [0.0, outer / store]])
    fed = {"heating": heating, "outdoor": outdoor}
    begin = np.array([290.0, share * 290.0 + (1.0 - share) * outdoor[0]])
    inputs = np.column_stack(list(fed.values()))
    exact = cont2discrete((a, b, np.eye(2), np.zeros((2, 2))), 1800.0)
    wanted = dlsim(exact, inputs, x0=begin)[1][:, 0]
    wall = storing_wall(Room, "flow", ("inside", "outdoor"), 1e4)
    values = {
        "loss": loss,
        "capacity": capacity,
        "flow_wall_conductance": inner,
        "flow_wall_share": share,
        "flow_wall_constant": store / (inner + outer),
    }
    model = CompiledModel(stack(Room, wall))
    found = model.run(time, fed, values).signals["shown"]
    assert np.ptp(wanted) > 10.0
    assert found == pytest.approx(wanted, abs=1e-3)
    without = model.run(
        time, {"outdoor": outdoor, "heating": heating}, values | {wall.neutral: 0.0}
    )
    assert np.abs(without.signals["shown"] - wanted).max() > 1.0


def test_a_loop_begins_within_its_limits():
    """By paper: the rate of a slide, or of Bouc and Wen's element, is zero at one and minus one."""
    slide = lag_effect(MASS, "spring_force", "velocity", "sliding", 0.1)
    (start,) = [p for p in slide.layout.parameters if p.starts]
    assert (start.min, start.max) == (-1.0, 1.0)
    heat = lag_effect(MASS, "spring_force", "velocity", "warming", 0.1)
    (start,) = [p for p in heat.layout.parameters if p.starts]
    assert start.min == 0.0
