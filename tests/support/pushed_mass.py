"""A mass on a spring that is pushed: its equations with an effect, written anew for SciPy.

The tank beside it runs out by a law of its own.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fmus.kit import Component, Input, Output, Parameter, State, stack
from fmus.kit.arms import lag_effect
from fmus.kit.inputs import (
    asymmetric_dead_zone,
    backlash,
    dead_zone,
    input_lag,
    input_offset,
    input_saturation,
)
from fmus.kit.record.compiled import CompiledModel
from orchestration.fmu.model import load_class

MASS = load_class(
    str(Path(__file__).parents[2] / "examples" / "mass_spring_damper.py") + ":MassSpringDamper"
)


M, D, K = 0.5, 2.0, 20.0


BASE = {"mass": M, "damping": D, "stiffness": K}


TIME = np.linspace(0.0, 6.0, 601)


FORCE = np.where(TIME % 2.0 < 1.0, 8.0, -5.0)


A, W, T = 3.0, 0.2, 0.4  # a coefficient, a width, a time constant


LITTLE = 0.1  # of it in friction, which may not push


class Tank(Component):
    """A tank that is filled and runs out: two laws of one signal, one of which does not fit its
    unit.
    """

    name = "tank"

    area = Parameter(2.0, "m^2", min=1e-3)
    outlet = Parameter(0.1, "m^2/s", min=0.0)
    inflow = Input("m^3/s", nominal=0.1)
    level = State("m", rate="level_rate", nominal=0.5)

    def level_rate(self):
        """Inflow less outflow."""
        return (self.inflow - self.outflow()) / self.area

    def outflow(self):
        """Laminar."""
        return self.outlet * self.level

    def odd(self):
        """A sum of a level and a flow."""
        return self.level + self.inflow

    @Output("m")
    def height(self):
        """As seen."""
        return self.level + 0.0 * self.odd()


def static(term, of):
    """Rates of the mass with one more term in a law; it has no state of its own."""
    return lambda x, u: [x[1], (u - D * x[1] - K * x[0] - term(x[of])) / M]


def fed(change):
    return lambda x, u: [x[1], (change(u) - D * x[1] - K * x[0]) / M]


def lagged(share):
    return lambda x, u: [x[1], (u + share * (x[2] - u) - D * x[1] - K * x[0]) / M, (u - x[2]) / T]


def played(d):
    def rates(x, u):
        passed = u - np.clip(u - x[2], -d, d)
        return [x[1], (passed - D * x[1] - K * x[0]) / M, (passed - x[2]) / 0.01]

    return rates


def late(x, u):
    return [x[1], (u - D * x[1] - K * x[0] - A * x[2]) / M, (x[1] - x[2]) / T]


def warmed(x, u):
    return [x[1], (u - D * x[1] - K * x[0] - A * x[2]) / M, (x[0] ** 2 - x[2]) / T]


SPRING, DAMPER = ("spring_force", "elongation"), ("damper_force", "velocity")


# effect, values, rates and number of states of the oracle
ARM_CASES = {
    "late": (
        lag_effect(MASS, *DAMPER, "lagging", 1.0, "N"),
        {"damper_force_lagging": A, "damper_force_lagging_constant": T},
        late,
        3,
    ),
    "heat": (
        lag_effect(MASS, *SPRING, "warming", 1.0, "N"),
        {"spring_force_warming": A, "spring_force_warming_constant": T},
        warmed,
        3,
    ),
}
INPUT_CASES = {
    "dead zone with two ends": (
        asymmetric_dead_zone(MASS, "force"),
        {"force_dead_zone_end": 1.5, "force_dead_zone_ratio": 0.4},
        fed(lambda u: u - np.clip(u, -0.6, 1.5)),
        2,
    ),
    "dead zone": (
        dead_zone(MASS, "force"),
        {"force_dead_zone": 1.5},
        fed(lambda u: u - np.clip(u, -1.5, 1.5)),
        2,
    ),
    "offset": (input_offset(MASS, "force"), {"force_input_offset": A}, fed(lambda u: u + A), 2),
    "saturation": (
        input_saturation(MASS, "force"),
        {"force_saturation": 0.04},
        fed(lambda u: u / np.hypot(1.0, 0.2 * u)),
        2,
    ),
    "lag": (input_lag(MASS, "force"), {"force_lagging_share": 0.7, "force_lag": T}, lagged(0.7), 3),
    "play": (backlash(MASS, "force"), {"force_play": 1.0}, played(1.0), 3),
}


def by_scipy(rates, states, force=FORCE):
    x, found = np.zeros(states), [0.0]
    jumps = [0, *(np.flatnonzero(np.diff(force[:-1])) + 1), len(TIME) - 1]
    for first, last in pairwise(jumps):  # the force is held from one to the next
        solved = solve_ivp(
            lambda t, x, u=force[first]: rates(x, u),
            (TIME[first], TIME[last]),
            x,
            "LSODA",
            TIME[first + 1 : last + 1],
            rtol=1e-9,
            atol=1e-11,
            max_step=0.01,
        ).y
        found.extend(solved[0])
        x = solved[:, -1]
    return np.array(found)


@cache
def without():
    """Position of the mass as it is."""
    return by_scipy(static(lambda x: 0.0, 0), 2)


def follows(effect, values, rates, states=2):
    cls = stack(MASS, effect)
    found = CompiledModel(cls).run(TIME, {"force": FORCE}, BASE | values).signals["position"]
    expected = by_scipy(rates, states)
    assert np.abs(expected - without()).max() > 0.01, "it shows"
    assert np.abs(found - expected).max() < 2e-5
