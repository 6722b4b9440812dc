"""Each effect is exactly the base model at its neutral value, and what its equation says elsewhere."""

import ast
import inspect
import itertools
import math
import re
import textwrap
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import lsim

import fmus
from fmus.kit import stack
from fmus.kit.compiled import CompiledModel
from fmus.kit.integrate import Integrator
from fmus.kit.trace import trace
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator, PpyActuatorLengthDriven

BASES = [PpyActuator, PpyActuatorLengthDriven]
NEUTRAL = {name: effect.neutral for name, effect in EFFECTS.items()}
ACTIVE = {
    "double_layer": {"double_layer_resistance": 0.2, "double_layer_time": 0.3},
    "resistance_growth": {"resistance_growth_rate": 0.02},
    "quadratic_strain": {"beta": 7e-6},
    "strain_saturation": {"strain_saturation_coefficient": 0.4**2},
    "strain_lag": {"lag_time": 1.5},
}
# what an active effect changes, beside its own state; in the length-driven actuator elongation changes the tension
ELECTRICAL = {"voltage", "der(charge)"}
STRAIN = {
    PpyActuator: {"electrochemical_displacement", "displacement"},
    PpyActuatorLengthDriven: {
        "electrochemical_displacement", "tension", "mechanical_displacement",
        "der(kelvin_elongation)", "der(maxwell_elongation)",
    },
}  # fmt: skip
bases = pytest.mark.parametrize("base", BASES, ids=lambda cls: cls.name)
effects = pytest.mark.parametrize("name", EFFECTS)
seeds = st.integers(0, 2**32 - 1)


def random_values(cls, seed, size=None):
    """Parameters about their defaults, and any state and input; the length-driven one taut as often as slack."""
    rng = np.random.default_rng(seed)
    values = {}
    for v in cls.layout.parameters:
        values[v.name] = np.abs(v.start) * rng.uniform(0.3, 3.0, size)
    for v in (*cls.layout.inputs, *cls.layout.states):
        values[v.name] = v.nominal * rng.normal(size=size) * 3.0
    for name in ("throughput",):
        if name in values:
            values[name] = np.abs(values[name]) * 10.0
    return values if size else {name: float(value) for name, value in values.items()}


def named(cls, values):
    """Rates and outputs by name."""
    model = cls()
    for name, value in values.items():
        setattr(model, name, value)
    layout = cls.layout
    result = dict(zip((f"der({s.name})" for s in layout.states), model.rates(), strict=True))
    return result | dict(zip((o.name for o in layout.outputs), model.outputs(), strict=True))


def test_catalogue():
    numbered = re.findall(r"^(\d+)\. ", (Path(fmus.__file__).parent / "ppy_actuator" / "README.md").read_text(), re.M)
    for name, effect in EFFECTS.items():
        assert effect.id == name
        assert effect.__doc__
        assert str(effect.assumption) in numbered
        assert f"assumption {effect.assumption}" in " ".join(effect.__doc__.split())
        own = [v for v in effect.declared.values() if v.name in {p.name for p in effect.layout.parameters}]
        assert NEUTRAL[name] in [v.name for v in own]
        for v in effect.declared.values():
            assert v.doc
            assert v.unit
            assert v.min <= v.start <= v.max
        for p in own:
            assert math.isfinite(p.min)
            assert math.isfinite(p.max)
    names = [v for effect in EFFECTS.values() for v in effect.declared]
    assert len(names) == len(set(names)), "effects must not share variables"


# --- neutral ----------------------------------------------------------------------------------------------------------


@bases
@pytest.mark.parametrize("chosen", [*((n,) for n in EFFECTS), tuple(EFFECTS), tuple(reversed(EFFECTS))], ids="+".join)
@settings(deadline=None, max_examples=60)
@given(seed=seeds)
def test_neutral_is_bit_identical_on_floats(base, chosen, seed):
    cls = stack(base, *(EFFECTS[n] for n in chosen))
    values = random_values(cls, seed) | {NEUTRAL[n]: 0.0 for n in chosen}
    known = {v.name for v in base.layout.variables}
    expected = named(base, {n: v for n, v in values.items() if n in known})
    found = named(cls, values)
    assert {n: found[n] for n in expected} == expected


