"""Effects of the bench: the base model to the bit at neutral, their own equation elsewhere."""

import itertools
import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fmus
from fmus.kit import stack
from fmus.kit.integrate import Integrator
from fmus.kit.symbolic.tracing import trace
from fmus.voice_coil_dma import disturbances
from fmus.voice_coil_dma.effects import EFFECTS
from fmus.voice_coil_dma.model import VoiceCoilDma
from tests.support.completeness import Listed, check_described
from tests.support.laws import check_neutral, in_graph, named

NEUTRAL = {name: effect.neutral for name, effect in EFFECTS.items()}
ACTIVE = Listed(
    "ACTIVE",
    __name__,
    {
        "coulomb_friction": {"coulomb_force": 0.3, "coulomb_velocity": 2e-3},
        "asymmetric_friction": {"asymmetric_force": 0.2, "asymmetric_velocity": 2e-3},
        "position_dependent_force_constant": {
            "force_constant_falloff": 1e4,
            "force_constant_centre": 2e-3,
        },
        "amplifier_saturation": {"amplifier_saturation_coefficient": 5.0**-2},
        "stribeck_friction": {
            "slide_friction_stribeck": 0.3,
            "slide_friction_stribeck_velocity": 0.05,
        },
        "end_stops": {"slide_friction_stop_stiffness": 50.0, "slide_friction_stop_position": 2e-3},
        "coil_heating": {"coil_heating": 0.5, "coil_heating_time": 0.4},
        "winding_protection": {"protection_share": 0.5, "winding_time": 0.5},
        "clock_jitter": {"clock_jitter": 5e-3},
        "mains_hum": {"common_mode_voltage": 10.0, "mains_phase": 1.0},
        "bridge_noise": {"bridge_noise": 1e-5},
    },
    "values of its parameters at which it acts",
)
CHANGED = Listed(
    "CHANGED",
    __name__,
    {
        "coulomb_friction": {"der(velocity)"},
        "asymmetric_friction": {"der(velocity)"},
        "position_dependent_force_constant": {"der(velocity)", "der(coil_current)"},
        "amplifier_saturation": {"coil_voltage", "der(coil_current)"},
        "stribeck_friction": {"der(velocity)"},
        "end_stops": {"der(velocity)"},
        "coil_heating": {"der(coil_current)"},
        "winding_protection": {"der(coil_current)", "coil_voltage"},
        "clock_jitter": {"der(coil_current)", "coil_voltage", "voltage_command", "previous_error"},
        "mains_hum": {"force_measured", "voltage_command", "previous_error"},
        "bridge_noise": {"force_measured", "voltage_command", "previous_error"},
    },
    "the rates and outputs that it changes",
)
# a state in which it acts
STATES = {
    "winding_protection": {"winding_hot": 1.0},
    "clock_jitter": {"late_share": 0.7},
    "bridge_noise": {"bridge_sample": -1.3},
}
effects = pytest.mark.parametrize("name", EFFECTS)


def random_values(cls, seed):
    """Parameters about their defaults, and any state and input."""
    rng = np.random.default_rng(seed)
    values = {
        p.name: float(p.start) * rng.uniform(0.3, 3.0)
        for p in cls.layout.parameters
        if p.type == "real"
    }
    for v in (*cls.layout.inputs, *cls.layout.states, *cls.layout.discretes):
        if v.type == "real":
            values[v.name] = v.nominal * rng.normal() * 3.0
    values["voltage_command"] = rng.uniform(0.5, 3.0)
    return values


def test_catalogue():
    assert fmus.effects("voice_coil_dma") == EFFECTS
    check_described("voice_coil_dma", EFFECTS)
    for effect in EFFECTS.values():
        for v in effect.layout.parameters:
            assert v.starts or (math.isfinite(v.min) and math.isfinite(v.max)), v.name


