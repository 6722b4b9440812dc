"""Claims: a guard that stands by notices one on duty that has ended or shows no sign of life.
Guards as processes are tried in `tests/end_to_end/test_rig_faults.py`.
"""

from __future__ import annotations

import subprocess
import sys
from threading import Timer
from time import monotonic

import pytest

from orchestration.rig.server.guard import Guard
from orchestration.rig.server.processes import Output
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    GONE,
    HOLDING,
    OPENING,
    RESCUING,
    REST,
    RETIRED,
    SERVING,
    Command,
    Description,
    SharedMemory,
    Watch,
    new_memory,
)
from orchestration.rig.server.standby import longest_silence

pytestmark = pytest.mark.real_time

SETTINGS = ServerSettings("own.py:Own", watchdog=0.2)
ATTEMPT = 5.0  # s, at least


@pytest.fixture
def on_duty():
    """A process that only lives."""
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60.0)"])
    yield process
    process.kill()
    process.wait()


def stand_by(process, at, age, order=REST):
    """Return why a guard that stands by takes the place of another; empty if it ends instead."""
    memory = new_memory()
    shared = SharedMemory(memory)
    shared.command.write(Command(order))
    shared.watch.write(Watch(monotonic() - age, process.pid, at, 0, False))
    guard = Guard(SETTINGS, memory, Output())
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
        (RESCUING, ATTEMPT - 1.0, ""),  # a driver may take its time
        (RESCUING, ATTEMPT + 1.0, "the guard shows no sign of life for 6"),
        (OPENING, ATTEMPT - 1.0, ""),  # a machine is busy then
        (RETIRED, 5.0, ""),
        (SERVING, -60.0, ""),  # it shows them
    ],
)
def test_a_guard_that_shows_no_sign_of_life_is_ended(on_duty, at, age, reason):
    found = stand_by(on_duty, at, age)
    if not reason:
        assert found == ""
        assert on_duty.poll() is None
    else:
        assert found.startswith(reason)
        assert on_duty.wait(10.0) != 0


@pytest.mark.parametrize(("opening", "longest"), [(0.1, ATTEMPT), (5.2, 10.4)])
def test_an_attempt_may_take_twice_the_first_opening(opening, longest):
    shared = SharedMemory(new_memory())
    shared.description.write(Description(b"", opening))
    assert longest_silence(RESCUING, SETTINGS, shared) == pytest.approx(0.15 + longest)
    assert longest_silence(HOLDING, SETTINGS, shared) == pytest.approx(0.15)


@pytest.mark.parametrize(("at", "order"), [(SERVING, REST), (SERVING, END), (RETIRED, REST)])
def test_the_place_of_a_guard_that_has_ended_is_taken(on_duty, at, order):
    on_duty.kill()
    on_duty.wait()
    assert stand_by(on_duty, at, 0.0, order) == "the guard process has ended"


def test_where_all_has_ended_in_order_there_is_nothing_to_do(on_duty):
    on_duty.kill()
    on_duty.wait()
    begun = monotonic()
    assert stand_by(on_duty, RETIRED, 0.0, END) == ""
    assert monotonic() - begun < 0.3, "it ended by itself"
