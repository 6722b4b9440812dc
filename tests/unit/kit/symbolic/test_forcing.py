"""Claims: what an effect adds along a trajectory is what its laws say there, in every setting.

Oracles: laws written out by hand, lags and ramps on paper, `solve_ivp` for loops.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit import Component, Effect, Input, Output, Parameter, State, maximum, sin
from fmus.kit.arms import lag_effect
from fmus.kit.curves import curve
from fmus.kit.inputs import backlash, input_saturation
from fmus.kit.sensors import sensor_drift, sensor_gain, sensor_offset
from fmus.kit.symbolic.forcing import ComponentAlong, EffectForcing, Points
from tests.support.regression_model import Amplifier

N = 41
STEP = 0.05
RNG = np.random.default_rng(11)


class Pendulum(Component):
    """A driven pendulum, of which the torque of the drive is shown too."""

    name = "pendulum"
    pull = Parameter(4.0, "1/s^2", min=0)
    drag = Parameter(0.5, "1/s", min=0)
    torque = Input("1/s^2")
    angle = State("rad", rate="angle_rate", start=0.2)
    speed = State("rad/s", rate="speed_rate")

    def angle_rate(self):
        return self.speed

    def gravity(self):
        return self.pull * sin(self.angle)

    def friction(self):
        return self.drag * self.speed

    def speed_rate(self):
        return self.torque - self.gravity() - self.friction() + 0.1 * self.time

    @Output("rad/s")
    def shown(self):
        """Of both states and of the input."""
        return self.speed + self.angle * self.angle + 2.0 * self.torque


class Drained(Effect):
    """A share of gravity that is left: neutral is the most there can be, beyond is nonsense."""

    id = "drained"
    neutral = "left"
    assumption = "all is there"
    left = Parameter(1.0, "1", min=0.0, max=1.0)

    def gravity(self):
        return (self.left * self.left + 1e3 * maximum(self.left - 1.0, 0.0)) * super().gravity()


def points(inputs, states, step=STEP):
    """Return begin and end of steps, with inputs that are held and states that go on."""
    time = step * np.arange(inputs.shape[1])[np.newaxis]
    begin = Points(time, inputs, states)
    return begin, Points(following(time), inputs, following(states))


def following(values):
    return np.hstack([values[:, 1:], values[:, -1:]])


def swinging():
    """Any course will do: laws are evaluated at points."""
    return points(RNG.uniform(-1.0, 1.0, (1, N)), RNG.uniform(-2.0, 2.0, (2, N)))


def along(begin, end, **parameters):
    return ComponentAlong(Pendulum, parameters, begin, end)


def amplified(u, linear=False, step=STEP):
    begin, end = points(u[np.newaxis], np.zeros((0, u.size)), step=step)
    if linear:
        end = replace(end, inputs=following(begin.inputs))
    return ComponentAlong(Amplifier, {"gain": 2.0}, begin, end)


# --- effects without states
# --------------------------------------------------------------------------------------------------


def test_a_derivative_and_differences_of_a_law_at_both_sides_of_every_step():
    """A cubic spring more in the pendulum: c x^3, of any size, in the rate of the speed only."""
    begin, end = swinging()
    cubic = curve(Pendulum, "gravity", "angle", "cubic", "1/s^2", 1.0)
    settings = [{cubic.neutral: amount} for amount in (0.0, 3.0, -20.0)]
    found = EffectForcing(along(begin, end), cubic).of(settings)
    for side, at in ((found.begin, begin), (found.end, end)):
        for k, factor in enumerate((1.0, 3.0, -20.0)):
            assert side[:, 1, k] == pytest.approx(-factor * at.states[0] ** 3, rel=1e-6, abs=1e-8)
        assert not side[:, 0].any()
    assert not found.shown.any()


def test_a_difference_is_that_of_all_of_the_effect():
    """At the ends of a switch: the remaining share squared, and the derivative where it is 1."""
    begin, end = swinging()
    found = EffectForcing(along(begin, end), Drained).of([{"left": 1.0}, {"left": 0.5}])
    gravity = 4.0 * np.sin(begin.states[0])
    assert found.begin[:, 1, 0] == pytest.approx(-2.0 * gravity, rel=1e-5)
    assert found.begin[:, 1, 1] == pytest.approx(0.75 * gravity, rel=1e-12)


def test_other_parameters_of_an_effect_and_of_the_component_count():
    begin, end = swinging()
    friction = curve(Pendulum, "friction", "speed", "sign", "1/s^2", 1.0)
    width = next(n for n in friction.declared if n != friction.neutral)
    settings = [{friction.neutral: 2.0, width: w} for w in (0.1, 1.0)]
    found = EffectForcing(along(begin, end, drag=3.0), friction).of(settings)
    for k, w in enumerate((0.1, 1.0)):
        expected = -2.0 * np.tanh(begin.states[1] / w)
        assert found.begin[:, 1, k] == pytest.approx(expected, rel=1e-9)


def test_an_effect_of_an_input_comes_in_wherever_the_input_does():
    """x / sqrt(1 + c x^2) arrives, in the rate and in the output that shows twice the torque."""
    begin, end = swinging()
    saturation = input_saturation(Pendulum, "torque")
    found = EffectForcing(along(begin, end), saturation).of(
        [{saturation.neutral: 0.0}, {saturation.neutral: 7.0}]
    )
    u = begin.inputs[0]
    for k, expected in enumerate((-0.5 * u**3, u / np.sqrt(1.0 + 7.0 * u**2) - u)):
        assert found.begin[:, 1, k] == pytest.approx(expected, rel=1e-4, abs=1e-7)
        assert found.shown[:, 0, k] == pytest.approx(2.0 * expected, rel=1e-4, abs=1e-7)


def test_sensors_show_what_they_add():
    begin, end = swinging()
    component = along(begin, end)
    angle, speed = begin.states
    shown = speed + angle**2 + 2.0 * begin.inputs[0]
    elapsed = begin.time[0]
    for make, expected in (
        (sensor_gain, shown),
        (sensor_offset, np.ones(N)),
        (sensor_drift, elapsed),
    ):
        effect = make(Pendulum, "shown")
        neutral = effect.declared[effect.neutral].start
        found = EffectForcing(component, effect).of([{effect.neutral: neutral}])
        assert found.shown[:, 0, 0] == pytest.approx(expected, rel=1e-6, abs=1e-8)
        assert not found.begin.any()
        assert not found.end.any()
    gain = sensor_gain(Pendulum, "shown")
    found = EffectForcing(component, gain).of([{gain.neutral: 1.5}])
    assert found.shown[:, 0, 0] == pytest.approx(0.5 * shown, rel=1e-12)


# --- effects with states
# --------------------------------------------------------------------------------------------------


def lagging(time):
    lag = lag_effect(Amplifier, "amplified", "signal", "lagging", time, "V")
    amount, constant = (n for n in lag.declared if n in lag.layout.parameter_index)
    return lag, amount, constant


@pytest.mark.parametrize("step", [0.1, 2.0])
def test_a_lag_of_two_steps_is_the_one_on_paper_in_all_settings(step):
    """At rest before the record, then at u = 1 and, after 4 s, at 3; each constant has its course,
    exact in steps of any length.
    """
    lag, amount, constant = lagging(1.0)
    time = step * np.arange(round(8.0 / step) + 1)
    u = np.where(time < 4.0 - 1e-9, 1.0, 3.0)
    settings = [{amount: a, constant: T} for a, T in ((0.0, 0.5), (0.7, 0.5), (0.0, 2.0))]
    found = EffectForcing(amplified(u, step=step), lag).of(settings)
    since = np.maximum(time - 4.0, 0.0)
    constants = np.array([0.5, 0.5, 2.0])
    rise, again = (1.0 - np.exp(-t[:, np.newaxis] / constants) for t in (time, since))
    exact = (rise + 2.0 * again) * np.array([1.0, 0.7, 1.0])
    assert found.shown[:, 0] == pytest.approx(exact, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("step", [0.02, 0.5])
def test_a_lag_of_a_line_that_is_interpolated_is_the_one_on_paper(step):
    lag, amount, constant = lagging(1.0)
    time = step * np.arange(51)
    found = EffectForcing(amplified(time, linear=True, step=step), lag).of(
        [{amount: 0.0, constant: 0.4}]
    )
    expected = time - 0.4 * (1.0 - np.exp(-time / 0.4))
    assert found.shown[:, 0, 0] == pytest.approx(expected, rel=1e-5, abs=1e-8)


@pytest.mark.parametrize(("step", "error"), [(0.002, 2e-3), (0.05, 0.02)])
def test_a_play_is_that_of_its_equations(step, error):
    """Its state follows what arrives within a hundredth of a second: a stiff and bent equation, in
    steps shorter and longer than that.
    """
    play = backlash(Amplifier, "signal")
    (gap,) = (n for n in play.declared if n in play.layout.parameter_index)
    time = step * np.arange(round(1.6 / step) + 1)
    u = np.sin(4.0 * time)
    found = EffectForcing(amplified(u, linear=True, step=step), play).of([{gap: 0.3}])

    def rate(t, z):
        x = np.interp(t, time, u)
        return (x - np.clip(x - z, -0.3, 0.3) - z) / 0.01

    z = solve_ivp(rate, (0.0, 1.6), [0.0], t_eval=time, rtol=1e-7, atol=1e-9, max_step=1e-3).y[0]
    expected = -2.0 * np.clip(u - z, -0.3, 0.3)
    assert found.shown[:, 0, 0] == pytest.approx(expected, abs=error)