@bases
@effects
def test_neutral_is_bit_identical_on_arrays(base, name):
    cls = stack(base, EFFECTS[name])
    values = random_values(cls, 1, size=1000) | {NEUTRAL[name]: 0.0}
    known = {v.name for v in base.layout.variables}
    expected = named(base, {n: v for n, v in values.items() if n in known})
    found = named(cls, values)
    for n, array in expected.items():
        np.testing.assert_array_equal(found[n], array)


@bases
@effects
def test_neutral_is_bit_identical_in_the_graph(base, name):
    cls = stack(base, EFFECTS[name])
    graph, reference = trace(cls), trace(base)
    functions = {f.name(): f for f in graph.functions()}
    references = {f.name(): f for f in reference.functions()}
    states = len(base.layout.states)
    for seed in range(50):
        values = random_values(cls, seed) | {NEUTRAL[name]: 0.0}
        point = [np.array([values[v.name] for v in g]) for g in (cls.layout.parameters, cls.layout.inputs)]
        point += [np.array([values[v.name] for v in cls.layout.states]), np.zeros(0)]
        base_point = [np.array([values[v.name] for v in g]) for g in (base.layout.parameters, base.layout.inputs)]
        base_point += [np.array([values[v.name] for v in base.layout.states]), np.zeros(0)]
        for law in ("rates", "outputs"):
            found, expected = (f[law](0.0, *p).full() for f, p in ((functions, point), (references, base_point)))
            np.testing.assert_array_equal(found[: states if law == "rates" else None], expected)


@bases
@effects
def test_neutral_runs_are_the_base_run(base, name):
    """Through the integrator only the internal step can differ, which the effect's own state takes part in choosing.

    The slack actuator is the hard case: going taut is a kink, and what a step across it costs depends on the step.
    """
    runs = []
    for cls in (base, stack(base, EFFECTS[name])):
        model = cls()
        integrator = Integrator(model)
        rows = []
        for k in range(50):
            model.current = 0.9 if k % 20 < 10 else -0.9
            integrator.advance(k * 0.1, 0.1)
            rows.append(model.outputs())
        runs.append(np.array(rows))
    tolerated = 1e-5 if base is PpyActuatorLengthDriven else 1e-8
    assert (np.abs(runs[1] - runs[0]).max(axis=0) <= tolerated * np.abs(runs[0]).max(axis=0)).all()


@bases
@effects
def test_the_model_moves_smoothly_away_from_neutral(base, name):
    cls = stack(base, EFFECTS[name])
    values = random_values(cls, 3)
    at_zero = named(cls, values | {NEUTRAL[name]: 0.0})
    near = named(cls, values | {NEUTRAL[name]: 1e-12})
    assert {n: near[n] for n in near} == pytest.approx(at_zero, rel=1e-5, abs=1e-9)


# --- active: what changes, and what does not --------------------------------------------------------------------------


@bases
@effects
def test_an_active_effect_changes_what_it_should_and_nothing_else(base, name):
    cls = stack(base, EFFECTS[name])
    expected = ELECTRICAL if name in ("double_layer", "resistance_growth") else STRAIN[base]
    changed = set()
    for seed in range(50):
        values = random_values(cls, seed) | ACTIVE[name]
        plain = named(cls, values | {NEUTRAL[name]: 0.0})
        active = named(cls, values)
        changed |= {n for n in plain if n in named(base, {}) and plain[n] != active[n]}
    assert changed == expected


# --- active: against equations written out here -----------------------------------------------------------------------


def run(cls, step, steps, current, **values):
    """Displacement due to charge, voltage and charge at the communication points; currents are held."""
    model = cls(**values)
    integrator = Integrator(model)
    rows = []
    for k in range(steps):
        model.current = float(current[k])
        rows.append([model.electrochemical_displacement(), model.voltage(), model.charge])
        integrator.advance(k * step, step)
    return np.array(rows).T


STEP, STEPS = 0.1, 300
CURRENT = 0.9 * np.where(np.arange(STEPS) % 50 < 25, 1.0, -1.0) + 0.2
R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5


def rc(current, step=STEP):
    """Charge of the base circuit under held currents, by recursion."""
    tau, charge = (R1 + R2) * C, [0.0]
    for i in current[:-1]:
        charge.append(R2 * C * i + (charge[-1] - R2 * C * i) * math.exp(-step / tau))
    return np.array(charge)


