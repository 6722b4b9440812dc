"""Families of effects: which a model's laws ask for, and what each does.

Oracles: the laws and units of small models, read by eye; equations of motion with the missing term, written here and
integrated by SciPy.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit import Component, Input, Output, Parameter, State, UserError, stack, table
from fmus.kit.arms import arm
from fmus.kit.build import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.component import effect_name
from fmus.kit.curves import SHAPES, curve
from fmus.kit.inputs import (
    asymmetric_dead_zone,
    backlash,
    dead_zone,
    input_lag,
    input_offset,
    input_saturation,
)
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.families import families_for, laws_of
from orchestration.fmu.instance import Fmu
from orchestration.fmu.model import load_class
from orchestration.fmu.simulate import simulate_instance
from tests.support.kit_samples import Sledge

MASS = load_class(
    str(Path(__file__).parents[4] / "examples" / "mass_spring_damper.py") + ":MassSpringDamper"
)
M, D, K = 0.5, 2.0, 20.0
BASE = {"mass": M, "damping": D, "stiffness": K}
TIME = np.linspace(0.0, 6.0, 601)
FORCE = np.where(TIME % 2.0 < 1.0, 8.0, -5.0)
A, W, T = 3.0, 0.2, 0.4  # a coefficient, a width, a time constant
LITTLE = 0.1  # of it in friction, which may not push


class Tank(Component):
    """A tank that is filled and runs out: two laws of one signal, one of which does not fit its unit."""

    name = "tank"

    area = Parameter(2.0, "m^2", min=1e-3)
    outlet = Parameter(0.1, "m^2/s", min=0.0)
    inflow = Input("m^3/s", nominal=0.1)
    level = State("m", rate="level_rate", nominal=0.5)

    def level_rate(self):
        """What comes in and does not run out."""
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


def test_laws_are_told_with_their_units_and_what_they_read():
    found = {law.name: (law.unit, law.reads, law.is_rate, law.is_output) for law in laws_of(MASS)}
    assert found == {
        "elongation_rate": ("m/s", ("velocity",), True, False),
        "acceleration": ("m/s^2", ("force",), True, False),
        "damper_force": ("N", ("velocity",), False, False),
        "spring_force": ("N", ("elongation",), False, False),
        "position": ("m", ("elongation",), False, True),
    }
    tank = {law.name: (law.unit, law.reads) for law in laws_of(Tank)}
    assert tank["outflow"] == ("m^3/s", ("level",))
    assert tank["level_rate"] == ("m/s", ("inflow",))
    assert tank["odd"] == ("", ("inflow", "level")), "a sum that has no unit"


def test_what_fits_a_model_s_laws_is_listed():
    names = [effect_name(effect) for effect in families_for(MASS)]
    assert len(set(names)) == len(names)
    for name in (
        "coulomb_friction(damper_force)",
        "quadratic_drag(damper_force)",
        "cubic_stiffness(spring_force)",
        "upper_stop(spring_force)",
        "maxwell_arm(spring_force)",
        "force_offset",
        "dead_zone(force)",
        "backlash(force)",
    ):
        assert name in names
    assert not any("elongation_rate" in name or "position" in name for name in names), (
        "definitions and outputs"
    )
    tank = [effect_name(effect) for effect in families_for(Tank)]
    assert {"square_root_outflow(outflow)", "overflow(outflow)"} <= set(tank)
    assert "laminar_outflow(outflow)" not in tank, "the outlet's own parameter is that"
    assert "viscous_drag(damper_force)" not in names
    assert not any("odd" in name for name in tank)


@pytest.mark.parametrize("cls", [MASS, Tank])
def test_at_its_neutral_value_nothing_changes(cls):
    rng = np.random.default_rng(1)
    values = {v.name: float(rng.normal()) for v in (*cls.layout.inputs, *cls.layout.states)}
    for effect in families_for(cls):
        plain, extended = cls(), stack(cls, effect)()
        for name, value in values.items():
            setattr(plain, name, value)
            setattr(extended, name, value)
        assert extended.rates()[: len(plain.rates())] == plain.rates(), effect.id
        assert extended.outputs() == plain.outputs(), effect.id


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


def maxwell(x, u):
    return [x[1], (u - D * x[1] - K * x[0] - A * (x[0] - x[2])) / M, (x[0] - x[2]) / T]


def dahl(x, u):
    return [x[1], (u - D * x[1] - K * x[0] - A * x[2]) / M, (x[1] - abs(x[1]) * x[2]) / W]


def heated(x, u):
    return [x[1], (u - D * x[1] - K * x[0] - A * x[1] * x[2]) / M, (x[1] ** 2 - x[2]) / T]


def warmed(x, u):
    return [x[1], (u - D * x[1] - K * x[0] - A * x[2]) / M, (x[0] ** 2 - x[2]) / T]


def bouc_wen(x, u):
    """As Wen has it: A dx - beta |dx| |z| z - gamma dx z^2, with A = 1 and beta = gamma = 1/2, over w."""
    z, v = x[2], x[1]
    return [
        v,
        (u - D * v - K * x[0] - A * z) / M,
        (v - 0.5 * abs(v) * abs(z) * z - 0.5 * v * z * z) / W,
    ]


def prandtl(x, u):
    stretched = np.clip(x[0] - x[2], -W, W)
    return [x[1], (u - D * x[1] - K * x[0] - A * stretched) / M, (x[0] - stretched - x[2]) / 0.01]


SPRING, DAMPER = ("spring_force", "elongation"), ("damper_force", "velocity")
BY_HAND = {
    "linear": lambda x: x,
    "asymmetric": lambda x: abs(x),
    "quadratic": lambda x: x**2,
    "odd_quadratic": lambda x: x * abs(x),
    "cubic": lambda x: x**3,
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
OTHERS = {
    "maxwell": (
        arm(MASS, *SPRING, "leading", 1.0, "N"),
        {"spring_force_leading": A, "spring_force_leading_constant": T},
        maxwell,
        3,
    ),
    "dahl": (
        arm(MASS, *DAMPER, "sliding", 0.1, "N"),
        {"damper_force_sliding": A, "damper_force_sliding_constant": W},
        dahl,
        3,
    ),
    "heat times speed": (
        arm(MASS, *DAMPER, "heating", 1.0, "N"),
        {"damper_force_heating": A, "damper_force_heating_constant": T},
        heated,
        3,
    ),
    "heat alone": (
        arm(MASS, *SPRING, "warming", 1.0, "N"),
        {"spring_force_warming": A, "spring_force_warming_constant": T},
        warmed,
        3,
    ),
    "Bouc and Wen": (
        arm(MASS, *SPRING, "hysteresis", 0.1, "N"),
        {"spring_force_hysteresis": A, "spring_force_hysteresis_constant": W},
        bouc_wen,
        3,
    ),
    "Prandtl": (
        arm(MASS, *SPRING, "play", 0.1, "N"),
        {"spring_force_play": A, "spring_force_play_constant": W},
        prandtl,
        3,
    ),
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
assert BY_HAND.keys() == SHAPES.keys()


def by_scipy(rates, states):
    x, found = np.zeros(states), [0.0]
    jumps = [0, *(np.flatnonzero(np.diff(FORCE[:-1])) + 1), len(TIME) - 1]
    for first, last in pairwise(jumps):  # the force is held from one to the next
        solved = solve_ivp(
            lambda t, x, u=FORCE[first]: rates(x, u),
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


@pytest.mark.parametrize("shape", sorted(SHAPES))
@pytest.mark.parametrize("law", [SPRING, DAMPER])
def test_a_curve_in_a_law_is_what_its_formula_says(law, shape):
    effect = curve(MASS, *law, shape, "N")
    amount = A if law is SPRING or shape in ("stribeck", "weir") else LITTLE * A
    values = {f"{law[0]}_{shape}": amount} | (
        {f"{law[0]}_{shape}_width": W} if SHAPES[shape].width else {}
    )
    nominal = next(s.nominal for s in MASS.layout.states if s.name == law[1])
    size = amount * {"square_root": nominal**0.5, "weir": nominal**-0.5}.get(
        shape, 1.0
    )  # for whole powers of units
    follows(effect, values, static(lambda x: size * BY_HAND[shape](x), 0 if law is SPRING else 1))


@pytest.mark.parametrize("name", sorted(OTHERS))
def test_memory_and_what_becomes_of_an_input(name):
    follows(*OTHERS[name])


def test_effects_on_one_input_follow_one_another():
    """The first is next to the command: an offset before a dead zone, and behind it."""
    for effects, expected in (
        (
            (input_offset(MASS, "force"), dead_zone(MASS, "force")),
            lambda u: (u + 1.0) - np.clip(u + 1.0, -2.0, 2.0),
        ),
        (
            (dead_zone(MASS, "force"), input_offset(MASS, "force")),
            lambda u: u - np.clip(u, -2.0, 2.0) + 1.0,
        ),
    ):
        model = stack(MASS, *effects)(**BASE, force_input_offset=1.0, force_dead_zone=2.0)
        for force in (-5.0, -1.5, 0.5, 4.0):
            model.force = force
            assert model.rates()[1] == pytest.approx(expected(force) / M)


@pytest.mark.parametrize("runtime", RUNTIMES)
def test_fmus_of_both_builds_have_them(tmp_path, runtime):
    effects = [effect for effect, *_ in OTHERS.values()]
    effects += [
        curve(MASS, *DAMPER, s, "N") for s in ("odd_quadratic", "stribeck", "stops", "weir")
    ]
    cls = stack(MASS, *effects)
    values = BASE | {name: value for _, own, *_ in OTHERS.values() for name, value in own.items()}
    values |= {f"damper_force_{s}": 0.5 for s in ("odd_quadratic", "stribeck", "stops", "weir")}
    expected = (
        CompiledModel(cls).run(TIME[:200], {"force": FORCE[:200]}, values).signals["position"]
    )
    path = tmp_path / f"{runtime}.fmu"
    path.write_bytes(build(cls, runtime, [host_platform()]))
    with Fmu(path, values) as instance:
        instance.start(0.0, float(TIME[199]))
        found = simulate_instance(instance, TIME[:200], {"force": FORCE[:200]})
    assert np.abs(found["position"] - expected).max() < 1e-6


def test_what_nothing_brakes_may_have_drag():
    found = {effect_name(effect): effect for effect in families_for(Sledge)}
    drag = found["viscous_drag(acceleration)"]
    model = stack(Sledge, drag)(**{drag.neutral: -0.3})
    model.velocity, model.command = 2.0, 0.5
    assert model.rates() == [pytest.approx(0.5 / 2.0 - 0.3 * 2.0)]


AT = np.array([-3.0, -1.0, -0.4, 0.5, 0.9, 2.0, 7.0])


@pytest.mark.parametrize("runtime", RUNTIMES)
def test_a_table_is_numpys_in_both_builds(tmp_path, runtime):
    path, time = tmp_path / f"{runtime}.fmu", np.arange(7.0)
    path.write_bytes(build(Sledge, runtime, [host_platform()]))
    values = {"low": -2.0, "middle": 1.0, "high": 1.5}
    with Fmu(path, values) as instance:
        instance.start(0.0, 6.0)
        found = simulate_instance(instance, time, {"command": AT})
    assert found["force"] == pytest.approx(
        np.interp(AT, [-1.0, 0.5, 2.0], [-2.0, 1.0, 1.5]), rel=1e-14
    )


def test_a_table_has_exact_slopes():
    """By its values they are the hat functions."""
    found = CompiledModel(Sledge, ["low", "middle", "high"]).run(
        np.arange(7.0), {"command": AT}, {}
    )
    hats = [np.interp(AT, [-1.0, 0.5, 2.0], one) for one in np.eye(3)]
    assert found.sensitivities["force"] == pytest.approx(np.column_stack(hats), abs=1e-14)
    assert table(AT, (0.0, 1.0), (2.0, 3.0)) == pytest.approx(
        np.interp(AT, [0.0, 1.0], [2.0, 3.0]), rel=1e-15
    )
    with pytest.raises(ValueError, match="a table of 2 abscissae and 1 values"):
        table(0.0, (1.0, 2.0), (1.0,))


def test_what_there_is_not_is_refused_in_a_line():
    with pytest.raises(UserError, match=r"no shape named 'cubik' \(did you mean cubic"):
        curve(MASS, *SPRING, "cubik")
    with pytest.raises(UserError, match="no arm named 'laging'"):
        arm(MASS, *SPRING, "laging", 1.0)
    with pytest.raises(UserError, match="hysteresis is over a state, which 'force' is not"):
        arm(MASS, "spring_force", "force", "hysteresis", 1.0)
    with pytest.raises(UserError, match="no law named 'spring'"):
        curve(MASS, "spring", "elongation", "cubic")
    with pytest.raises(UserError, match="mass_spring_damper: no input or state named 'stretch'"):
        curve(MASS, "spring_force", "stretch", "cubic")
    with pytest.raises(UserError, match="mass_spring_damper: no real input named 'voltage'"):
        dead_zone(MASS, "voltage")


@pytest.mark.parametrize("kind", ["lagging", "leading", "play"])
def test_what_remembers_a_state_begins_in_equilibrium_with_it(kind):
    """The level stands at a metre; a memory that began at zero would let flow what has long settled."""
    steady = {"inflow": np.full(50, 0.1)}
    remembering = stack(Tank, arm(Tank, "outflow", "level", kind, 5.0, "m^3/s"))
    values = {f"outflow_{kind}": 0.01 if kind != "lagging" else 0.02, "level_start": 1.0}
    values |= {"outlet": 0.08} if kind == "lagging" else {}  # what is remembered flows, too
    found = CompiledModel(remembering).run(np.arange(50.0), steady, values).signals["height"]
    assert found == pytest.approx(np.ones(50), abs=1e-9)
