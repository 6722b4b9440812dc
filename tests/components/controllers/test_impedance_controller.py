"""Impedance control against python-control, and its limits."""

import control
import numpy as np
import pytest

from fmus.controllers.impedance_controller import ImpedanceController
from tests.support.sampled import run


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_discrete_transfer_function_of_spring_and_damper(seed):
    """F = F_0 + (K + B s/(T_f s + 1)) x - K x_0 by the backward difference."""
    rng = np.random.default_rng(seed)
    stiffness, damping, lag, period = rng.uniform([100, 1, 0.01, 0.005], [5e3, 100, 0.5, 0.1])
    count = 400
    length, rest = 1e-3 * rng.standard_normal((2, count))
    found = run(
        ImpedanceController(
            sample_period=period,
            stiffness=stiffness,
            damping=damping,
            filter_time=lag,
            preload=0.3,
            force_min=-1e6,
            force_max=1e6,
        ),
        {"length": length, "rest_length": rest},
        count,
    )["force_reference"]
    continuous = control.tf([stiffness * lag + damping, stiffness], [lag, 1.0])
    discrete = control.sample_system(continuous, period, method="backward_diff")
    answered = control.forced_response(discrete, period * np.arange(count), length).outputs
    expected = 0.3 + answered - stiffness * rest
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_a_ramp_meets_stiffness_and_damping():
    speed, period = 1e-4, 0.02
    count = 500
    length = speed * period * np.arange(count)
    model = ImpedanceController(stiffness=200.0, damping=1000.0, preload=0.4, filter_time=0.1)
    found = run(model, {"length": length}, count)["force_reference"]
    assert found[-1] == pytest.approx(0.4 + 200.0 * length[-1] + 1000.0 * speed, rel=1e-12)
    assert model.length_rate == pytest.approx(speed, rel=1e-12)


def test_it_never_pushes_and_never_pulls_beyond_its_limit():
    length = np.repeat([-0.1, 0.1, 0.0], 50)
    found = run(ImpedanceController(), {"length": length}, 150)["force_reference"]
    assert found[0] == 0.0
    assert found[49] == 0.0
    assert found[99] == 3.0
    # what the filter of 50 ms still has of the fall by 0.1 m
    falling = -0.1 / (0.05 + 0.02) * (0.05 / (0.05 + 0.02)) ** 49
    assert found[-1] == pytest.approx(0.5 + 50.0 * falling, rel=1e-12)
