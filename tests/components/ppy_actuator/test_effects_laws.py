"""What the README says of each effect, written out again here: at any instant by root finding, in
time on paper.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.signal import lsim

from fmus.kit import stack
from fmus.kit.integrate import Integrator
from fmus.kit.symbolic.tracing import trace
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support.effect_samples import ACTIVE, active, bases, effects, named, random_values

R1, R2, C, ALPHA, K1, B1, K2, B2 = 0.43, 2.35, 2.70, 6.8e-5, 6300.0, 1.7e6, 1.0e4, 2.0e6
STEP, STEPS = 0.1, 300
CURRENT = 0.9 * np.where(np.arange(STEPS) % 50 < 25, 1.0, -1.0) + 0.2


# --- at an instant: every effect, alone and all at once
# ---------------------------------------------------------------


def root(function, about):
    """Root of a function that rises."""
    width = 1e-3 * (1.0 + abs(about))
    while function(about - width) > 0.0 or function(about + width) < 0.0:
        width *= 4.0
    return brentq(
        function,
        about - width,
        about + width,
        xtol=1e-300,
        rtol=4 * np.finfo(float).eps,
        maxiter=500,
    )


def paper(v):
    """Rates and outputs from the table of the README; ``v`` gives what is there, the rest of the
    effects is absent.
    """
    p = {n: 0.0 for effect in EFFECTS.values() for n in effect.declared}
    p |= {"thermal_resistance": 1.0, "softening_load": 1.0, "fading_load": 1.0}
    p |= {n: 1.0 for n in p if n.endswith(("_time", "_width")) and "lag_time" not in n} | v
    q, i = p["charge"], p["current"]

    # coupling, as layers in the order of the catalogue
    seen = (
        q
        - p["hysteresis_share"] * p["trailing_charge"]
        - p["lag_time"] / (p["lag_time"] + 0.05) * p["pending_charge"]
    )
    stage = p["staged_lag_time"] / 2 + 0.05
    seen -= p["staged_lag_time"] / 2 / stage * (p["first_stage_charge"] + p["second_stage_charge"])
    z = math.sqrt(p["strain_saturation_coefficient"]) * seen
    level = math.tanh(z) / z if z else 1.0
    strain = (p["alpha"] * seen + p["beta"] * seen**2 + p["strain_asymmetry"] * abs(seen)) * level
    strain /= 1.0 + p["strain_levelling"] * abs(seen)

    # mechanics: elongation of the chain as a function of the load, and the load from the length
    soft = math.exp(p["softening_per_charge"] * q)
    creep = p["kelvin_elongation"] + p["maxwell_elongation"]
    creep += p["second_creep_compliance"] * p["second_kelvin_force"]

    def spring(load):
        load = load * (1.0 + p["fading_compliance"] / (1.0 + abs(load) / p["fading_load"]))
        load = load + p["slack_compliance"] * min(load, p["preload"])
        scale = p["softening_load"]
        return soft / p["k1"] * (load + p["load_softening"] * (math.hypot(load, scale) - scale))

    if "force" in p:
        load = p["force"]
    else:
        left = p["length_change"] - strain - creep
        load = root(lambda f: spring(f) - left, p["k1"] * left) if left > 0.0 else 0.0
    kelvin = (load - p["k2"] / soft * p["kelvin_elongation"]) / p["b2"]
    slower = 1.0 + p["recovery_slowness"] if kelvin < 0.0 else 1.0
    flowing = math.copysign(max(abs(load) - p["yield_force"], 0.0), load)

    # circuit: Kirchhoff's law at the terminal, and what is across the parts between it and the
    # films
    resistance = p["R1"] * (1.0 + p["resistance_growth_rate"] * p["throughput"])
    resistance /= 1.0 + p["conductance_rise_per_kelvin"] * p["temperature_rise"]
    films = q / p["C"] * (1.0 + p["capacitance_fade_rate"] * p["fading_throughput"])
    if a := p["capacitance_falloff"] * q:
        films *= math.expm1(a) / a
    if a := p["capacitance_falloff_either_way"] * abs(q):
        films *= math.expm1(a) / a
    films *= (1.0 + abs(p["capacitance_bend"]) * q**2) ** math.copysign(0.5, p["capacitance_bend"])
    poles = [((2 * k - 1) * math.pi / 2) ** 2 for k in range(1, 6)]
    part = p["diffusion_share"] * resistance
    rest = resistance - part * sum(2.0 / pole for pole in poles)
    behind = (
        films + p["double_layer_resistance"] * p["faradaic_current"] + p["voltage_per_force"] * load
    )
    behind += part * sum(
        2.0 / pole * p[f"diffusion_current_{k}"] for k, pole in enumerate(poles, 1)
    )

    def surplus(voltage):
        above = max(abs(voltage) - p["leakage_onset"], 0.0)
        leak = voltage / p["R2"] + math.copysign(p["leakage_growth"] * above**2, voltage)
        return (voltage - behind) / rest + leak - i

    voltage = root(surplus, behind)
    j = (voltage - behind) / rest

    found = {
        "voltage": voltage,
        "electrochemical_displacement": strain,
        "der(charge)": j,
        "mechanical_displacement": creep + spring(load),
        "der(kelvin_elongation)": kelvin / slower,
        "der(maxwell_elongation)": flowing / p["b1"],
        "der(faradaic_current)": (j - p["faradaic_current"]) / p["double_layer_time"],
        "der(throughput)": abs(j),
        "der(fading_throughput)": abs(j),
        "der(temperature_rise)": (
            p["thermal_resistance"] * (voltage * i - films * j) - p["temperature_rise"]
        )
        / p["thermal_time"],
        "der(first_stage_charge)": j - p["first_stage_charge"] / stage,
        "der(second_stage_charge)": (p["first_stage_charge"] - p["second_stage_charge"]) / stage,
        "der(pending_charge)": j - p["pending_charge"] / (p["lag_time"] + 0.05),
        "der(trailing_charge)": j - abs(j) * p["trailing_charge"] / p["hysteresis_width"],
        "der(second_kelvin_force)": (load - p["second_kelvin_force"]) / p["second_creep_time"],
    }
    found |= {
        f"der(diffusion_current_{k})": (j - p[f"diffusion_current_{k}"])
        * pole
        / p["diffusion_time"]
        for k, pole in enumerate(poles, 1)
    }
    total = {"displacement": strain + creep + spring(load)} if "force" in p else {"tension": load}
    return found | total


def check_against_paper(cls, values):
    found, expected = named(cls, values), paper(values)
    # below these, terms have cancelled: metres, and volts, amperes and newtons
    floors = {True: 1e-13, False: 1e-10 * (1.0 + abs(values["charge"]) + abs(values["current"]))}
    for name, value in found.items():
        floor = floors["elongation" in name or "displacement" in name]
        assert value == pytest.approx(expected[name], rel=1e-9, abs=floor), name


@bases
@effects
@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_an_effect_is_what_the_readme_says(base, name, seed):
    cls = stack(base, EFFECTS[name])
    check_against_paper(cls, random_values(cls, seed) | ACTIVE[name])


@bases
@settings(deadline=None, max_examples=100)
@given(seed=st.integers(0, 2**32 - 1))
def test_all_effects_together_are_what_the_readme_says(base, seed):
    cls = stack(base, *EFFECTS.values())
    check_against_paper(cls, random_values(cls, seed) | active(EFFECTS))


@bases
def test_all_effects_together_run_as_scipy_integrates_them(base):
    cls = stack(base, *EFFECTS.values())
    values = active(EFFECTS) | {"b1": 1e5, "b2": 1e5}  # to creep within seconds
    given = {p.name: float(p.start) for p in cls.layout.parameters} | values
    states = [s.name for s in cls.layout.states]
    model = cls(**values)
    integrator, expected, size = Integrator(model), np.zeros(len(states)), np.zeros(len(states))
    nominal = np.array([s.nominal for s in cls.layout.states])
    for k in range(8):
        inputs = {"current": 0.9 if k % 6 < 3 else -0.7}
        pulled = k % 8 < 5
        inputs |= (
            {"force": 2.0 * pulled} if base is PpyActuator else {"length_change": 8e-4 * pulled}
        )
        for name, value in inputs.items():
            setattr(model, name, value)
        integrator.advance(k * 0.5, 0.5)

        def law(t, y, inputs=inputs):
            rates = paper(given | inputs | dict(zip(states, y, strict=True)))
            return [rates[f"der({name})"] for name in states]

        expected = solve_ivp(law, (0.0, 0.5), expected, rtol=1e-8, atol=1e-11).y[:, -1]
        size = np.maximum(size, np.abs(expected))
        found = np.array([getattr(model, name) for name in states])
        assert (np.abs(found - expected) <= 1e-7 * (nominal + size)).all(), (k, states)
    assert (size > 0.01 * nominal).all(), "every state takes part"


# --- in time, on paper
# ------------------------------------------------------------------------------------------------


def run(cls, step, steps, current, **values):
    """Displacement due to charge, voltage and charge at the communication points; currents are
    held.
    """
    model = cls(**values)
    integrator = Integrator(model)
    rows = []
    for k in range(steps):
        model.current = float(current[k])
        rows.append([model.electrochemical_displacement(), model.voltage(), model.charge])
        integrator.advance(k * step, step)
    return np.array(rows).T


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
    assert voltage == pytest.approx(
        (R1 * (R2 * CURRENT - exact / C) / (R1 + R2)) + exact / C, rel=1e-7, abs=1e-9
    )


@bases
@settings(deadline=None)
@given(charge=st.floats(-20, 20), saturation=st.floats(0.01, 1e3))
def test_strain_saturation_follows_its_equation(base, charge, saturation):
    model = stack(base, EFFECTS["strain_saturation"])(
        strain_saturation_coefficient=saturation**-2.0
    )
    model.charge = charge
    exact = ALPHA * saturation * math.tanh(charge / saturation)
    assert model.electrochemical_displacement() == pytest.approx(exact, rel=1e-13, abs=1e-300)


def test_strain_saturation_is_smooth_where_the_series_takes_over():
    cls = stack(PpyActuator, EFFECTS["strain_saturation"])
    for z in np.geomspace(0.9e-3, 1.1e-3, 201):
        model = cls(strain_saturation_coefficient=1.0)
        model.charge = float(z)
        # tanh(z) = z - z^3/3 + 2 z^5/15 - ...
        assert model.electrochemical_displacement() == pytest.approx(
            ALPHA * (z - z**3 / 3 + 2 * z**5 / 15), rel=5e-16
        )


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
    elongation, _, _ = run(
        stack(PpyActuator, EFFECTS["strain_lag"]), STEP, STEPS, CURRENT, lag_time=lag
    )
    pure = ([ALPHA * R2 * C], np.polymul([(R1 + R2) * C, 1.0], [lag, 1.0]))
    _, exact, _ = lsim(pure, CURRENT, STEP * np.arange(STEPS), interp=False)
    assert np.abs(elongation - exact).max() < 0.05 * np.abs(exact).max()


@pytest.mark.parametrize("lag", [0.3, 3.0])
def test_strain_lag_in_two_stages_follows_its_transfer_function(lag):
    """From the state equations of its description, and near two lags without the time that keeps
    them regular.
    """
    elongation, _, _ = run(
        stack(PpyActuator, EFFECTS["strain_lag(two_stages)"]),
        STEP,
        STEPS,
        CURRENT,
        staged_lag_time=lag,
    )
    stage, charging = lag / 2 + 0.05, (R1 + R2) * C
    share = lag / 2 / stage
    a = [[-1 / charging, 0, 0], [-1 / charging, -1 / stage, 0], [0, 1 / stage, -1 / stage]]
    b = [[R2 * C / charging], [R2 * C / charging], [0]]
    c = [[ALPHA, -ALPHA * share, -ALPHA * share]]
    _, exact, _ = lsim((a, b, c, [[0]]), CURRENT, STEP * np.arange(STEPS), interp=False)
    assert elongation == pytest.approx(exact, rel=1e-6, abs=1e-11)
    two = (
        [ALPHA * R2 * C],
        np.polymul([charging, 1.0], np.polymul([lag / 2, 1.0], [lag / 2, 1.0])),
    )
    _, pure, _ = lsim(two, CURRENT, STEP * np.arange(STEPS), interp=False)
    assert np.abs(elongation - pure).max() < 0.05 * np.abs(pure).max()


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


def impedance(cls, frequencies, **values):
    """Voltage per current of the linearised model at s = j omega."""
    a, b, c, d = trace(cls).linearise(**values)
    row = [o.name for o in cls.layout.outputs].index("voltage")
    return np.array(
        [(c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d)[row, 0] for s in 1j * frequencies]
    )


@bases
def test_diffusion_has_the_impedance_of_a_layer(base):
    """Five sections of infinitely many: what the others would add is the tail of a series, and
    nothing at rest.
    """
    share, time, omega = 0.6, 7.0, np.logspace(-4, 3, 30)
    found = impedance(
        stack(base, EFFECTS["diffusion"]), omega, diffusion_share=share, diffusion_time=time
    )
    branch = 1.0 / (1.0 / found - 1.0 / R2)
    s = 1j * omega
    layer = np.tanh(np.sqrt(s * time)) / np.sqrt(s * time)
    exact = (1.0 - share) * R1 + share * R1 * layer + 1.0 / (s * C)
    poles = ((np.arange(5) + 0.5) * np.pi) ** 2
    tail = (
        share
        * R1
        * np.minimum(1.0 - np.sum(2.0 / poles), omega * time * (1.0 / 3.0 - np.sum(2.0 / poles**2)))
    )
    assert (np.abs(branch - exact) <= tail + 1e-9 * np.abs(exact)).all()
    assert tail.max() < 0.041 * share * R1


def test_charge_dependent_capacitance_is_the_integral_of_its_differential_one():
    a = 0.15
    model = stack(PpyActuator, EFFECTS["charge_dependent_capacitance"])(capacitance_falloff=a)
    for charge in (-8.0, -1e-3, 1e-6, 0.5, 5.0):
        model.charge = charge
        exact = quad(lambda q: 1.0 / (C * math.exp(-a * q)), 0.0, charge, epsabs=0.0, epsrel=1e-13)[
            0
        ]
        assert model.film_voltage() == pytest.approx(exact, rel=1e-12)


def test_capacitance_that_depends_on_the_modulus_of_the_charge():
    """Its differential values, by central differences: C exp(-a |Q|), and even about zero to the
    second order.
    """
    slopes = {}
    for name, values in (
        ("modulus", {"capacitance_falloff_either_way": -0.12}),
        ("even", {"capacitance_bend": -0.07}),
    ):
        model = stack(PpyActuator, EFFECTS[f"charge_dependent_capacitance({name})"])(**values)
        for charge in (-8.0, -1.5, 0.02, 0.9, 5.0):
            ends = []
            for model.charge in (charge - 1e-4, charge + 1e-4):
                ends.append(model.film_voltage())
            slopes[name, charge] = 2e-4 / (ends[1] - ends[0])
    for charge in (-8.0, -1.5, 0.02, 0.9, 5.0):
        assert slopes["modulus", charge] == pytest.approx(
            C * math.exp(0.12 * abs(charge)), rel=1e-6
        )
        assert slopes["even", charge] == pytest.approx(C * (1 + 0.07 * charge**2) ** 1.5, rel=1e-6)


def test_self_heating_ends_where_supply_and_loss_balance():
    """Charged, all of the current leaks: P = R2 i^2. Warming is slow, and follows an exponential in
    the end.
    """
    cls = stack(PpyActuator, EFFECTS["self_heating"])
    model = cls(
        conductance_rise_per_kelvin=0.02,
        thermal_resistance=30.0,
        thermal_time=400.0,
        charge_start=R2 * C * 0.9,
    )
    model.current, rise = 0.9, 30.0 * R2 * 0.9**2
    integrator = Integrator(model)
    for k in range(6):
        assert model.temperature_rise == pytest.approx(
            rise * -math.expm1(-k * 200.0 / 400.0), rel=1e-6
        )
        integrator.advance(k * 200.0, 200.0)
    model.current = 1.9  # at once, through the series resistance only
    jump = (0.43 / (1.0 + 0.02 * model.temperature_rise)) * 1.0
    assert model.voltage() - R2 * 0.9 == pytest.approx(jump * R2 / (jump + R2), rel=1e-9)


def test_force_to_voltage_drives_charge_through_the_leakage():
    """Under a load that is put on without a current: Q = -s F C (1 - exp(-t / ((R1 + R2) C)))."""
    model = stack(PpyActuator, EFFECTS["force_to_voltage"])(voltage_per_force=0.05)
    model.force = 2.0
    assert model.voltage() == pytest.approx(0.05 * 2.0 * R2 / (R1 + R2), rel=1e-12)
    Integrator(model).advance(0.0, 4.0)
    assert model.charge == pytest.approx(
        0.05 * 2.0 * C * math.expm1(-4.0 / ((R1 + R2) * C)), rel=1e-7
    )


@bases
def test_strain_hysteresis_follows_the_charge_from_turn_to_turn(base):
    """Along a rising or falling charge z approaches w or -w exponentially in the charge, however
    fast it moves.
    """
    share, width, charge, trailing = 0.3, 0.4, rc(CURRENT), [0.0]
    for before, after in pairwise(charge):
        limit = math.copysign(width, after - before)
        trailing.append(limit + (trailing[-1] - limit) * math.exp(-abs(after - before) / width))
    cls = stack(base, EFFECTS["strain_hysteresis"])
    elongation, _, _ = run(
        cls, STEP, STEPS, CURRENT, hysteresis_share=share, hysteresis_width=width
    )
    assert elongation == pytest.approx(
        ALPHA * (charge - share * np.array(trailing)), rel=1e-6, abs=1e-11
    )
    assert max(trailing) > 0.9 * width, "the loop is reached"


def creep_under(cls, loads, **values):
    """Mechanical displacement of the force-driven actuator after each (load, duration), the load
    still on.
    """
    model, time, found = cls(**values), 0.0, []
    integrator = Integrator(model)
    for load, duration in loads:
        model.force = load
        integrator.advance(time, duration)
        time += duration
        found.append(model.mechanical_displacement())
    return found


def test_second_kelvin_creeps_exponentially():
    loads, values = (
        [(2.0, 5.0), (2.0, 10.0), (0.5, 4.0)],
        {"second_creep_compliance": 4e-5, "second_creep_time": 8.0},
    )
    found = np.subtract(
        creep_under(stack(PpyActuator, EFFECTS["second_kelvin"]), loads, **values),
        creep_under(PpyActuator, loads),
    )
    after = 2.0 * -math.expm1(-15.0 / 8.0)
    exact = [
        4e-5 * f
        for f in (2.0 * -math.expm1(-5.0 / 8.0), after, 0.5 + (after - 0.5) * math.exp(-4.0 / 8.0))
    ]
    assert found == pytest.approx(exact, rel=1e-6)


def test_asymmetric_creep_recovers_slower():
    cls, tau = stack(PpyActuator, EFFECTS["asymmetric_creep"]), B2 / K2
    crept, recovered = creep_under(cls, [(2.0, 100.0), (0.0, 100.0)], recovery_slowness=0.7)
    flow, kelvin = 2.0 * 100.0 / B1, 2.0 / K2 * -math.expm1(-100.0 / tau)
    assert crept == pytest.approx(2.0 / K1 + flow + kelvin, rel=1e-7)
    assert recovered == pytest.approx(flow + kelvin * math.exp(-100.0 / tau / 1.7), rel=1e-7)


def test_yield_threshold_leaves_small_loads_without_flow():
    cls = stack(PpyActuator, EFFECTS["yield_threshold"])
    found = creep_under(cls, [(0.6, 50.0), (2.0, 50.0), (0.0, 1e5)], yield_force=0.7)
    tau = B2 / K2
    assert found[0] == pytest.approx(0.6 / K1 + 0.6 / K2 * -math.expm1(-50.0 / tau), rel=1e-7)
    assert found[2] == pytest.approx((2.0 - 0.7) * 50.0 / B1, rel=1e-6), (
        "what is left in the end has flowed"
    )


@pytest.mark.parametrize(
    ("name", "values", "elongations"),
    [
        # in units of 1/k1, at 0, 0.4, 1 and 2.5 N
        ("slack", {"slack_compliance": 1.5, "preload": 0.8}, [0.0, 1.0, 2.2, 3.7]),
        (
            "slack(smooth)",
            {"fading_compliance": 1.5, "fading_load": 0.6},
            [0.0, 0.4 + 0.36, 1.0 + 0.5625, 2.5 + 2.25 / 3.1],
        ),
        (
            "nonlinear_stiffness",
            {"load_softening": 0.4, "softening_load": 0.75},
            [0.0, 0.4 + 0.4 * 0.1, 1.0 + 0.4 * 0.5, 2.5 + 0.4 * (math.hypot(2.5, 0.75) - 0.75)],
        ),
    ],
)
def test_springs_go_through_points_that_are_known(name, values, elongations):
    model = stack(PpyActuator, EFFECTS[name])(**values)
    for force, elongation in zip((0.0, 0.4, 1.0, 2.5), elongations, strict=True):
        assert model.spring_elongation(force) == pytest.approx(elongation / K1, rel=1e-14)
        assert model.spring_force(elongation / K1) == pytest.approx(force, rel=1e-14)
