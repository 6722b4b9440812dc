"""Effects of the stand: the base model to the bit at neutral, their own equation elsewhere."""

import itertools
import math
from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fmus
from fmus.isotonic_stand.effects import EFFECTS
from fmus.isotonic_stand.model import IsotonicStand
from fmus.kit import stack
from fmus.kit.integrate import Integrator
from tests.support.builds import check_that_builds_agree
from tests.support.completeness import Listed, check_described
from tests.support.laws import check_neutral, in_graph, named

ACTIVE = Listed(
    "ACTIVE",
    __name__,
    {
        "core_friction": {
            "core_friction": 0.2,
            "core_friction_velocity": 2e-3,
            "core_follow_time": 0.03,
        },
        "swinging_weight": {"swing_square": 0.04, "swing_length": 0.2, "swing_decay": 2.0},
        "misalignment": {"misalignment_loss": 0.05},
        "frame_compliance": {"frame_compliance": 2e-4},
    },
    "values of its parameters at which it acts",
)
CHANGED = Listed(
    "CHANGED",
    __name__,
    {
        "core_friction": {"der(tension)"},
        "swinging_weight": {"der(tension)"},
        "misalignment": {"der(demodulated_voltage)"},
        "frame_compliance": {"der(demodulated_voltage)"},
    },
    "the rates and outputs that it changes",
)
RANGES = {"mass": (0.0, 0.5), "displacement": (-5e-3, 5e-3)}
effects = pytest.mark.parametrize("name", EFFECTS)


def random_values(cls, seed):
    """Parameters about their defaults, and any state and input; loads that pull."""
    rng = np.random.default_rng(seed)
    values = {
        p.name: float(p.start) * rng.uniform(0.3, 3.0)
        for p in cls.layout.parameters
        if p.type == "real"
    }
    for v in (*cls.layout.inputs, *cls.layout.states, *cls.layout.discretes):
        values[v.name] = v.nominal * rng.normal() * 3.0
    return values | {"mass": rng.uniform(0.1, 0.5), "zero": rng.uniform() < 0.5}


def test_catalogue():
    assert fmus.effects("isotonic_stand") == EFFECTS
    check_described("isotonic_stand", EFFECTS)
    assert all(effect.declared[effect.neutral].start == 0.0 for effect in EFFECTS.values())


@pytest.mark.parametrize("chosen", [*((n,) for n in EFFECTS), tuple(EFFECTS)], ids="+".join)
def test_neutral_is_bit_identical_on_floats_and_in_the_graph(chosen):
    cls = stack(IsotonicStand, *(EFFECTS[n] for n in chosen))
    for seed in range(50):
        values = random_values(cls, seed) | {EFFECTS[n].neutral: 0.0 for n in chosen}
        check_neutral(IsotonicStand, cls, values)
        check_neutral(IsotonicStand, cls, values, partial(in_graph, time=0.7))


@effects
def test_an_active_effect_changes_what_it_should_and_has_a_slope_at_neutral(name):
    effect = EFFECTS[name]
    cls, changed = stack(IsotonicStand, effect), set()
    for seed in range(50):
        values = random_values(cls, seed) | ACTIVE[name]
        plain, active = named(cls, values | {effect.neutral: 0.0}), named(cls, values)
        changed |= {n for n in plain if plain[n] != active[n]}
        step = 1e-6 * effect.declared[effect.neutral].nominal
        (moved,) = CHANGED[name]
        little = named(cls, values | {effect.neutral: step})[moved] - plain[moved]
        assert 0.0 < abs(little / step) < 1e12
    assert changed == CHANGED[name]


# --- against equations written out here
# -------------------------------------------------------------------------------

G, SENSITIVITY, CORNER, PLACING = 9.80665, 196.85, 2 * math.pi * 200.0, 0.05
TIMES = 0.02 * np.arange(101)


def mass(t):
    return 0.2 if t < 1.0 else 0.5


def displacement(t):
    return 1e-3 * math.sin(7.0 * t)


def exact(friction=0.0, swing=0.0, lean=0.0, bend=0.0):
    """Tension and voltage of the LVDT by a stiff solver; inputs held from point to point."""
    state, rows = np.array([0.0, 0.0, 0.0, 1.0, 0.0]), []
    turn = math.sqrt(G / 0.2)
    for at, until in itertools.pairwise(TIMES):
        x, m = displacement(0.5 * (at + until)), mass(0.5 * (at + until))

        def rates(t, y, x=x, m=m):
            tension, volts, travel, angle, pace = y
            speed = (x - travel) / 0.03
            weight = m * G * (1.0 + swing * (pace * pace - angle * angle / 2.0))
            load = max(weight - friction * math.tanh(speed / 2e-3), 0.0)
            return [
                (load - tension) / PLACING,
                CORNER * (SENSITIVITY * (x + bend * tension) * (1.0 - lean) - volts),
                speed,
                turn * pace,
                -turn * angle - 2.0 * pace / 2.0,
            ]

        state = solve_ivp(rates, (at, until), state, "LSODA", rtol=1e-11, atol=1e-13).y[:, -1]
        rows.append(state[:2])
    return np.array(rows)


