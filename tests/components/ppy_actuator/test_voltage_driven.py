"""Claims: the voltage-driven actuator follows scipy and eq. 3.9, and is the current-driven one that
its voltage drives, with any effect that both have.
"""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fmus
from fmus.kit import stack
from fmus.kit.errors import UserError
from fmus.kit.integrate import Integrator
from fmus.kit.symbolic.tracing import trace
from fmus.ppy_actuator.model import PpyActuator, PpyActuatorVoltageDriven
from orchestration.fmu.model import find_model
from orchestration.fmu.simulation import simulate
from tests.support.effect_samples import ACTIVE, NEUTRAL, random_values
from tests.support.laws import named

R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6
STEP, STEPS = 0.05, 1200
TIME = STEP * np.arange(STEPS + 1)
VOLTAGE = np.where(TIME % 10.0 < 5.0, 0.6, -0.6)  # fig. 4-8
FORCE = np.where(TIME < 20.0, 1.0, 2.5)
EFFECTS = fmus.effects("ppy_actuator_voltage_driven")
effects = pytest.mark.parametrize("name", EFFECTS)


def by_scipy():
    """Current and displacement of the circuit and the chain at a held voltage and load."""
    state, rows = np.zeros(3), []
    for voltage, force in zip(VOLTAGE, FORCE, strict=True):
        rows.append(
            [
                (voltage - state[0] / C) / R1 + voltage / R2,
                ALPHA * state[0] + state[1] + state[2] + force / K1,
                state[0],
            ]
        )

        def rates(t, y, v=voltage, f=force):
            return [(v - y[0] / C) / R1, (f - K2 * y[1]) / B2, f / B1]

        state = solve_ivp(rates, (0, STEP), state, rtol=1e-11, atol=1e-15, method="DOP853").y[:, -1]
    return np.array(rows).T


@pytest.mark.parametrize("runtime", ["native", "python"])
def test_both_builds_follow_scipy(runtime):
    found = simulate(
        find_model("ppy_actuator_voltage_driven", runtime),
        TIME,
        {"voltage": VOLTAGE, "force": FORCE},
        {},
    )
    names = ("current", "displacement", "charge")
    for name, exact in zip(names, by_scipy(), strict=True):
        assert np.abs(found[name] - exact).max() < 1e-6 * np.abs(exact).max(), name


def test_the_current_has_the_inverse_of_eq_3_9():
    a, b, c, d = trace(PpyActuatorVoltageDriven).linearise()
    layout = PpyActuatorVoltageDriven.layout
    row = [o.name for o in layout.outputs].index("current")
    column = [i.name for i in layout.inputs].index("voltage")
    system = control.ss(a, b[:, [column]], c[[row], :], d[[row], column])
    s = 1j * np.logspace(-4, 3, 30)
    impedance = (R1 * R2 * C * s + R2) / ((R1 + R2) * C * s + 1)
    assert system(s) == pytest.approx(1 / impedance, rel=1e-9)


def test_its_signals_are_those_of_a_potentiostat():
    assert {i.name for i in PpyActuatorVoltageDriven.layout.inputs} == {"voltage", "force"}
    assert "voltage" not in {o.name for o in PpyActuatorVoltageDriven.layout.outputs}


def test_a_circuit_that_limits_no_current_is_refused():
    model = find_model("ppy_actuator_voltage_driven")
    with pytest.raises(UserError, match=r"R1.*out of range"):
        model.settings(["R1=0"])


def test_the_catalogue_is_all_that_is_not_solved_for_the_voltage():
    assert set(fmus.effects("ppy_actuator")) - set(EFFECTS) == {"nonlinear_leakage"}


@effects
@pytest.mark.parametrize("seed", range(20))
def test_an_effect_is_the_same_in_both_causalities(name, seed):
    """Given the voltage of the current-driven component, the voltage-driven one answers with its
    current: at any state, and with the same rates and elongations.
    """
    pair = [stack(cls, EFFECTS[name]) for cls in (PpyActuator, PpyActuatorVoltageDriven)]
    values = random_values(pair[0], seed) | ACTIVE[name]
    given = named(pair[0], values)
    back = named(
        pair[1], {n: v for n, v in values.items() if n != "current"} | {"voltage": given["voltage"]}
    )
    assert back["current"] == pytest.approx(values["current"], rel=1e-9, abs=1e-9)
    for signal in set(given) & set(back):
        assert back[signal] == pytest.approx(given[signal], rel=1e-8, abs=1e-12), signal


@effects
def test_an_effect_at_its_neutral_value_is_the_base_model(name):
    cls = stack(PpyActuatorVoltageDriven, EFFECTS[name])
    values = random_values(cls, 5) | {NEUTRAL[name]: 0.0}
    base = {n: v for n, v in values.items() if n in set(PpyActuatorVoltageDriven.layout.names)}
    expected, found = named(PpyActuatorVoltageDriven, base), named(cls, values)
    assert {n: found[n] for n in expected} == expected


def test_driven_with_the_voltage_of_the_other_it_is_the_other():
    """Over a minute of the current of fig. 3-4, the voltage exchanged every millisecond."""
    step, driven, driving = 1e-3, PpyActuatorVoltageDriven(), PpyActuator()
    pair = [(model, Integrator(model)) for model in (driving, driven)]
    driven.force = driving.force = 2.0
    worst = 0.0
    for k in range(6000):
        driving.current = 0.9 if (k * step) % 5.0 < 2.5 else -0.9
        before = driving.voltage()
        pair[0][1].advance(k * step, step)
        driven.voltage = 0.5 * (before + driving.voltage())
        pair[1][1].advance(k * step, step)
        worst = max(worst, abs(driven.charge - driving.charge))
    assert worst < 1e-6
    assert driven.displacement() == pytest.approx(driving.displacement(), abs=1e-10)
