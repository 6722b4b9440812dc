"""Claims: the foot moves as closed forms, energy and scipy on points in the plane say."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.foot.model import FootDynamic
from fmus.kit.integrate import Integrator
from tests.support.foot import ACTUATORS, JOINTS, jacobian, lengths_at, toe_at


def run(component, steps: int, size: float) -> None:
    integrator = Integrator(component)
    for k in range(steps):
        integrator.advance(k * size, size)


def test_arch_vibrates_as_a_damped_oscillator():
    """Without loads the joints are independent; closed form for the arch."""
    foot = FootDynamic(tm_angle_start=0.01)
    run(foot, 20, 1e-3)
    decay, frequency = 0.2 / (2 * 5e-4), math.sqrt(100.0 / 5e-4)
    damped = math.sqrt(frequency**2 - decay**2)
    t = 0.02
    expected = (
        0.01 * math.exp(-decay * t) * (math.cos(damped * t) + decay / damped * math.sin(damped * t))
    )
    assert foot.tm_angle == pytest.approx(expected, abs=1e-9)
    assert foot.ankle_angle == foot.mtp_angle == 0.0


def test_constant_tensions_do_not_hold_the_ankle():
    """Second derivative of the potential of two tensions in balance, from the points: a hilltop,
    not a valley.
    """
    po = 3.0 * 12.639 / 29.383  # by the moment arms of the reference configuration
    h = 1e-3
    potential = [
        3.0 * an + po * other for an, other, *_ in (lengths_at(s * h, 0.0) for s in (-1, 0, 1))
    ]
    curvature = (potential[0] - 2.0 * potential[1] + potential[2]) / h**2
    slope = jacobian({"an_tension": 3.0, "po_tension": po})("ankle_torque", "ankle_angle")
    assert slope == pytest.approx(-curvature, rel=1e-4)
    assert slope > 0.0


@pytest.mark.parametrize(
    ("load", "joint", "limit"), [("an", "ankle", 0.7), ("po", "ankle", -0.7), ("pl", "mtp", -0.15)]
)
def test_soft_stop_holds_at_the_limit(load, joint, limit):
    """Rest is where the stop's torque, inertia times frequency squared per angle, is that of the
    tension.
    """
    foot = FootDynamic(**{f"{load}_tension": 5.0}, ankle_damping=0.2, mtp_damping=4e-3)
    run(foot, 100, 0.1)
    angle = getattr(foot, f"{joint}_angle")
    beyond = angle - limit
    h = 1e-6
    i = ACTUATORS.index(load)
    ends = [lengths_at(angle + s * h, angle + s * h)[i] for s in (1, -1)]
    torque = -5.0 * (ends[0] - ends[1]) / (2 * h)
    assert beyond * limit > 0.0
    inertia = {"ankle": 1e-3, "mtp": 2e-5}[joint]
    assert inertia * 200.0**2 * beyond == pytest.approx(torque, rel=1e-5)


def test_energy_is_kept_without_friction():
    """Kinetic energy against the work of constant tensions and toe force, from the points alone."""
    loads = {"an_tension": 1.0, "do_tension": 0.2, "toe_force_x": -0.05, "toe_force_y": 0.1}
    friction = {f"{joint}_damping": 0.0 for joint in JOINTS}
    foot = FootDynamic(**loads, **friction)
    run(foot, 20, 0.002)

    def potential(ankle, tm, mtp):
        an, _, do, _ = lengths_at(ankle, mtp)
        toe = toe_at(ankle, tm, mtp)
        return 1.0 * an + 0.2 * do + 0.05 * toe.real - 0.1 * toe.imag + 50.0 * tm**2

    kinetic = 0.5 * (1e-3 * foot.ankle_rate**2 + 5e-4 * foot.tm_rate**2 + 2e-5 * foot.mtp_rate**2)
    assert kinetic > 1e-6
    assert 0.0 < foot.ankle_angle < 0.7
    assert 0.0 < foot.mtp_angle < 1.05
    released = potential(0.0, 0.0, 0.0) - potential(foot.ankle_angle, foot.tm_angle, foot.mtp_angle)
    assert kinetic == pytest.approx(released, rel=1e-6)


def test_motion_is_that_of_scipy_on_the_points():
    """Moment arms by finite differences of the points, equations written down once more."""
    h, loads, force = 1e-6, np.array([1.2, 0.3, 0.1, 0.05]), np.array([-0.2, 0.05])
    inertia, friction = np.array([1e-3, 5e-4, 2e-5]), np.array([0.02, 0.2, 1e-3])

    def work(q):
        toe = toe_at(*q)
        return force @ [toe.real, toe.imag] - loads @ lengths_at(q[0], q[2]) - 50.0 * q[1] ** 2

    def slope(_, s):
        q, v = s[:3], s[3:]
        torque = [(work(q + h * e) - work(q - h * e)) / (2 * h) for e in np.eye(3)]
        return np.concatenate([v, (torque - friction * v) / inertia])

    expected = solve_ivp(slope, (0.0, 0.06), np.zeros(6), rtol=1e-9, atol=1e-11).y[:, -1]
    assert np.all(expected[:3] < [0.7, 0.26, 1.05]), "before the stops"
    assert np.all(expected[:3] > [-0.7, -0.26, -0.15])
    signals = {f"{a}_tension": float(t) for a, t in zip(ACTUATORS, loads, strict=True)}
    foot = FootDynamic(**signals, toe_force_x=-0.2, toe_force_y=0.05)
    run(foot, 6, 0.01)
    found = [getattr(foot, s.name) for s in FootDynamic.layout.states]
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-6)
