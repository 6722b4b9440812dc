"""State feedback against python-control: the whole controller as one discrete system, and its loop.

The matrices of the actuator are written anew, out of the numbers of the thesis.
"""

import control
import numpy as np
import pytest

from fmus.controllers.state_feedback import GAINS, StateFeedback, design_remark
from fmus.ppy_actuator.model import PpyActuator
from tests.support.displacement_loop import drive, worst
from tests.support.sampled import run

PERIOD, STEP = 0.02, 1e-4
R1, R2, C, ALPHA = 0.43, 2.35, 2.70, 6.8e-5
K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6


def sampled_actuator():
    """Sampled charge, Kelvin and Maxwell elongation; displacement and voltage."""
    A = np.diag([-1.0 / (C * (R1 + R2)), -K2 / B2, 0.0])
    B = np.array([[R2 / (R1 + R2), 0.0], [0.0, 1.0 / B2], [0.0, 1.0 / B1]])
    measured = np.array([[ALPHA, 1.0, 1.0], [R2 / (C * (R1 + R2)), 0.0, 0.0]])
    through = np.array([[0.0, 1.0 / K1], [R1 * R2 / (R1 + R2), 0.0]])
    return control.sample_system(control.ss(A, B, measured, through), PERIOD, method="zoh")


def whole_controller():
    """From reference, displacement, voltage, current and force to the command."""
    plant = sampled_actuator()
    A, B, H, D = plant.A, plant.B, plant.C, plant.D
    charge_noise, creep_noise = 1e-3**2, 1e-8**2
    predictor, *_ = control.dlqe(
        A,
        np.eye(3),
        H,
        np.diag([charge_noise, creep_noise, creep_noise]),
        np.diag([3e-6**2, 1e-3**2]),
    )
    L = np.linalg.inv(A) @ predictor
    poles = np.exp(-PERIOD / np.array([0.5, 1.5]))
    fed_back = control.place(
        np.array([[A[0, 0], 0.0], [-PERIOD * ALPHA, 1.0]]), np.array([[B[0, 0]], [0.0]]), poles
    )
    charge_gain, integral_gain = fed_back[0, 0], -fed_back[0, 1]
    reference_gain = integral_gain * PERIOD / (1.0 - poles[1])
    # estimate = (I - L H) (A x + B u) + L (y - D u), with u = (current, force) and y = (d, v)
    keep = np.eye(3) - L @ H
    state = np.zeros((4, 4))
    state[:3, :3] = keep @ A
    state[3, 3] = 1.0
    fed = np.zeros((4, 5))
    fed[:3, 1:3] = L
    fed[:3, 3:] = keep @ B - L @ D
    fed[3, :2] = integral_gain * PERIOD * np.array([1.0, -1.0])
    # the command takes the new estimate and the integral before this sample
    row = np.array([-charge_gain, -reference_gain, -reference_gain])
    out = np.r_[row @ state[:3, :3], 1.0]
    direct = row @ fed[:3] + reference_gain * np.array([1.0, 0.0, 0.0, 0.0, -1.0 / K1])
    return control.ss(state, fed, out[None], direct[None], PERIOD)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_discrete_system_of_observer_and_feedback(seed):
    count = 1500
    names = ("reference", "displacement", "voltage", "current", "force")
    sizes = np.array([1e-5, 1e-5, 0.05, 0.1, 0.05])
    signals = sizes[:, None] * np.random.default_rng(seed).standard_normal((5, count))
    model = StateFeedback(current_limit=1e6, charge_limit=1e9)
    found = run(model, dict(zip(names, signals, strict=True)), count)["command"]
    time = PERIOD * np.arange(count)
    expected = control.forced_response(whole_controller(), time, signals).outputs[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_the_loop_has_the_poles_that_were_placed():
    """Loop of the sampled actuator and the controller, closed by python-control."""
    plant = sampled_actuator()
    forced = control.ss(plant.A, plant.B[:, :1], plant.C, plant.D[:, :1], PERIOD)
    controller = whole_controller()
    # a command shows in the measured current one sample later: the plant's input, delayed
    delay = control.ss(0.0, 1.0, 1.0, 0.0, PERIOD)
    states = 3 + 4 + 1
    assert forced.nstates + controller.nstates + delay.nstates == states
    Ap, Bp, Hp = forced.A, forced.B, forced.C
    Ac, Bc, Hc, Dc = controller.A, controller.B, controller.C, controller.D
    # measured: x of the plant, and the current that flowed, w
    y_of_x, y_of_w = Hp, forced.D
    u_of_x = Dc[:, 1:3] @ y_of_x
    u_of_w = Dc[:, 1:3] @ y_of_w + Dc[:, 3:4]
    closed = np.block(
        [
            [Ap + Bp @ u_of_x, Bp @ Hc, Bp @ u_of_w],
            [Bc[:, 1:3] @ y_of_x, Ac, Bc[:, 1:3] @ y_of_w + Bc[:, 3:4]],
            [u_of_x, Hc, u_of_w],
        ]
    )
    poles = np.linalg.eigvals(closed)
    for time_constant in (0.5, 1.5):
        assert np.abs(poles - np.exp(-PERIOD / time_constant)).min() < 1e-6
    # creep is not moved by a current: the Maxwell dashpot's pole stays at 1, and that is all
    assert np.sum(np.abs(poles) > 1.0 - 1e-9) == 1
    assert np.abs(poles).max() < 1.0 + 1e-9


def test_the_displacement_follows_a_step_by_the_first_pole_alone():
    found = drive(StateFeedback(current_limit=100.0), PpyActuator(), np.full(500, STEP))
    expected = STEP * (1.0 - np.exp(-PERIOD * np.arange(500) / 0.5))
    assert found["displacement"] == pytest.approx(expected, rel=1e-6, abs=1e-10)


def test_a_step_within_the_limits_does_not_overshoot():
    found = drive(StateFeedback(), PpyActuator(), np.full(1000, STEP))
    outside = np.flatnonzero(np.abs(found["displacement"] - STEP) > 0.02 * STEP)
    assert found["displacement"].max() <= 1.05 * STEP
    # the least time with all of the current, 1.42 s, and ln 50 time constants of the first pole
    assert outside[-1] * PERIOD < 1.42 + np.log(50.0) * 0.5
    assert worst(found, "current") <= 1.3


def test_the_observer_knows_charge_and_creep_of_a_loaded_actuator():
    plant = PpyActuator()
    plant.force = 1.0
    controller = StateFeedback()
    drive(controller, plant, np.full(3000, STEP))
    for name in ("charge", "kelvin_elongation", "maxwell_elongation"):
        found, true = getattr(controller, name), getattr(plant, name)
        # the filter saw the load from the first sample: it starts, and stays, at the states
        assert found == pytest.approx(true, rel=0.01), name


def test_charge_stays_within_its_limit_and_the_loop_comes_back_from_a_minute_there():
    limit, wanted = 1.2, 5e-5
    references = np.r_[np.full(3000, 3e-4), np.full(600, wanted)]
    found = drive(StateFeedback(charge_limit=limit), PpyActuator(), references)
    assert worst(found, "charge") <= limit * (1.0 + 1e-9)
    assert found["charge"][2999] == pytest.approx(limit, rel=1e-6)
    # within the time constant of the circuit nothing of the minute is left
    after = found["displacement"][3000 + round((R1 + R2) * C / PERIOD) :]
    assert np.abs(after - wanted).max() < 0.02 * (limit * ALPHA - wanted)


@pytest.mark.parametrize("name", ["alpha", "R1", "R2", "C"])
@pytest.mark.parametrize("share", [0.7, 1.3])
def test_an_actuator_other_than_designed_for_gets_there_all_the_same(name, share):
    nominal = getattr(PpyActuator(), name)
    found = drive(StateFeedback(), PpyActuator(**{name: nominal * share}), np.full(2000, 7e-5))
    assert found["displacement"][-1] == pytest.approx(7e-5, rel=1e-3)


def test_the_description_tells_the_gains():
    text = design_remark(GAINS, "ppy_actuator")
    assert StateFeedback.remark == text
    assert f"charge_gain {GAINS['charge_gain']:.6g}" in text
    assert len(text.splitlines()) == 1