@bases
def test_quadratic_strain_follows_its_equation(base):
    cls = stack(base, EFFECTS["quadratic_strain"])
    elongation, voltage, charge = run(cls, STEP, STEPS, CURRENT, beta=7e-6)
    exact = rc(CURRENT)
    assert charge == pytest.approx(exact, rel=1e-7, abs=1e-9)
    assert elongation == pytest.approx(ALPHA * exact + 7e-6 * exact**2, rel=1e-7, abs=1e-12)
    assert voltage == pytest.approx((R1 * (R2 * CURRENT - exact / C) / (R1 + R2)) + exact / C, rel=1e-7, abs=1e-9)


@bases
@settings(deadline=None)
@given(charge=st.floats(-20, 20), saturation=st.floats(0.01, 1e3))
def test_strain_saturation_follows_its_equation(base, charge, saturation):
    model = stack(base, EFFECTS["strain_saturation"])(strain_saturation_coefficient=saturation**-2.0)
    model.charge = charge
    exact = ALPHA * saturation * math.tanh(charge / saturation)
    assert model.electrochemical_displacement() == pytest.approx(exact, rel=1e-13, abs=1e-300)


def test_strain_saturation_is_smooth_where_the_series_takes_over():
    cls = stack(PpyActuator, EFFECTS["strain_saturation"])
    for z in np.geomspace(0.9e-3, 1.1e-3, 201):
        model = cls(strain_saturation_coefficient=1.0)
        model.charge = float(z)
        # tanh(z) = z - z^3/3 + 2 z^5/15 - ...
        assert model.electrochemical_displacement() == pytest.approx(ALPHA * (z - z**3 / 3 + 2 * z**5 / 15), rel=5e-16)


@bases
@pytest.mark.parametrize("lag", [0.2, 3.0])
def test_strain_lag_follows_its_transfer_function(base, lag):
    cls = stack(base, EFFECTS["strain_lag"])
    elongation, _, charge = run(cls, STEP, STEPS, CURRENT, lag_time=lag)
    assert charge == pytest.approx(rc(CURRENT), rel=1e-7, abs=1e-9)
    # X_e/I = alpha R2 C (m s + 1) / (((R1 + R2) C s + 1) ((T + m) s + 1)) with m = 0.05 s
    numerator = [ALPHA * R2 * C * 0.05, ALPHA * R2 * C]
    denominator = np.polymul([(R1 + R2) * C, 1.0], [lag + 0.05, 1.0])
    time, held = STEP * np.arange(STEPS), CURRENT
    _, exact, _ = lsim((numerator, denominator), held, time, interp=False)
    assert elongation == pytest.approx(exact, rel=1e-6, abs=1e-11)


def test_strain_lag_is_a_first_order_lag():
    """The time that keeps it regular costs little: the pure lag differs by its square."""
    lag = 3.0
    elongation, _, _ = run(stack(PpyActuator, EFFECTS["strain_lag"]), STEP, STEPS, CURRENT, lag_time=lag)
    pure = ([ALPHA * R2 * C], np.polymul([(R1 + R2) * C, 1.0], [lag, 1.0]))
    _, exact, _ = lsim(pure, CURRENT, STEP * np.arange(STEPS), interp=False)
    assert np.abs(elongation - exact).max() < 0.05 * np.abs(exact).max()


def test_strain_lag_starts_at_rest_whatever_the_charge():
    cls = stack(PpyActuator, EFFECTS["strain_lag"])
    assert cls(lag_time=5.0, charge_start=2.0).electrochemical_displacement() == ALPHA * 2.0


@bases
def test_double_layer_follows_its_impedance(base):
    resistance, time_constant = 0.2, 0.3
    cls = stack(base, EFFECTS["double_layer"])
    values = {"double_layer_resistance": resistance, "double_layer_time": time_constant}
    a, b, c, d = trace(cls).linearise(**values)
    row = [o.name for o in cls.layout.outputs].index("voltage")
    for s in 1j * np.logspace(-4, 3, 30):
        branch = R1 + 1 / (s * C) + resistance / (time_constant * s + 1)
        expected = 1 / (1 / R2 + 1 / branch)
        found = (c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d)[row, 0]
        assert found == pytest.approx(expected, rel=1e-9)


