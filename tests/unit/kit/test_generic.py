"""Generic effects: neutral at zero, their closed form elsewhere, in both builds."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj

from fmus.kit import UserError, stack, units
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.generic import (
    asymmetric_friction,
    coulomb_friction,
    cubic_stiffness,
    extra_kelvin,
    force_offset,
)
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.tracing import trace
from orchestration.fmu.instance import Fmu
from orchestration.fmu.model import catalogue, load_class
from orchestration.fmu.simulation import simulate_instance
from orchestration.identify.grey_box import fit_grey_box
from tests.support.pace import slow_but

EXAMPLES = Path(__file__).parents[3] / "examples"
STAGE, FOLLOWED, MASS, CREEP = (
    load_class(str(EXAMPLES / place))
    for place in (
        "positioning_stage.py:PositioningStage",
        "positioning_stage.py:StageFollowed",
        "mass_spring_damper.py:MassSpringDamper",
        "creep.py:Creep",
    )
)
BASES = (STAGE, FOLLOWED, MASS, CREEP)
INPUTS = {
    STAGE: {"motor_voltage": 3.0},
    FOLLOWED: {"velocity": 0.2, "acceleration": 2.0},
    MASS: {"force": 0.2},
    CREEP: {"stress": 20.0},
}
ALL = [(base, effect) for base in BASES for effect in catalogue(base).values()]
each = pytest.mark.parametrize(("base", "effect"), ALL, ids=[f"{b.name}-{e.id}" for b, e in ALL])


def own_values(effect):
    """Return the switch of an effect, at a value that shows."""
    return {effect.neutral: 0.7 * effect.declared[effect.neutral].nominal}


def random_values(cls, seed, size=None):
    rng = np.random.default_rng(seed)
    values = {p.name: abs(p.start) * rng.uniform(0.3, 3.0, size) for p in cls.layout.parameters}
    for v in (*cls.layout.inputs, *cls.layout.states):
        values[v.name] = v.nominal * rng.normal(size=size) * 3.0
    return values


def evaluated(cls, values):
    model = cls()
    for name, value in values.items():
        setattr(model, name, value)
    layout = cls.layout
    found = {f"der({s.name})": rate for s, rate in zip(layout.states, model.rates(), strict=True)}
    return found | {o.name: value for o, value in zip(layout.outputs, model.outputs(), strict=True)}


def run(cls, time, values, inputs=None, sensitivities=()):
    fed = {name: np.broadcast_to(value, time.shape) for name, value in (inputs or {}).items()}
    return CompiledModel(cls, sensitivities).run(time, fed, values)


# --- the catalogue
# --------------------------------------------------------------------------------------------------


@each
def test_what_is_declared(base, effect):
    assert effect.assumption
    assert effect.__doc__.endswith(".")
    assert "Parameters" not in effect.__doc__
    assert effect.declared[effect.neutral].start == 0.0
    for v in effect.declared.values():
        assert v.doc
        units.base_unit(v.unit)
    own = [p for p in effect.layout.parameters if p.name in effect.declared]
    assert all(-math.inf < p.min <= p.start < p.max < math.inf for p in own)


@pytest.mark.parametrize(
    ("effect", "unit"),
    [
        (coulomb_friction(STAGE, "friction", "velocity"), "N"),
        (asymmetric_friction(STAGE, "friction", "velocity"), "N*s/m"),
        (force_offset(STAGE, "friction"), "N"),
        (cubic_stiffness(MASS, "spring_force", "elongation"), "N/m^3"),
        (cubic_stiffness(STAGE, "friction", "velocity"), "N*s^3/m^3"),
        (extra_kelvin(CREEP, "elongation", "stress", "second", time=3.0, unit="1"), "1/Pa"),
        (extra_kelvin(CREEP, "elongation", "stress", "second", time=3.0), "m^3/N"),
    ],
)
def test_unit_of_the_switch(effect, unit):
    assert units.base_unit(effect.declared[effect.neutral].unit) == units.base_unit(unit)


def test_what_is_not_there_is_told():
    with pytest.raises(UserError, match="positioning_stage: no law named 'frictio'"):
        coulomb_friction(STAGE, "frictio", "velocity")
    with pytest.raises(UserError, match="positioning_stage: no law named 'mass'"):
        force_offset(STAGE, "mass")
    with pytest.raises(
        UserError, match=r"no input or state named 'velocit' \(did you mean velocity\?\)"
    ):
        asymmetric_friction(STAGE, "friction", "velocit")
    with pytest.raises(UserError, match="'second_kelvin' is laid over it twice"):
        stack(
            CREEP,
            *(extra_kelvin(CREEP, "elongation", "stress", "second", time) for time in (1.0, 2.0)),
        )


# --- neutral
# --------------------------------------------------------------------------------------------------


@each
@pytest.mark.parametrize("size", [None, 200])
def test_neutral_is_bit_identical(base, effect, size):
    cls, known, moved = stack(base, effect), {v.name for v in base.layout.variables}, False
    for seed in range(30 if size is None else 1):
        values = random_values(cls, seed, size) | {effect.neutral: 0.0}
        expected = evaluated(base, {n: v for n, v in values.items() if n in known})
        still, active = evaluated(cls, values), evaluated(cls, values | own_values(effect))
        for name in expected:
            np.testing.assert_array_equal(still[name], expected[name])
            moved |= bool(np.any(active[name] != expected[name]))
    assert moved


@each
def test_neutral_is_bit_identical_in_the_graph(base, effect):
    cls = stack(base, effect)
    for seed in range(10):
        values, found = random_values(cls, seed) | {effect.neutral: 0.0}, []
        for graph in (trace(base), trace(cls)):
            layout = graph.layout
            point = [
                [float(values[v.name]) for v in g]
                for g in (layout.parameters, layout.inputs, layout.states)
            ]
            rates, outputs, *_ = graph.functions(tangent=False)
            n = len(base.layout.states)
            found.append((rates(0.0, *point, []).full()[:n], outputs(0.0, *point, []).full()))
        for one, other in zip(*found, strict=True):
            np.testing.assert_array_equal(one, other)


@each
def test_slope_at_neutral_is_that_of_differences_and_not_zero(base, effect):
    cls, time = stack(base, effect), np.linspace(0.0, 2.0, 400)
    inputs = {
        name: high * np.sin(7.0 * time + k) for k, (name, high) in enumerate(INPUTS[base].items())
    }
    output, step = base.layout.outputs[0].name, 1e-4 * effect.declared[effect.neutral].nominal
    found = run(cls, time, {}, inputs, [effect.neutral]).sensitivities[output][:, 0]
    ends = [run(cls, time, {effect.neutral: k * step}, inputs).signals[output] for k in range(3)]
    slope = (4.0 * ends[1] - ends[2] - 3.0 * ends[0]) / (
        2.0 * step
    )  # into the range, which may end at neutral
    assert found == pytest.approx(slope, abs=2e-3 * np.abs(slope).max())
    assert np.abs(slope).max() > 0.0


# --- what they do
# --------------------------------------------------------------------------------------------------

TIME = np.linspace(0.0, 3.0, 301)
PLAIN = {"mass": 2.0, "force_constant": 1.0}


def test_coulomb_friction_stops_what_coasts():
    """Without viscosity the velocity falls by F_c / M, then stays within the viscous width."""
    cls = stack(STAGE, catalogue(STAGE)["coulomb_friction"])
    values = PLAIN | {
        "damping": 0.0,
        "friction_coulomb": 3.0,
        "friction_coulomb_velocity": 1e-5,
        "velocity_start": -2.0,
    }
    velocity = run(cls, TIME, values).signals["velocity"]
    assert velocity == pytest.approx(np.minimum(-2.0 + 3.0 / 2.0 * TIME, 0.0), abs=1e-4)


def test_coulomb_friction_against_another_integrator():
    cls = stack(STAGE, catalogue(STAGE)["coulomb_friction"])
    values = PLAIN | {"damping": 1.5, "friction_coulomb": 0.8, "friction_coulomb_velocity": 0.05}
    for volts in (-2.0, 0.5):
        solved = solve_ivp(
            lambda t, v: (volts - 1.5 * v - 0.8 * np.tanh(v / 0.05)) / 2.0,  # noqa: B023
            (0.0, 3.0),
            [0.0],
            "LSODA",
            TIME,
            rtol=1e-10,
            atol=1e-12,
        )
        found = run(cls, TIME, values, {"motor_voltage": volts}).signals["velocity"]
        assert found == pytest.approx(solved.y[0], abs=1e-7)


def test_asymmetric_friction_and_offset_in_closed_form():
    cls = stack(STAGE, catalogue(STAGE)["asymmetric_friction"], catalogue(STAGE)["force_offset"])
    values = PLAIN | {"damping": 1.5, "friction_asymmetry": 0.5, "friction_offset": -0.7}
    for volts, damping in ((3.0, 2.0), (-3.0, 1.0)):
        exact = (volts + 0.7) / damping * (1.0 - np.exp(-damping / 2.0 * TIME))
        assert run(cls, TIME, values, {"motor_voltage": volts}).signals[
            "velocity"
        ] == pytest.approx(exact, abs=1e-7)


def duffing(mass, stiffness, cubic, start):
    """Return the free swing on a cubic spring, in Jacobi's functions (DLMF 22.19(ii), 22.17)."""
    hardened = stiffness + cubic * start**2
    angle, m = np.sqrt(hardened / mass) * TIME, cubic * start**2 / (2.0 * hardened)
    if m >= 0.0:
        return start * ellipj(angle, m)[1]
    _, cosine, delta, _ = ellipj(angle * np.sqrt(1.0 - m), -m / (1.0 - m))
    return start * cosine / delta