@pytest.mark.parametrize("chosen", [*((n,) for n in EFFECTS), tuple(EFFECTS)], ids="+".join)
def test_neutral_is_bit_identical(chosen):
    cls = stack(VoiceCoilDma, *(EFFECTS[n] for n in chosen))
    for seed in range(200):
        values = random_values(cls, seed) | {NEUTRAL[n]: 0.0 for n in chosen}
        check_neutral(VoiceCoilDma, cls, values)


@effects
def test_neutral_is_bit_identical_in_the_graph(name):
    cls = stack(VoiceCoilDma, EFFECTS[name])
    for seed in range(20):
        values = random_values(cls, seed) | {NEUTRAL[name]: 0.0}
        check_neutral(VoiceCoilDma, cls, values, in_graph)


@effects
def test_an_active_effect_changes_what_it_should_and_nothing_else(name):
    cls, changed = stack(VoiceCoilDma, EFFECTS[name]), set()
    for seed in range(50):
        values = random_values(cls, seed) | ACTIVE[name] | STATES.get(name, {})
        plain, active = named(cls, values | {NEUTRAL[name]: 0.0}), named(cls, values)
        changed |= {n for n in plain if plain[n] != active[n]}
    assert changed == CHANGED[name]


@effects
def test_the_slope_at_neutral_is_finite_and_not_zero(name):
    """Identification starts there; the slope of the graph is that of central differences."""
    cls = stack(VoiceCoilDma, EFFECTS[name])
    graph = trace(cls)
    column = [p.name for p in cls.layout.parameters].index(NEUTRAL[name])
    computed = ca.vertcat(graph.rates, graph.outputs, *graph.updates)
    f = ca.Function("j", graph.arguments, [ca.jacobian(computed, graph.parameters)[:, column]])
    values = {
        v.name: v.start for v in (*cls.layout.parameters, *cls.layout.inputs, *cls.layout.discretes)
    } | random_values(cls, 3)
    # where every effect acts: off the middle, and stretching, but not by far
    values |= ACTIVE[name] | {"position": 5e-3, "velocity": 5e-3, NEUTRAL[name]: 0.0}
    values |= STATES.get(name, {}) | {"command_instant": -1.0}  # long ago
    groups = (cls.layout.parameters, cls.layout.inputs, cls.layout.states, cls.layout.discretes)
    found = (
        f(0.0, *[np.array([values[v.name] for v in g], dtype=float) for g in groups]).full().ravel()
    )
    step = 1e-4 * (cls.declared | EFFECTS[name].declared)[NEUTRAL[name]].nominal
    ends = [named(cls, values | {NEUTRAL[name]: sign * step}) for sign in (1.0, -1.0)]
    names = [*(f"der({s.name})" for s in cls.layout.states), *(o.name for o in cls.layout.outputs)]
    names += [d.name for _, members in cls.layout.sampled for d in members]
    slope = [(ends[0][n] - ends[1][n]) / (2 * step) for n in names]
    assert found == pytest.approx(slope, rel=1e-3, abs=1e-6 * np.abs(slope).max())
    assert np.abs(found).max() > 0


# --- against equations written out here
# -------------------------------------------------------------------------------

R, L, K, M, B = 3.0, 1e-3, 3.9, 0.03, 6.0
COMMANDS = (4.0, 1.0, 9.0, 0.0)


def open_loop(cls, **values):
    """Current, position and velocity under a staircase of voltage, the tension a held share of the
    command.
    """
    model = cls(controller_on=False, **values)
    integrator, rows = Integrator(model), []
    for k, volts in enumerate(COMMANDS):
        model.force_reference, model.tension = volts, 1.1 * volts
        for j in range(10):
            integrator.advance((10 * k + j) / 30.0, 1.0 / 30.0)
            rows.append([model.coil_current, model.position, model.velocity])
    return np.array(rows)