@bases
def test_resistance_growth_follows_its_equation(base):
    rate = 0.02
    cls = stack(base, EFFECTS["resistance_growth"])
    _, voltage, charge = run(cls, STEP, STEPS, CURRENT, resistance_growth_rate=rate)
    state, exact = np.zeros(2), []
    for i in CURRENT:

        def law(t, y, i=i):
            r = R1 * (1 + rate * y[1])
            flow = (R2 * i - y[0] / C) / (r + R2)
            return [flow, abs(flow)]

        r = R1 * (1 + rate * state[1])
        exact.append([state[0], r * (R2 * i - state[0] / C) / (r + R2) + state[0] / C])
        state = solve_ivp(law, (0.0, STEP), state, rtol=1e-10, atol=1e-12).y[:, -1]
    exact = np.array(exact).T
    assert charge == pytest.approx(exact[0], rel=1e-6, abs=1e-8)
    assert voltage == pytest.approx(exact[1], rel=1e-6, abs=1e-8)


# --- stacks -----------------------------------------------------------------------------------------------------------


@bases
@settings(deadline=None, max_examples=40)
@given(seed=seeds)
def test_two_electrical_effects_are_the_combined_circuit(base, seed):
    for order in itertools.permutations(("double_layer", "resistance_growth")):
        cls = stack(base, *(EFFECTS[n] for n in order))
        v = random_values(cls, seed) | ACTIVE["double_layer"] | ACTIVE["resistance_growth"]
        found = named(cls, v)
        r = v["R1"] * (1 + v["resistance_growth_rate"] * v["throughput"])
        behind = v["charge"] / v["C"] + v["double_layer_resistance"] * v["faradaic_current"]
        flow = (v["R2"] * v["current"] - behind) / (r + v["R2"])
        scale = 1e-12 * (1 + abs(behind) + abs(flow))
        assert found["der(charge)"] == pytest.approx(flow, rel=1e-12, abs=scale)
        assert found["voltage"] == pytest.approx(r * flow + behind, rel=1e-12, abs=scale * (1 + r))
        assert found["der(throughput)"] == pytest.approx(abs(flow), rel=1e-12, abs=scale)
        expected = (flow - v["faradaic_current"]) / v["double_layer_time"]
        assert found["der(faradaic_current)"] == pytest.approx(expected, rel=1e-11, abs=10 * scale)


@settings(deadline=None, max_examples=40)
@given(seed=seeds)
def test_two_strain_effects_are_the_combined_law(seed):
    def elongation(*names):
        cls = stack(PpyActuator, *(EFFECTS[n] for n in names))
        values = random_values(cls, seed)
        for n in names:
            values |= ACTIVE[n]
        return named(cls, values)["electrochemical_displacement"], values

    for order in itertools.permutations(("quadratic_strain", "strain_lag")):
        found, v = elongation(*order)
        acted = v["charge"] - v["lag_time"] / (v["lag_time"] + 0.05) * v["pending_charge"]
        squared = acted if order[1] == "strain_lag" else v["charge"]  # the lag holds for what lies below it
        assert found == pytest.approx(v["alpha"] * acted + v["beta"] * squared**2, rel=1e-11, abs=1e-16)

    found, v = elongation("quadratic_strain", "strain_saturation")
    z = 0.4 * v["charge"]
    assert found == pytest.approx((v["alpha"] * v["charge"] + 7e-6 * v["charge"] ** 2) * math.tanh(z) / z, rel=1e-12)
    found, v = elongation("strain_saturation", "quadratic_strain")
    assert found == pytest.approx(v["alpha"] * math.tanh(z) / 0.4 + 7e-6 * v["charge"] ** 2, rel=1e-11, abs=1e-16)


@bases
@pytest.mark.parametrize("pair", list(itertools.combinations(EFFECTS, 2)), ids="+".join)
def test_order_does_not_matter_where_laws_differ(base, pair):
    """Elongations of three effects are laid one over the other; every other pair commutes but for rounding."""
    forth, back = (stack(base, *(EFFECTS[n] for n in order)) for order in (pair, pair[::-1]))
    values = random_values(forth, 5) | ACTIVE[pair[0]] | ACTIVE[pair[1]] | {"length_change": 5e-3, "charge": 3.0}
    values = {n: v for n, v in values.items() if n in forth.layout.names}
    one, other = named(forth, values), named(back, values)
    if {"strain_saturation", "quadratic_strain", "strain_lag"}.issuperset(pair):
        assert one["electrochemical_displacement"] != pytest.approx(other["electrochemical_displacement"], rel=1e-6)
    else:
        assert one == pytest.approx(other, rel=1e-12, abs=1e-18)


