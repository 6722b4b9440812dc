"""Claims: the strain follows the charge as transfer functions and closed forms on paper say."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lsim

from fmus.kit import stack
from fmus.kit.integrate import Integrator
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator
from tests.support.effect_samples import bases

R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5  # ohm, ohm, F, m/C
STEP, STEPS = 0.1, 300
CURRENT = 0.9 * np.where(np.arange(STEPS) % 50 < 25, 1.0, -1.0) + 0.2


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
    # X_e/I = alpha R2 C (r s + 1) / (((R1 + R2) C s + 1) ((T + r) s + 1)), r = m exp(-T/m), 0.05 s
    rest = 0.05 * math.exp(-lag / 0.05)
    charging, following = (R1 + R2) * C, lag + rest
    a = [[-1 / charging, 0], [ALPHA / following * (1 - rest / charging), -1 / following]]
    b = [[R2 * C / charging], [ALPHA / following * rest * R2 * C / charging]]
    c = [[0, 1]]
    _, exact, _ = lsim((a, b, c, [[0]]), CURRENT, STEP * np.arange(STEPS), interp=False)
    assert elongation == pytest.approx(exact, rel=1e-6, abs=1e-11)


@pytest.mark.parametrize("lag", [0.5, 3.0])
def test_strain_lag_is_a_first_order_lag(lag):
    """Its regularization at zero is negligible from ten times 50 ms on."""
    elongation, _, _ = run(
        stack(PpyActuator, EFFECTS["strain_lag"]), STEP, STEPS, CURRENT, lag_time=lag
    )
    pure = ([ALPHA * R2 * C], np.polymul([(R1 + R2) * C, 1.0], [lag, 1.0]))
    _, exact, _ = lsim(pure, CURRENT, STEP * np.arange(STEPS), interp=False)
    assert np.abs(elongation - exact).max() < 1e-4 * np.abs(exact).max()


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
    stage, charging = lag / 2 + 0.05 * math.exp(-lag / 0.1), (R1 + R2) * C
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
    assert np.abs(elongation - pure).max() < 0.01 * np.abs(pure).max()


def test_strain_lag_starts_at_rest_whatever_the_charge():
    cls = stack(PpyActuator, EFFECTS["strain_lag"])
    assert cls(lag_time=5.0, charge_start=2.0).electrochemical_displacement() == ALPHA * 2.0


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