def exact(
    friction=lambda v: B * v,
    constant=lambda x: K,
    drive=lambda u: u,
    stop=lambda x: 0.0,
    heat=0.0,
    warm=1.0,
):
    """The same by a stiff solver; last the mean square of the current."""
    state, rows = np.zeros(4), []
    for volts in COMMANDS:
        for _ in range(10):

            def rates(t, y, volts=volts):
                i, x, v, s = y
                k = constant(x)
                force = k * i - friction(v) - stop(x) - 1.1 * volts
                return [
                    (drive(volts) - (R + heat * s) * i - k * v) / L,
                    v,
                    force / M,
                    (i * i - s) / warm,
                ]

            state = solve_ivp(rates, (0, 1 / 30), state, method="LSODA", rtol=1e-10, atol=1e-13).y[
                :, -1
            ]
            rows.append(state[:3])
    return np.array(rows)


LAWS = {
    "coulomb_friction": {"friction": lambda v: B * v + 0.3 * math.tanh(v / 2e-3)},
    "asymmetric_friction": {
        "friction": lambda v: B * v + 0.2 * math.tanh(v / 2e-3) * (1 + math.tanh(v / 2e-3)) / 2
    },
    "position_dependent_force_constant": {"constant": lambda x: K / (1 + 1e4 * (x - 2e-3) ** 2)},
    "amplifier_saturation": {"drive": lambda u: 5 * math.tanh(u / 5)},
    "stribeck_friction": {
        "friction": lambda v: B * v + 0.3 * math.tanh(v / 5e-3) * math.exp(-((v / 0.05) ** 2))
    },
    "end_stops": {"stop": lambda x: 50.0 * math.copysign(max(abs(x) - 2e-3, 0.0), x)},
    "coil_heating": {"heat": 0.5, "warm": 0.4},
}


@pytest.mark.parametrize(
    "name", [n for n, e in EFFECTS.items() if e.__module__ != disturbances.__name__]
)
def test_an_effect_follows_its_equation(name):
    found = open_loop(stack(VoiceCoilDma, EFFECTS[name]), **ACTIVE[name])
    solution = exact(**LAWS[name])
    assert (np.abs(found - solution).max(axis=0) < 1e-6 * np.abs(solution).max(axis=0)).all()
    assert np.abs(found - exact()).max() > 1e-3  # and it is seen


def test_stops_leave_the_stroke_and_no_more():
    """0.5 in from one to the other (section 2.2.2), with the coil in the middle at the start."""
    model = stack(VoiceCoilDma, EFFECTS["end_stops"])(slide_friction_stop_stiffness=1e4)
    for side in (-1.0, 1.0):
        model.position = side * 0.5 * 12.7e-3
        assert model.slide_friction() == pytest.approx(0.0, abs=1e-9)
        model.position += side * 1e-4
        assert model.slide_friction() == pytest.approx(side * 1.0, rel=1e-9)


def test_friction_takes_energy_and_its_directions_differ():
    cls = stack(VoiceCoilDma, *EFFECTS.values())
    model = cls(b_vc=0.0, **ACTIVE["coulomb_friction"], **ACTIVE["asymmetric_friction"])
    for v in np.linspace(-0.1, 0.1, 401):
        model.velocity = float(v)
        assert model.slide_friction() * v >= 0.0
    forces = []
    for v in (0.1, -0.1):
        model.velocity = v
        forces.append(model.slide_friction())
    assert forces == pytest.approx([0.3 + 0.2, -0.3])


@pytest.mark.parametrize("pair", list(itertools.combinations(EFFECTS, 2)), ids="+".join)
def test_order_does_not_matter(pair):
    forth, back = (
        stack(VoiceCoilDma, *(EFFECTS[n] for n in order)) for order in (pair, pair[::-1])
    )
    values = random_values(forth, 5) | ACTIVE[pair[0]] | ACTIVE[pair[1]]
    assert named(forth, values) == pytest.approx(named(back, values), rel=1e-12)
