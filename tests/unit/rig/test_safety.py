"""Safety decisions: a command is taken exactly if it is within its limits and rates, and fresh."""

from __future__ import annotations

from math import inf, isfinite, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.rig.backends.backend import Limit
from orchestration.rig.safety import (
    CommandFilter,
    MeasurementMonitor,
    SlewLimiter,
    beyond,
    expired,
    stale,
)

INPUTS = {"current": "A", "force": "N"}
LIMITS = {"current": Limit(-1.3, 1.3, 2.0), "force": Limit(min=0.0)}
EARLY = 0.01  # s, that a message may be early
anything = st.floats()
durations = st.floats(1e-4, 10.0)


@given(st.lists(st.tuples(anything, anything, durations), max_size=30))
def test_what_is_taken_never_leaves_its_limits(commands):
    """Minimum and maximum hold for any commands, by arithmetic of the test's own.

    The rate does over any number of them but for what a message may be early, however often the rig
    goes safe in between.
    """
    commands_filter = CommandFilter(INPUTS, LIMITS)
    taken = [(0.0, (0.0, 0.0))]
    now = way = 0.0
    for number, (current, force, wait) in enumerate(commands):
        now += wait
        refused = commands_filter.take([current, force], now, inf)
        if not refused:
            way += abs(current - taken[-1][1][0])
            taken.append((now, (current, force)))
        assert commands_filter.applied == taken[-1][1]
        if number % 7 == 6:
            commands_filter.reset()
            taken.append((now, (0.0, 0.0)))
    assert all(-1.3 <= current <= 1.3 and 0.0 <= force < inf for _, (current, force) in taken)
    first = next((time for time, _ in taken[1:]), 0.0)
    longest = 0.0 if way == 0.0 else 2.6 + 2.0 * (now - first + EARLY)
    assert way <= longest * (1 + 1e-6), "before the first there was all the time"


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("pause", [0.02, 0.15])
def test_a_ramp_close_to_the_limit_is_not_refused_for_jitter(seed, pause):
    """At 95 % of the limit, by a client whose messages come up to 2 ms early or late."""
    rng = np.random.default_rng(seed)
    commands = CommandFilter({"current": "A"}, {"current": Limit(rate=2.0)})
    for number in range(1, 500):
        arrives = pause * number + rng.uniform(-2e-3, 2e-3)
        assert commands.take([0.95 * 2.0 * pause * number], arrives, 0.2) == []


@pytest.mark.parametrize("pause", [0.2, 1.0, 1e5])
def test_after_a_pause_a_jump_is_no_larger(pause):
    """A budget fills for 0.2 s at most, at 2 A/s."""
    commands = CommandFilter({"current": "A"}, {"current": Limit(rate=2.0)})
    assert commands.take([0.0], 0.0, 0.2) == []
    (refusal,) = commands.take([0.5], pause, 0.2)
    assert "faster than 2 A/s" in refusal
    assert commands.take([0.4], pause, 0.2) == []


def test_sessions_that_follow_each_other_are_no_way_around_a_rate():
    """Again and again from zero as far as it goes: the output keeps to the limit all the time, by
    the differences between one write and the next.
    """
    limits = {"current": Limit(-1.3, 1.3, rate=2.0)}
    commands = CommandFilter({"current": "A"}, limits)
    slew = SlewLimiter(["current"], limits, 0.0)
    applied = 0.0
    for write in range(1, 600):
        now = write / 30.0
        if write % 4 == 0:
            commands.reset()
            slew.rest(now)
            applied = 0.0
            continue
        commands.take([1.3], now, 0.2)
        commands.take([commands.applied[0] + 0.06], now, 0.2)
        (value,) = slew.towards(commands.applied, now)
        assert abs(value - applied) <= 1.05 * 2.0 / 30.0
        applied = value


@given(st.lists(st.tuples(st.floats(-1e3, 1e3), durations), max_size=30))
def test_what_is_applied_goes_towards_the_command_and_never_faster_than_its_limit(targets):
    slew = SlewLimiter(["current", "force"], {"current": Limit(rate=2.0)}, 0.0)
    now = before = 0.0
    for target, wait in targets:
        now += wait
        current, force = slew.towards([target, target], now)
        assert force == target, "it has no limit"
        assert abs(current - before) <= 2.0 * wait * (1 + 1e-9) + 1e-12
        if current != target:
            assert abs(current - before) >= 2.0 * wait * (1 - 1e-6) - 1e-9, "as fast as it may"
            assert (current - before) * (target - before) > 0.0
        before = current


@given(st.floats(-1.3, 1.3), st.floats(0.0, 1e300))
def test_what_is_within_all_limits_is_taken(current, force):
    commands = CommandFilter(INPUTS, LIMITS)
    assert commands.take([current, force], 5.0, longest=0.66) == []  # 1.3 A at 2 A/s take 0.65 s
    assert commands.applied == (current, force)


@pytest.mark.parametrize("bad", [nan, inf, -inf])
@pytest.mark.parametrize("place", [0, 1])
def test_what_is_no_finite_number_is_refused(bad, place):
    commands = CommandFilter(INPUTS, {})
    values = [0.5, 0.5]
    values[place] = bad
    assert len(commands.take(values, 1.0, inf)) == 1
    assert commands.applied == (0.0, 0.0)


