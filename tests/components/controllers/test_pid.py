"""The PID controller against python-control, eq. 2.2 as the bench has it, and its limits."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.controllers.pid import Pid
from fmus.voice_coil_dma.model import VoiceCoilDma
from tests.support.sampled import run

THESIS = Pid.presets["thesis_pi"].values
ERRORS = st.lists(st.floats(-30.0, 30.0), min_size=2, max_size=60)


def bench_commands(errors):
    """Voltages of the bench's own controller; its filtered force is zero, so the reference is the
    error.
    """
    bench, found = VoiceCoilDma(), []
    for error in errors:
        bench.force_reference = error
        following = bench.next_command(), bench.force_error()
        bench.voltage_command, bench.previous_error = following
        found.append(bench.voltage_command)
    return found


@settings(max_examples=200)
@given(ERRORS)
def test_the_preset_is_eq_2_2_of_the_bench_bit_for_bit(errors):
    assert run(Pid(**THESIS), {"reference": errors}, len(errors))["command"].tolist() == (
        bench_commands(errors)
    )


def test_both_reach_their_limits_and_come_back():
    errors = [5.0] * 30 + [-40.0] * 10 + [0.3] * 20
    found = run(Pid(**THESIS), {"reference": errors}, len(errors))["command"]
    assert found.tolist() == bench_commands(errors)
    assert {0.0, 10.0} < set(found)


def test_the_numbers_of_the_preset_are_those_printed():
    model = Pid(**THESIS)
    assert (model.error_gain(), model.previous_error_gain()) == (0.66, -0.06)
    assert THESIS["sample_period"] == pytest.approx(1 / 30)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("period", [0.01, 0.1])
def test_it_is_the_discrete_transfer_function_of_its_continuous_form(seed, period):
    """u = K (1 + 1/(T_i s)) (r - y) - K T_d s/(T_f s + 1) y by the backward difference."""
    rng = np.random.default_rng(seed)
    gain, integral, derivative, lag = rng.uniform([0.1, 0.2, 0.05, 0.02], [3.0, 4.0, 0.5, 0.2])
    count = 400
    reference, measured = 0.05 * rng.standard_normal((2, count))
    found = run(
        Pid(
            sample_period=period,
            proportional_gain=gain,
            integral_time=integral,
            derivative_time=derivative,
            filter_time=lag,
            command_min=-1e6,
            command_max=1e6,
        ),
        {"reference": reference, "measured": measured},
        count,
    )["command"]

    def sampled(system):
        return control.sample_system(system, period, method="backward_diff")

    s = control.tf("s")
    time = period * np.arange(count)
    parts = (
        (sampled(gain * (1 + 1 / (integral * s))), reference - measured),
        (sampled(gain * derivative * s / (lag * s + 1)), -measured),
    )
    expected = sum(control.forced_response(c, time, signal).outputs for c, signal in parts)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def closed_loop(model, references, time_constant=1.0, gain=1.0):
    """Force and command of a first-order plant of 1 N/V under the controller."""
    period = model.sample_period
    decay, force, trail = np.exp(-period / time_constant), 0.0, []
    for reference in references:
        command = run(model, {"reference": reference, "measured": force}, 1)["command"][0]
        trail.append((force, command))
        force = decay * force + (1 - decay) * gain * command
    return np.array(trail).T


MINUTE = 6000  # samples of 10 ms


def after_a_minute_of_saturation(tracking_time):
    """Force from the instant at which 50 N, which no command reaches, give way to 2 N."""
    model = Pid(proportional_gain=1.0, integral_time=1.0, tracking_time=tracking_time)
    force, _ = closed_loop(model, np.r_[np.full(MINUTE, 50.0), np.full(500, 2.0)])
    assert force[MINUTE] == pytest.approx(10.0, rel=1e-6)
    return force[MINUTE:]


def test_windup_of_a_minute_is_gone_where_it_is_tracked_in_the_integral_time():
    """The plant's pole is cancelled: the loop is of first order with its time constant, 1 s, and
    goes as if it had never been saturated. What is not taken off is one increment of the integral
    at the error of 40 N, and one at that of -8 N.
    """
    fresh = 2.0 + 8.0 * np.exp(-0.01 * np.arange(500))
    increments = 0.01 * (40.0 + 8.0)
    assert np.abs(after_a_minute_of_saturation(1.0) - fresh).max() <= increments
    assert np.abs(after_a_minute_of_saturation(1e9) - fresh)[100:].max() > 7.9


def test_transfers_between_hand_and_law_have_no_bump():
    """By hand at 4 V; the law takes over at rest, where its first change is that of the error."""
    model = Pid(proportional_gain=1.0, integral_time=1.0)
    by_hand = {"reference": 3.0, "measured": 4.0, "manual": True, "manual_command": 4.0}
    assert set(run(model, by_hand, 50)["command"]) == {4.0}
    after = run(model, {"reference": 4.0, "measured": 4.0, "manual": False}, 3)["command"]
    # the step of the reference by 1 N passes the proportional part, and nothing has wound up
    assert after == pytest.approx([5.0, 5.0, 5.0], rel=1e-12)


def test_by_hand_the_limits_hold():
    model = Pid()
    given = {"manual": True, "manual_command": 40.0}
    assert set(run(model, given, 3)["command"]) == {10.0}
    assert run(model, {"manual": False}, 1)["command"][0] == 10.0


def test_it_follows_what_was_carried_out():
    """A drive that gives 1 V whatever is asked: the command stays near it instead of growing."""
    model = Pid(proportional_gain=1.0, integral_time=1.0, tracking_time=0.01)
    given = {"reference": 1.0, "tracking": True, "applied_command": 1.0}
    command = run(model, given, 500)["command"]
    # what was applied and one increment of the integral, K h / T_i
    assert command[1:] == pytest.approx(np.full(499, 1.0 + 0.01), rel=1e-12)


@settings(max_examples=50)
@given(ERRORS)
def test_the_command_is_within_its_limits(errors):
    model = Pid(proportional_gain=5.0, derivative_time=0.1, command_min=-1.0, command_max=2.0)
    found = run(model, {"reference": errors, "measured": errors[::-1]}, len(errors))
    assert np.all((found["command"] >= -1.0) & (found["command"] <= 2.0))
    assert np.all((found["saturated"] > 0) <= np.isin(found["command"], [-1.0, 2.0]))
