"""Safety decisions: a command is taken exactly if it is within its limits and rates, and fresh."""

from __future__ import annotations

from itertools import pairwise
from math import inf, isfinite, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.rig.backends.backend import Limit
from orchestration.rig.safety import CommandFilter, MeasurementMonitor, expired, stale

INPUTS = {"current": "A", "force": "N"}
LIMITS = {"current": Limit(-1.3, 1.3, 2.0), "force": Limit(min=0.0)}
anything = st.floats()
durations = st.floats(1e-4, 10.0)


@given(st.lists(st.tuples(anything, anything, durations), max_size=30))
def test_what_is_applied_never_leaves_its_limits(commands):
    """Minimum, maximum and rate hold for any commands, by arithmetic of the test's own."""
    commands_filter, applied = CommandFilter(INPUTS, LIMITS), [(0.0, (0.0, 0.0))]
    now = 0.0
    for current, force, wait in commands:
        now += wait
        refused = commands_filter.take([current, force], now - applied[-1][0])
        if not refused:
            applied.append((now, (current, force)))
        assert commands_filter.applied == applied[-1][1]
    for (before, (last, _)), (time, (current, force)) in pairwise(applied):
        assert -1.3 <= current <= 1.3
        assert 0.0 <= force < inf
        assert abs(current - last) <= 2.0 * (time - before) * (1 + 1e-6)


@given(st.floats(-1.3, 1.3), st.floats(0.0, 1e300))
def test_what_is_within_all_limits_is_taken(current, force):
    commands = CommandFilter(INPUTS, LIMITS)
    assert commands.take([current, force], elapsed=0.66) == []  # 1.3 A at 2 A/s take 0.65 s
    assert commands.applied == (current, force)


@pytest.mark.parametrize("bad", [nan, inf, -inf])
@pytest.mark.parametrize("place", [0, 1])
def test_what_is_no_finite_number_is_refused(bad, place):
    commands = CommandFilter(INPUTS, {})
    values = [0.5, 0.5]
    values[place] = bad
    assert len(commands.take(values, inf)) == 1
    assert commands.applied == (0.0, 0.0)


def test_one_value_beyond_its_limit_keeps_all_of_them_back_and_every_fault_is_told():
    commands = CommandFilter(INPUTS, {"current": Limit(-1.3, 1.3), "force": Limit(0.0, 3.0)})
    assert commands.take([1.0, 1.0], 1.0) == []
    assert commands.take([0.5, 3.5], 1.0) == ["force 3.5 N is above 3 N; 1 N goes on"]
    assert commands.take([-2.0, -1.0], 1.0) == [
        "current -2 A is below -1.3 A; 1 A goes on",
        "force -1 N is below 0 N; 1 N goes on",
    ]
    assert commands.applied == (1.0, 1.0)


def test_a_rate_counts_from_the_value_that_is_applied_not_from_one_that_was_refused():
    commands = CommandFilter({"current": "A"}, {"current": Limit(rate=1.0)})
    assert commands.take([5.0], 0.1) == [
        "current 5 A is a change by +5 A in 0.1 s, faster than 1 A/s; 0 A goes on"
    ]
    assert commands.take([5.05], 0.1), "0.05 from the refused one, 5.05 from the applied one"
    assert commands.take([0.1], 0.1) == []
    commands.reset()
    assert commands.applied == (0.0,)
    assert commands.take([0.2], 0.1), "at rest the rig is at zero"


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
