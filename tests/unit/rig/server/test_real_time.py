"""Claims: what the front asks of a rig in real time is in the memory at once, and a guard that ends
is replaced a bounded number of times.

The guard is one of the tests' own; real ones are tried in `tests/end_to_end/test_rig_faults.py`.
"""

from __future__ import annotations

import pytest

from fmus.kit import UserError
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.real_time import RealTimeRig
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    OPENING,
    REST,
    RUN,
    SERVING,
    Command,
    Sample,
    Trip,
    Watch,
    pack,
    unpack,
    write_text,
)

SIGNALS = BackendSignals({"current": "A", "force": "N"}, {"voltage": "V", "charge": "C"}, {})


class Guard:
    """A guard process that does nothing but live and end."""

    def __init__(self, exitcode=0):
        self.alive, self.exitcode = True, exitcode

    def is_alive(self):
        return self.alive

    def join(self, timeout=None):
        self.alive = False


@pytest.fixture
def started(monkeypatch):
    """Reasons for which guards were started; the first opens the device at once."""
    reasons = []

    def start(rig, rescue):
        reasons.append(rescue)
        rig._shared.watch.write(Watch(SERVING, 0, False))
        rig._shared.description.write(SIGNALS.to_record())
        return Guard()

    monkeypatch.setattr(RealTimeRig, "_start_guard", start)
    return reasons


@pytest.fixture
def rig(started):
    return RealTimeRig(ServerSettings("own.py:Own", rate=100.0))


def test_it_is_open_when_the_guard_says_so(rig, started):
    assert started == [""]
    assert rig.signals == SIGNALS
    assert rig.opening() == ""
    assert rig._shared.command.read() == Command()._replace(values=bytes(256))


def test_a_backend_that_does_not_open_is_an_error_with_its_reason(monkeypatch):
    def start(rig, rescue):
        rig._shared.trip.write(Trip(1.0, True, True, write_text("the cable is out")))
        return Guard()

    monkeypatch.setattr(RealTimeRig, "_start_guard", start)
    with pytest.raises(UserError, match=r"^backend own\.py:Own: the cable is out$"):
        RealTimeRig(ServerSettings("own.py:Own"))


def test_orders_are_in_the_memory(rig):
    rig.apply([0.5, 2.0], 12.5)
    command = rig._shared.command.read()
    assert (command.order, command.accepted) == (RUN, 12.5)
    assert unpack(command.values, 2) == (0.5, 2.0)
    rig.go_safe()
    assert rig._shared.command.read().order == REST


def test_a_release_is_acknowledged_by_the_device_before_it_serves(rig):
    rig.release()
    command = rig._shared.command.read()
    assert (command.order, command.acknowledged) == (REST, 1)
    assert rig.opening() == "the device is being opened"
    rig._shared.watch.write(Watch(OPENING, 1, False))
    assert rig.opening() == "the device is being opened"
    rig._shared.watch.write(Watch(SERVING, 1, False))
    assert rig.opening() == ""


def test_the_state_is_the_newest_sample(rig):
    assert rig.state().values == (None, None)
    assert rig.state().applied == (0.0, 0.0)
    packed = (pack((0.5, 2.0)), pack((1.5, 0.0)), pack((9.0, 0.0)))
    rig._shared.sample.write(Sample(7, 10.0, 3, *packed))
    state = rig.state()
    assert (state.number, state.missed) == (7, 3)
    assert state.applied == (0.5, 2.0)
    assert state.values == (1.5, None), "charge was never finite"
    assert state.ages(10.0) == [1.0, None]


def test_reports_of_device_and_guard_are_told_once(rig):
    rig._shared.trip.write(Trip(1.0, True, False, write_text("too hot")))
    rig._shared.rescue.write(Trip(2.0, True, True, write_text("it hangs")))
    assert rig.troubles() == ["too hot", "it hangs"]
    assert rig.troubles() == []
    rig._shared.trip.write(Trip(3.0, True, False, write_text("too hot")))
    assert rig.troubles() == ["too hot"]


def test_a_guard_that_ends_is_replaced_three_times(rig, started):
    told = []
    for _ in range(6):
        rig._guard.alive = False
        told += rig.troubles()
    why = "the guard process has ended"
    tries = [f"{why}; process {k} of 3 that tries for the safe state" for k in (1, 2, 3)]
    assert told == [*tries, f"{why}; given up after 3 processes"]
    assert started == ["", why, why, why]
    rig.release()
    assert started[4:] == [""], "an operator's acknowledgement starts another"


@pytest.mark.parametrize(
    ("exitcode", "rescue", "trouble"),
    [
        (0, None, ""),
        (1, None, "the guard does not end"),
        (1, Trip(1.0, False, True, write_text("it hangs")), "it hangs"),
        (None, Trip(1.0, True, True, write_text("done before")), "done before"),
        (None, Trip(1e12, True, True, write_text("done")), ""),
    ],
)
def test_at_the_end_it_says_whether_the_safe_state_was_reached(rig, exitcode, rescue, trouble):
    """A report of a rescue counts if it is of after the end was ordered."""
    rig._guard.exitcode = exitcode
    if rescue is not None:
        rig._shared.rescue.write(rescue)
    assert rig.close() == trouble
    assert rig._shared.command.read().order == END