@bases
def test_all_effects_agree_on_floats_arrays_and_symbols(base):
    cls = stack(base, *EFFECTS.values())
    active = {k: v for values in ACTIVE.values() for k, v in values.items()}
    arrays = random_values(cls, 7, size=40) | active
    batch = named(cls, arrays)
    graph = trace(cls)
    rates, outputs, *_ = graph.functions()
    layout = cls.layout
    for i in range(40):
        values = {n: float(np.broadcast_to(v, 40)[i]) for n, v in arrays.items()}
        single = named(cls, values)
        point = [[values[v.name] for v in g] for g in (layout.parameters, layout.inputs, layout.states)]
        symbolic = ca.vertcat(rates(0.0, *point, []), outputs(0.0, *point, [])).full().ravel()
        assert symbolic == pytest.approx(list(single.values()), rel=1e-11, abs=1e-15)
        assert [float(v[i]) for v in batch.values()] == pytest.approx(list(single.values()), rel=1e-12, abs=1e-15)


@bases
def test_parameter_sensitivities_are_finite_at_neutral(base):
    """Identification starts there: no law may divide zero by zero in its derivative."""
    cls = stack(base, *EFFECTS.values())
    graph = trace(cls)
    expressions = ca.vertcat(graph.rates, graph.outputs)
    known = ca.vertcat(graph.parameters, graph.states)
    f = ca.Function("j", graph.arguments, [ca.jacobian(expressions, known)])
    for charge in (0.0, 1.0):
        assert np.isfinite(f(0.0, *graph.point(charge=charge, current=0.5)).full()).all()


@bases
@effects
def test_sensitivity_at_neutral_is_that_of_central_differences_and_not_zero(base, name):
    """Where identification begins: a slope of zero there would hide the effect from it."""
    time = STEP * np.arange(STEPS)
    inputs = {"current": CURRENT} | ({"force": 1.0 + 0.0 * time} if base is PpyActuator else {})
    inputs |= {"length_change": 1e-3 + 0.0 * time} if base is PpyActuatorLengthDriven else {}
    neutral, cls = NEUTRAL[name], stack(base, EFFECTS[name])
    declared = cls.declared | EFFECTS[name].declared
    found = CompiledModel(cls, [neutral]).run(time, inputs).sensitivities
    model, step = CompiledModel(cls), 1e-3 * declared[neutral].nominal
    ends = [model.run(time, inputs, {neutral: s * step}).signals for s in (1.0, -1.0)]
    seen = []
    for output in (o.name for o in base.layout.outputs):
        slope = (ends[0][output] - ends[1][output]) / (2.0 * step)
        floor = 1e-8 * np.abs(ends[0][output]).max() / step  # what the accuracy of the two runs leaves of nothing
        assert found[output][:, 0] == pytest.approx(slope, rel=1e-3, abs=1e-3 * np.abs(slope).max() + floor)
        seen.append(np.abs(slope * declared[neutral].nominal).max() / ends[0][output].std())
    assert max(seen) > 1e-3  # a change by the nominal value is seen


# --- the rule that keeps laws and measurements apart ------------------------------------------------------------------


@pytest.mark.parametrize("name", fmus.COMPONENTS)
def test_no_law_uses_an_output(name):
    """Then an effect of the measurement, laid over an output, cannot change the physics."""
    component = fmus.component(name)
    outputs = {o.name for o in component.layout.outputs}
    assert not outputs & {s.rate for s in component.layout.states}
    assert not outputs & {d.update for d in component.layout.discretes}
    classes = {part for cls in (component, *fmus.effects(name).values()) for part in cls.__mro__}
    for cls in (c for c in classes if c.__module__.startswith(component.__module__.rpartition(".")[0])):
        tree = ast.parse(textwrap.dedent(inspect.getsource(cls)))
        for law in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
            used = {node.attr for node in ast.walk(law) if isinstance(node, ast.Attribute)}
            assert not used & (outputs - {law.name}), f"{cls.__name__}.{law.name}"
