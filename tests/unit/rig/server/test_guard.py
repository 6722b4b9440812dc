"""Claims: a device that hangs or is late is noticed, and one that is slow but well is left alone.

Guards as processes are tried in `tests/end_to_end/test_rig_faults.py`.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from orchestration.rig.server.device import longest_sleep
from orchestration.rig.server.guard import Guard, fault_of
from orchestration.rig.server.settings import WATCHDOGS, ServerSettings
from orchestration.rig.server.shared_memory import (
    REST,
    RUN,
    Beat,
    Command,
    Trip,
)

pytestmark = pytest.mark.real_time

NOW = 100.0
SETTINGS = ServerSettings("own.py:Own", rate=30.0, watchdog=0.2)


@pytest.mark.parametrize(
    ("age", "where", "order", "command_age", "safe", "part"),
    [
        (0.0, b"sleep", RUN, 0.0, False, ""),
        (0.14, b"read()", RUN, 0.1, False, ""),  # slow
        (0.16, b"read()", RUN, 0.0, False, "the device hangs: read() for 0.16 s"),
        (0.16, b"safe()", REST, 0.0, False, "the device hangs: safe()"),
        (0.16, b"read()", REST, 0.0, True, "the device hangs: read()"),
        (
            0.16,
            b"sleep",
            RUN,
            0.0,
            False,
            "has not run for 0.16 s, outside of the driver; a busy machine needs a longer",
        ),
        (
            0.01,
            b"read()",
            RUN,
            0.21,
            False,
            "",
        ),  # the device has half a period to go safe by itself
        (
            0.01,
            b"read()",
            RUN,
            0.22,
            False,
            "no fresh command for 0.2 s, and the device did not go safe",
        ),
        (0.01, b"sleep", RUN, 0.22, True, ""),  # it did
        (0.01, b"sleep", REST, 9.0, False, ""),  # no session
    ],
)
def test_judgement(age, where, order, command_age, safe, part):
    beat = Beat(NOW - age, 1, True, 1.0 if safe else 0.0, where)
    reason = fault_of(beat, Command(order, 0, NOW - command_age), NOW, SETTINGS)
    assert part in reason
    assert bool(reason) == bool(part)


@pytest.mark.parametrize(
    ("trip", "final"),
    [
        (None, False),
        (Trip(NOW - 1.0, True, True, b"of the device before"), False),
        (Trip(NOW + 1.0, True, False, b"the device goes on"), False),
        (Trip(NOW + 1.0, True, True, b"stopped"), True),
    ],
)
def test_the_last_report_of_a_device_is_its_own(trip, final):
    """Of one that was started now; its memory has the reports of all before it."""
    guard = Guard.__new__(Guard)
    guard._started = NOW
    assert guard._is_final(trip) is final


@pytest.mark.parametrize("watchdog", [*WATCHDOGS, 0.02, 0.2])
def test_a_device_that_sleeps_is_not_held_for_hung_even_if_it_wakes_late(watchdog):
    beat = Beat(NOW - 2 * longest_sleep(watchdog), 1, True, 1.0, b"sleep")
    settings = replace(SETTINGS, watchdog=watchdog)
    assert fault_of(beat, Command(REST, 0, NOW), NOW, settings) == ""
