"""Eq. 5.1 beside the actuator, and the example that shows it."""

import os
import subprocess
import sys
from pathlib import Path

import control
import matplotlib.image
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from demonstrations.thesis import foot
from demonstrations.thesis.motor import DcMotor, Maxwell
from tests.support.thesis_findings import claim, claims, row

ROOT = Path(__file__).parents[3]
TIMES = (1e-4, 3e-3, 0.02, 1.0)


def test_eq_5_1_is_the_motor_from_its_own_laws():
    """Angle after a voltage, against J dw/dt = K i and V = R i + K w integrated."""
    motor = DcMotor()

    def rates(t, y):
        current = (1.0 - motor.constant * y[1]) / motor.resistance
        return [y[1], motor.constant * current / motor.inertia]

    time = np.linspace(0, 0.05, 51)
    exact = solve_ivp(
        rates, (0, time[-1]), [0, 0], t_eval=time, method="Radau", rtol=1e-9, atol=1e-12
    ).y[0]
    found = control.step_response(motor.transfer_function(), time).outputs
    assert found == pytest.approx(exact, rel=1e-6, abs=1e-9)
    assert sorted(abs(control.poles(motor.transfer_function()))) == pytest.approx(
        [0.0, 1 / motor.time_constant]
    )


def test_a_shorted_motor_yields_as_its_laws_say():
    motor, load = DcMotor(), 2.75

    def rates(t, y):
        braking = motor.constant**2 / motor.resistance * y[1]
        return [y[1], (load * motor.spool - braking) / motor.inertia]

    exact = solve_ivp(
        rates, (0, 1), [0, 0], t_eval=TIMES, method="Radau", rtol=1e-10, atol=1e-14
    ).y[0]
    assert motor.displacement(load, TIMES) == pytest.approx(motor.spool * exact, rel=1e-6)


def test_holding_balances_the_torque():
    motor = DcMotor(resistance=4.0, constant=0.05, spool=0.01)
    volts, watts = motor.holding(3.0)
    assert motor.constant * volts / motor.resistance == pytest.approx(3.0 * motor.spool)
    assert watts == pytest.approx(volts**2 / motor.resistance)


def test_row_34_either_yields_under_a_lasting_load():
    muscle, motor = Maxwell(), DcMotor()
    s = control.tf("s")
    stiffness = s * 9100.0 * 1.7e6 / (1.7e6 * s + 9100.0)  # eq. 5.17
    at = np.logspace(-5, 1, 7)
    assert muscle.stiffness(at) == pytest.approx(stiffness(2j * np.pi * at), rel=1e-9)
    assert stiffness.dcgain() == 0.0 == claims(foot, 34)[0].reproduced
    assert not claims(foot, 34)[0].holds
    for body in (muscle, motor):  # a free integrator: twice the time, twice the way
        assert body.displacement(1.0, 2e6) == pytest.approx(
            2 * body.displacement(1.0, 1e6), rel=1e-3
        )
    # step response of 1/stiffness, the inertia of the rotor being the only other delay
    exact = control.step_response(1 / stiffness, np.linspace(0, 600, 7)).outputs
    assert muscle.displacement(1.0, np.linspace(0, 600, 7)) == pytest.approx(exact, rel=1e-9)
    assert f"b/k = {1.7e6 / 9100:.0f} s" in row(foot, 34).holds
    assert claim(foot, "free integrators of the motor").reproduced == 1.0


@pytest.mark.slow
def test_the_example_runs_and_draws(tmp_path):
    done = subprocess.run(
        [sys.executable, ROOT / "examples" / "dc_motor.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr
    assert "to hold it needs 1.38 V and 0.95 W" in done.stdout
    pixels = matplotlib.image.imread(tmp_path / "dc_motor.png")[..., :3]
    assert min(pixels.shape[:2]) > 300
    assert 0.003 < np.mean(pixels.min(axis=2) < 0.75) < 0.9