@pytest.mark.parametrize("cubic", [0.0, 5.0, -1.0])
def test_cubic_stiffness_is_duffings(cubic):
    cls = stack(MASS, catalogue(MASS)["cubic_stiffness"])
    values = {
        "mass": 0.3,
        "damping": 0.0,
        "stiffness": 4.0,
        "spring_force_cubic": cubic,
        "elongation_start": 1.2,
    }
    found = run(cls, TIME, values).signals["position"]
    assert found == pytest.approx(duffing(0.3, 4.0, cubic, 1.2), abs=1e-5)


def test_kelvin_elements_add_up():
    cls = stack(CREEP, *catalogue(CREEP).values())
    elements = {"second": (2.0, 0.5), "third": (3.0, 2.0), "fourth": (0.5, 0.1)}
    values = {"modulus": 4.0, "viscosity": 7.0, "compliance": 0.3, "retardation_time": 1.0}
    for ordinal, (compliance, time) in elements.items():
        values |= {
            f"{ordinal}_elongation_compliance": compliance,
            f"{ordinal}_elongation_time": time,
        }
    exact = 10.0 / 4.0 + 10.0 / 7.0 * TIME
    for compliance, time in ((0.3, 1.0), *elements.values()):
        exact = exact + 10.0 * compliance * (1.0 - np.exp(-TIME / time))
    assert run(cls, TIME, values, {"stress": 10.0}).signals["strain"] == pytest.approx(
        exact, rel=1e-6
    )