def test_one_value_beyond_its_limit_keeps_all_of_them_back_and_every_fault_is_told():
    commands = CommandFilter(INPUTS, {"current": Limit(-1.3, 1.3), "force": Limit(0.0, 3.0)})
    assert commands.take([1.0, 1.0], 1.0, 1.0) == []
    assert commands.take([0.5, 3.5], 2.0, 1.0) == ["force 3.5 N is above 3 N; 1 N goes on"]
    assert commands.take([-2.0, -1.0], 3.0, 1.0) == [
        "current -2 A is below -1.3 A; 1 A goes on",
        "force -1 N is below 0 N; 1 N goes on",
    ]
    assert commands.applied == (1.0, 1.0)


def test_a_rate_counts_from_the_value_that_is_applied_not_from_one_that_was_refused():
    commands = CommandFilter({"current": "A"}, {"current": Limit(rate=1.0)})
    assert commands.take([5.0], 1.0, 0.1) == [
        "current 5 A is a change by +5 A in 0.1 s, faster than 1 A/s; 0 A goes on"
    ]
    assert commands.take([5.05], 1.1, 0.1), "0.05 from the refused one, 5.05 from the applied one"
    assert commands.take([0.1], 1.2, 0.1) == []
    commands.reset()
    assert commands.applied == (0.0,)
    assert commands.take([0.2], 1.3, 0.1), "at rest the rig is at zero"
    assert commands.take([0.1], 1.3, 0.1) == []


@given(st.lists(st.tuples(anything, durations), max_size=30))
def test_the_first_measured_value_beyond_its_limit_is_told_and_no_other(readings):
    monitor = MeasurementMonitor({"voltage": "V", "other": "m"}, {"voltage": Limit(-2.0, 2.0)}, 0.2)
    now = last = 0.0
    for number, (value, wait) in enumerate(readings):
        now += wait
        if number == 0 or isfinite(value):
            last = now
        wrong = isfinite(value) and not -2.0 <= value <= 2.0
        reason = monitor.check({"voltage": value, "other": 1.0}, now)
        assert bool(reason) == (wrong or now - last > 0.2), reason
        assert reason.startswith("measured voltage") == wrong


def test_a_measured_value_that_changes_too_fast_is_told():
    monitor = MeasurementMonitor({"force": "N"}, {"force": Limit(rate=10.0)}, 0.2)
    assert monitor.check({"force": 100.0}, 0.0) == "", "there is nothing before the first one"
    assert monitor.check({"force": 100.9}, 0.1) == ""
    assert monitor.check({"force": nan}, 0.2) == ""
    assert monitor.check({"force": 102.8}, 0.3) == "", (
        "1.9 N in the 0.2 s since the last finite value"
    )
    assert "faster than 10 N/s" in monitor.check({"force": 104.0}, 0.4)


def test_outputs_without_limits_may_be_missing_as_long_as_one_is_there():
    monitor = MeasurementMonitor({"a": "V", "b": "V"}, {}, 0.2)
    for tenth in range(10):
        assert monitor.check({"a": nan, "b": 1.0}, 0.1 * tenth) == ""
    assert monitor.check({"a": nan, "b": nan}, 1.05) == ""
    assert (
        monitor.check({"a": nan, "b": nan}, 1.2) == "the device delivers nothing finite for 0.2 s"
    )
    assert MeasurementMonitor({}, {}, 0.2).check({}, 1e6) == "", "a rig may measure nothing"


def test_an_output_that_falls_silent_ends_nothing_while_another_goes_on():
    """Neither has limits; both had values at first."""
    monitor = MeasurementMonitor({"a": "N", "b": "N"}, {}, 0.2)
    assert monitor.check({"a": 1.0, "b": 1.0}, 0.0) == ""
    for tenth in range(1, 10):
        assert monitor.check({"a": nan, "b": 1.0}, 0.1 * tenth) == ""


@pytest.mark.parametrize(
    ("age", "over"), [(0.0, False), (0.1999, False), (0.2, True), (1.0, True), (nan, True)]
)
def test_a_command_expires_after_the_watchdog_time(age, over):
    assert expired(0.0, age, 0.2) is over


@pytest.mark.parametrize(
    ("seen", "part"),
    [(10.0, ""), (9.8001, ""), (9.79, "under way for 0.21 s"), (10.001, "more of the rig's time")],
)
def test_a_message_is_as_fresh_as_what_its_sender_has_seen(seen, part):
    reason = stale(seen, 10.0, 0.2)
    assert part in reason
    assert bool(reason) == bool(part)


def test_a_rig_starts_from_its_safe_values_and_comes_back_to_them():
    limits = {"valve": Limit(0.0, 1.0, rate=1.0)}
    commands = CommandFilter({"valve": "1"}, limits, (1.0,))
    slew = SlewLimiter(["valve"], limits, 0.0, (1.0,))
    assert commands.applied == (1.0,)
    assert commands.take([0.95], 0.1, 0.1) == []
    assert slew.towards([0.5], 0.1) == (pytest.approx(0.9),)
    assert commands.take([0.0], 0.2, 0.1) != []
    commands.reset()
    slew.rest(9.0)
    assert commands.applied == (1.0,)
    assert slew.towards([0.0], 9.1) == (pytest.approx(0.9),)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ((1.3, 0.0), ""),
        ((1.31, 0.0), "current 1.31 A is above 1.3 A"),
        ((0.0, -0.1), "force -0.1 N is below 0 N"),
        ((nan, 0.0), "current nan A is no finite number"),
        ((0.0, inf), "force inf N is no finite number"),
    ],
)
def test_what_is_beyond_a_limit_is_named(values, sentence):
    limits = {"current": Limit(-1.3, 1.3), "force": Limit(0.0, 3.0)}
    assert beyond({"current": "A", "force": "N"}, limits, values) == sentence
