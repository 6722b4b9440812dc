"""Claims: a device that hangs or is late is noticed, and one that is slow but well is left alone; a
guard that stands by notices one on duty that has ended or shows no sign of life, and no other.

Guards as processes are tried in `tests/end_to_end/test_rig_faults.py`.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from threading import Timer
from time import monotonic

import pytest

from orchestration.rig.server.device import look
from orchestration.rig.server.guard import LONGEST_ATTEMPT, Guard, fault_of
from orchestration.rig.server.settings import WATCHDOGS, ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    GONE,
    RESCUING,
    REST,
    RETIRED,
    RUN,
    SERVING,
    Beat,
    Command,
    SharedMemory,
    Watch,
    new_memory,
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
            "has not run for 0.16 s, outside of the driver: this computer is too busy",
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


@pytest.mark.parametrize("watchdog", [*WATCHDOGS, 0.02, 0.2])
def test_a_device_that_sleeps_is_not_held_for_hung_even_if_it_wakes_late(watchdog):
    beat = Beat(NOW - 2 * look(watchdog), 1, True, 1.0, b"sleep")
    settings = replace(SETTINGS, watchdog=watchdog)
    assert fault_of(beat, Command(REST, 0, NOW), NOW, settings) == ""


@pytest.fixture
def on_duty():
    """A process that only lives."""
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60.0)"])
    yield process
    process.kill()
    process.wait()


def stand_by(process, at, age, order=REST):
    """Return why a guard that stands by takes the place of another; None if it ends instead."""
    memory = new_memory()
    shared = SharedMemory(memory)
    shared.command.write(Command(order))
    shared.watch.write(Watch(monotonic() - age, process.pid, at, 0, False))
    guard = Guard(SETTINGS, memory)
    ends = Timer(0.3, guard.end)  # else it would stand by for ever
    ends.start()
    reason = guard.stand_by()
    ends.cancel()
    assert shared.standby.read() is not None
    return reason


@pytest.mark.parametrize(
    ("at", "age", "reason"),
    [
        (SERVING, 5.0, "the guard shows no sign of life for 5"),
        (GONE, 5.0, "the guard shows no sign of life for 5"),
        (RESCUING, LONGEST_ATTEMPT - 1.0, None),  # a driver may take its time
        (RESCUING, LONGEST_ATTEMPT + 1.0, "the guard shows no sign of life for 6"),
        (RETIRED, 5.0, None),
        (SERVING, -60.0, None),  # it shows them
    ],
)
def test_a_guard_that_shows_no_sign_of_life_is_ended(on_duty, at, age, reason):
    found = stand_by(on_duty, at, age)
    if reason is None:
        assert found is None
        assert on_duty.poll() is None
    else:
        assert found.startswith(reason)
        assert on_duty.wait(10.0) != 0


@pytest.mark.parametrize(("at", "order"), [(SERVING, REST), (SERVING, END), (RETIRED, REST)])
def test_the_place_of_a_guard_that_has_ended_is_taken(on_duty, at, order):
    on_duty.kill()
    on_duty.wait()
    assert stand_by(on_duty, at, 0.0, order) == "the guard process has ended"


def test_where_all_has_ended_in_order_there_is_nothing_to_do(on_duty):
    on_duty.kill()
    on_duty.wait()
    begun = monotonic()
    assert stand_by(on_duty, RETIRED, 0.0, END) is None
    assert monotonic() - begun < 0.3, "it ended by itself"