def test_a_fit_finds_it_from_neutral():
    """In the swing of another equation, with noise."""
    noisy = duffing(0.3, 4.0, 0.6, 1.2) + 0.01 * np.random.default_rng(5).normal(size=TIME.size)
    cls, given = (
        stack(MASS, catalogue(MASS)["cubic_stiffness"]),
        {"mass": 0.3, "damping": 0.0, "elongation_start": 1.2},
    )
    given |= {"stiffness": 4.0}
    found = fit_grey_box(
        cls, TIME, {}, {"position": noisy}, ["spring_force_cubic"], given
    ).estimates["spring_force_cubic"]
    assert found.nominal == 0.0
    assert found.interval[0] <= 0.6 <= found.interval[1]
    assert found.interval[0] > 0.5, "told from neutral, and well"


# --- as FMUs
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("base", slow_but(BASES, STAGE), ids=lambda cls: cls.name)
def test_builds_agree_on_all_of_them_at_once(base, tmp_path):
    effects = list(catalogue(base).values())
    cls = stack(base, *effects, name=f"{base.name}_extended")
    values = {name: value for effect in effects for name, value in own_values(effect).items()}
    rng = np.random.default_rng(3)
    time = np.concatenate([[0.0], np.cumsum(rng.choice([0.003, 0.02, 0.05], 60))])
    fed = {name: rng.uniform(-high, high, time.size) for name, high in INPUTS[base].items()}
    output, shown = base.layout.outputs[0].name, {}
    for runtime in RUNTIMES:
        path = tmp_path / f"{runtime}.fmu"
        path.write_bytes(build(cls, runtime, [host_platform()]))
        with Fmu(path, values) as one:
            one.start(float(time[0]), float(time[-1]))
            shown[runtime] = simulate_instance(one, time, fed)[output]
    plain = run(base, time, {}, fed).signals[output]
    assert np.abs(shown["native"] - plain).max() > 0.01 * np.abs(plain).max(), "they are active"
    assert np.abs(shown["python"] - shown["native"]).max() <= 1e-9 * np.abs(shown["native"]).max()
