"""Claims: what an effect adds along a trajectory is what its laws say there, in every setting.

Oracles: laws written out by hand, lags and ramps on paper, `solve_ivp` for loops.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit import Component, Discrete, Effect, Input, Output, Parameter, State, maximum, sin
from fmus.kit.arms import lag_effect
from fmus.kit.curves import curve
from fmus.kit.errors import UserError
from fmus.kit.inputs import backlash, input_offset, input_saturation
from fmus.kit.sensors import sensor_drift, sensor_gain, sensor_lag, sensor_offset
from fmus.kit.symbolic.forcing import ComponentAlong, EffectForcing, Points
from fmus.voice_coil_dma.effects import AmplifierSaturation, CoulombFriction
from fmus.voice_coil_dma.model import VoiceCoilDma
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


class Held(Component):
    """A lag behind an input that is sampled first, or behind itself, sampled."""

    name = "held"
    period = Parameter(0.1, "s", min=1e-3)
    back = Parameter(0.0, "1")
    fed = Input("1")
    lagging = State("1", rate="lagging_rate")
    sampled = Discrete("1", update="sample", period="period")
    once = Discrete("1", update="read", period=1e9)

    def sample(self):
        return self.arriving() + self.back * self.lagging

    def arriving(self):
        return 1.0 * self.fed

    def read(self):
        return self.lagging

    def lagging_rate(self):
        return self.sampled + self.once - self.lagging

    @Output("1")
    def shown(self):
        """The state."""
        return self.lagging


class Drained(Effect):
    """A share of gravity that is left: neutral is the most there can be, beyond is nonsense."""

    id = "drained"
    neutral = "left"
    assumption = "all is there"
    left = Parameter(1.0, "1", min=0.0, max=1.0)

    def gravity(self):
        return (self.left * self.left + 1e3 * maximum(self.left - 1.0, 0.0)) * super().gravity()


def points(inputs, states, discretes=None, step=STEP):
    """Return begin and end of steps: held inputs, states that go on, discrete states that hold."""
    n = inputs.shape[1]
    time = step * np.arange(n)[np.newaxis]
    held = np.zeros((0, n)) if discretes is None else discretes
    begin = Points(time, inputs, states, held)
    return begin, Points(following(time), inputs, following(states), held)


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


# --- the component
# --------------------------------------------------------------------------------------------------


def test_a_component_is_linearised_as_on_paper():
    begin, end = swinging()
    for at in (begin, end):
        found = along(begin, end, pull=3.0).linearised(at)
        angle = at.states[0]
        expected = np.zeros((N, 2, 2))
        expected[:, 0, 1] = 1.0
        expected[:, 1, 0] = -3.0 * np.cos(angle)
        expected[:, 1, 1] = -0.5
        assert found.a == pytest.approx(expected, abs=1e-12)
        shown = np.stack([2.0 * angle, np.ones(N)], axis=1)[:, np.newaxis]
        assert found.c == pytest.approx(shown, abs=1e-12)


def test_a_component_without_states_has_empty_matrices():
    found = amplified(np.ones(5)).linearised(amplified(np.ones(5)).begin)
    assert found.a.shape == (5, 0, 0)
    assert found.c.shape == (5, 1, 0)


def test_outputs_are_those_at_begin_and_end_and_states_follow_them():
    begin, end = swinging()
    component = along(begin, end)
    for place, side, at in ((0, 0, begin), (0, 1, end)):
        angle, speed = at.states
        expected = speed + angle**2 + 2.0 * at.inputs[0]
        assert component.outputs(place)[side] == pytest.approx(expected, rel=1e-12)
    assert np.array_equal(component.outputs(1)[0], begin.states[0])
    assert np.array_equal(component.outputs(2)[1], end.states[1])


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
    """Where a switch bends: the share that is left squared, and the derivative where it is 1."""
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
    shown, _ = component.outputs(0)
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


def test_a_sensor_that_lags_reads_less_by_what_is_to_come():
    """Of a ramp of 3 per second: T r less, once it has moved for longer than the lag; for a little
    of a lag that is stiff, r less at once.
    """
    lag = sensor_lag(Amplifier, "shown")
    time = 0.02 * np.arange(201)
    component = amplified(1.5 * time, linear=True, step=0.02)
    found = EffectForcing(component, lag).of([{lag.neutral: 0.0}, {lag.neutral: 0.3}])
    slow = -0.3 * 3.0 * (1.0 - np.exp(-time / 0.3))
    assert found.shown[:, 0, 1] == pytest.approx(slow, abs=1e-6)
    assert found.shown[30:, 0, 0] == pytest.approx(-3.0, rel=1e-5)
    assert found.shown[0, 0, 0] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("step", [0.001, 0.1, 10.0])
def test_a_lag_of_10_ms_is_exact_in_steps_of_any_length(step):
    """After a jump of 2: what is still to come, over 10 ms."""
    lag = sensor_lag(Amplifier, "shown")
    u = np.zeros(60)
    u[20:] = 1.0
    found = EffectForcing(amplified(u, step=step), lag).of([{lag.neutral: 0.0}]).shown[:, 0, 0]
    assert found[:20] == pytest.approx(0.0, abs=1e-9)
    assert found[20:] == pytest.approx(-200.0 * np.exp(-100.0 * step * np.arange(40)), abs=0.02)


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


def test_a_loop_over_a_state_is_that_of_bouc_and_wen():
    time = 0.01 * np.arange(301)
    states = np.stack([np.sin(3.0 * time), 3.0 * np.cos(3.0 * time)])
    begin, end = points(np.zeros((1, 301)), states, step=0.01)
    loop = lag_effect(Pendulum, "gravity", "angle", "hysteresis", 0.2, "1/s^2")
    amount, way = (n for n in loop.declared if n in loop.layout.parameter_index)
    found = EffectForcing(along(begin, end), loop).of([{amount: 0.0, way: 0.2}])

    def rate(t, z):
        v = 3.0 * np.cos(3.0 * t)
        return (v - 0.5 * abs(v) * abs(z) * z - 0.5 * v * z * z) / 0.2

    z = solve_ivp(rate, (0.0, 3.0), [0.0], t_eval=time, rtol=1e-8, atol=1e-10).y[0]
    assert np.ptp(z) > 1.5
    assert found.begin[:, 1, 0] == pytest.approx(-z, abs=5e-3)


# --- what is sampled
# --------------------------------------------------------------------------------------------------


def held_course(**parameters):
    discretes = np.vstack([RNG.standard_normal(N), np.zeros(N)])
    begin, end = points(RNG.standard_normal((1, N)), RNG.standard_normal((1, N)), discretes)
    return ComponentAlong(Held, parameters, begin, end)


def test_what_is_sampled_of_inputs_alone_counts_as_it_is():
    component = held_course()
    linear = component.linearised(component.begin)
    assert linear.a == pytest.approx(-1.0)
    assert linear.c == pytest.approx(1.0)
    lag = curve(Held, "lagging_rate", "lagging", "cubic", "1/s", 1.0)
    found = EffectForcing(component, lag).of([{lag.neutral: 0.0}])
    assert found.begin[:, 0, 0] == pytest.approx(component.begin.states[0] ** 3, rel=1e-6, abs=1e-9)
    assert found.end[:, 0, 0] == pytest.approx(component.end.states[0] ** 3, rel=1e-6, abs=1e-9)


def test_a_state_that_comes_back_through_a_sample_is_refused():
    with pytest.raises(UserError, match="sampled is sampled, and depends on a state"):
        held_course(back=1.0)
    held_course(back=1.0, period=10.0)  # sampled at the start only


def test_an_effect_that_acts_through_a_sample_is_refused():
    component = held_course()
    with pytest.raises(UserError, match="acts through sampled"):
        EffectForcing(component, curve(Held, "arriving", "fed", "cubic", "1", 1.0))
    with pytest.raises(UserError, match="acts through sampled"):
        EffectForcing(component, input_offset(Held, "fed"))


@pytest.mark.parametrize("controlled", [0.0, 1.0])
def test_a_bench_is_refused_where_its_loop_is_closed(controlled):
    layout = VoiceCoilDma.layout
    shape = [np.zeros((len(group), 200)) for group in (layout.inputs, layout.states)]
    begin, end = points(*shape, np.zeros((len(layout.discretes), 200)))
    parameters = {"controller_on": controlled}
    if controlled:
        with pytest.raises(UserError, match="is sampled, and depends on a state"):
            ComponentAlong(VoiceCoilDma, parameters, begin, end)
        return
    component = ComponentAlong(VoiceCoilDma, parameters, begin, end)
    for effect in (CoulombFriction, AmplifierSaturation, input_offset(VoiceCoilDma, "tension")):
        EffectForcing(component, effect)
    with pytest.raises(UserError, match="acts through voltage_command"):
        EffectForcing(component, input_offset(VoiceCoilDma, "force_reference"))


def test_points_of_a_part_are_those_of_all_their_arrays():
    begin, _ = swinging()
    part = begin.part(slice(3, 7))
    for one, whole in zip(part.arguments, begin.arguments, strict=True):
        assert np.array_equal(one, whole[:, 3:7])