LAWS = Listed(
    "LAWS",
    __name__,
    {
        "core_friction": {"friction": 0.2},
        "swinging_weight": {"swing": 0.04},
        "misalignment": {"lean": 0.05},
        "frame_compliance": {"bend": 2e-4},
    },
    "arguments of `exact`",
)


@effects
def test_an_effect_follows_its_equation(name):
    model = stack(IsotonicStand, EFFECTS[name])(**ACTIVE[name])
    integrator, rows = Integrator(model), []
    for at, until in itertools.pairwise(TIMES):
        model.mass, model.displacement = mass(0.5 * (at + until)), displacement(0.5 * (at + until))
        integrator.advance(at, until - at)
        rows.append([model.tension, model.demodulated_voltage])
    solution = exact(**LAWS[name])
    assert (np.abs(rows - solution).max(axis=0) < 1e-6 * np.abs(solution).max(axis=0)).all()
    assert np.abs(rows - exact()).max() > 1e-3  # and it is seen


def test_a_pendulum_pulls_as_its_cosine_and_its_speed_say():
    """Against a pendulum of any amplitude, whose terms of fourth order are left out."""
    amplitude, length = 0.1, 0.2
    turned = solve_ivp(
        lambda t, y: [y[1], -G / length * math.sin(y[0])],
        (0.0, 0.9),
        [amplitude, 0.0],
        rtol=1e-10,
        atol=1e-12,
        dense_output=True,
    )
    time = np.linspace(0.0, 0.9, 91)
    angle, speed = turned.sol(time)
    pull = np.cos(angle) + length * speed**2 / G
    model = stack(IsotonicStand, EFFECTS["swinging_weight"])(
        mass=1.0 / G, swing_square=amplitude**2, swing_length=length, swing_decay=1e6
    )
    integrator, found = Integrator(model), []
    for at in time:
        found.append(model.weight())
        integrator.advance(at, 0.01)
    assert np.array(found) == pytest.approx(pull, abs=amplitude**4)
    assert np.ptp(found) == pytest.approx(1.5 * amplitude**2, rel=0.01)


def test_friction_of_the_core_stays_within_what_a_rod_can_pull():
    """More friction than weight: the rod hangs slack and does not push."""
    cls = stack(IsotonicStand, EFFECTS["core_friction"])
    model = cls(mass=0.01, core_friction=1.0)
    integrator, pulls = Integrator(model), []
    for k in range(100):
        model.displacement = 1e-4 * k
        integrator.advance(0.01 * k, 0.01)
        pulls.append(model.tension)
    assert min(pulls) >= 0.0
    assert pulls[-1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(("share", "stable"), [(0.8, True), (1.25, False)])
def test_exchange_of_the_friction_with_a_spring_is_stable_as_the_readme_says(share, stable):
    friction, late, width, stiffness = 10.0, 1.0, 1e-3, 2625.0
    limit = -PLACING * math.log(1.0 - 2.0 / (1.0 + friction / (late * width * stiffness)))
    cls = stack(IsotonicStand, EFFECTS["core_friction"])
    model = cls(
        mass=0.2,
        tension_start=0.2 * G + 1e-5,
        core_friction=friction,
        core_follow_time=late,
        core_friction_velocity=width,
        core_travel_start=0.2 * G / stiffness,
    )
    integrator, size = Integrator(model), share * limit
    for k in range(400):
        model.displacement = model.tension / stiffness
        integrator.advance(k * size, size)
    assert (abs(model.tension - 0.2 * G) < 1e-5) == stable


@pytest.mark.parametrize("pair", list(itertools.combinations(EFFECTS, 2)), ids="+".join)
def test_order_does_not_matter(pair):
    forth, back = (
        stack(IsotonicStand, *(EFFECTS[n] for n in order)) for order in (pair, pair[::-1])
    )
    values = random_values(forth, 5) | ACTIVE[pair[0]] | ACTIVE[pair[1]]
    assert named(forth, values) == pytest.approx(named(back, values), rel=1e-12)


def test_builds_agree_on_all_effects(tmp_path):
    cls = stack(IsotonicStand, *EFFECTS.values(), name="everything")
    values = {parameter: value for name in EFFECTS for parameter, value in ACTIVE[name].items()}
    values |= {"linearity": 0.01, "carrier_ripple": 0.01}
    check_that_builds_agree(cls, values, RANGES, tmp_path)
