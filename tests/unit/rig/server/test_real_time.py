"""Claims: an order of the front to a rig in real time is in the memory at once, and a guard that
ends has another behind it, a bounded number of times.

The guard is one of the tests' own; real ones are tried in `tests/end_to_end/test_rig_faults.py`.
"""

from __future__ import annotations

import math
import time

import pytest

from fmus.kit import UserError
from orchestration.rig.server import real_time as module
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.device import ENDED
from orchestration.rig.server.real_time import RealTimeRig
from orchestration.rig.server.rig import Notice
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    GONE,
    HOLDING,
    OPENING,
    RESCUING,
    REST,
    RETIRED,
    RUN,
    SERVING,
    Alarm,
    Beat,
    Command,
    Sample,
    SignOfLife,
    Trip,
    Watch,
    pack,
    unpack,
    write_text,
)
from orchestration.rig.signals import Limit

SIGNALS = BackendSignals({"current": "A", "force": "N"}, {"voltage": "V", "charge": "C"}, {})


class Guard:
    """A guard process that does nothing but live and end."""

    def __init__(self, pid):
        self.alive, self.pid = True, pid

    def is_alive(self):
        return self.alive

    def join(self, timeout=None):
        self.alive = False

    kill = join


def on_duty(rig, at=SERVING, number=1, age=0.0, acknowledged=0, **more):
    """Let a guard show a sign of life."""
    rig._shared.watch.write(Watch(time.monotonic() - age, number, at, acknowledged, False, **more))


def start(reasons, rescue, stands_by=False):
    reasons.append("standby" if stands_by else rescue)
    return Guard(len(reasons))


@pytest.fixture
def started(monkeypatch):
    """Reasons for which guards were started; the first opens the device at once."""
    reasons = []

    def serve(rig, rescue, stands_by):
        process = start(reasons, rescue, stands_by)
        on_duty(rig)
        rig._shared.standby.write(SignOfLife(1.0, 2))
        rig._shared.description.write(SIGNALS.to_record()._replace(opening=0.25))
        return process

    monkeypatch.setattr(RealTimeRig, "_start_process", serve)
    monkeypatch.setattr(module, "_PAUSES", (0.0, 0.0))
    return reasons


@pytest.fixture
def rig(started):
    return RealTimeRig(ServerSettings("own.py:Own", rate=100.0), lambda text, kind: None)


def test_it_is_open_when_the_guard_says_so(rig, started):
    assert started == ["", "standby"]
    assert rig.bound == pytest.approx(0.2 + 0.01 + 0.25), "watchdog, period, opening it again"
    assert rig.signals == SIGNALS
    assert rig._shared.command.read() == Command(values=bytes(256))


@pytest.mark.parametrize(
    ("report", "alive", "reason"),
    [
        ("the cable is out", True, "the cable is out"),
        ("the cable is out", False, "the cable is out"),
        ("", False, "its guard process ended before it was open"),
    ],
)
def test_a_backend_that_does_not_open_is_an_error_with_its_reason(
    monkeypatch, report, alive, reason
):
    def fail(rig, rescue, stands_by):
        process = start([], rescue)
        process.alive = alive
        if report:
            rig._shared.trip.write(Trip(1.0, True, True, write_text(report)))
        return process

    monkeypatch.setattr(RealTimeRig, "_start_process", fail)
    monkeypatch.setattr(module, "_SPARE", 0.1)  # nothing of these processes ever ends
    with pytest.raises(UserError, match=rf"^backend own\.py:Own: {reason}$"):
        RealTimeRig(ServerSettings("own.py:Own"), lambda text, kind: None)


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
    on_duty(rig, OPENING, acknowledged=1)
    assert rig.opening() == "the device is being opened"
    on_duty(rig, acknowledged=1)
    beat(rig, safe=9.0)
    assert rig.opening() == "the device has not measured yet"
    sample(rig)
    assert rig.opening() == ""


def test_a_release_waits_for_what_has_limits_to_be_measured(rig):
    rig.signals.limits["charge"] = Limit(-1.0, 1.0)
    rig.release()
    on_duty(rig, acknowledged=1)
    beat(rig, safe=8.0)
    sample(rig)
    assert rig.opening() == "no finite charge yet, and it has limits"
    del rig.signals.limits["charge"]
    assert rig.opening() == ""
    rig.release()
    on_duty(rig, acknowledged=2)
    beat(rig, safe=11.0)
    assert rig.opening() == "the device has not measured yet", "since this release"


def test_the_state_is_the_newest_sample(rig):
    assert rig.state().values == (None, None)
    assert rig.state().applied == (0.0, 0.0)
    beat(rig, safe=0.0)
    sample(rig)
    state = rig.state()
    assert (state.number, state.missed) == (7, 3)
    assert state.applied == (0.5, 2.0)
    assert state.read_back == (0.5, None), "the device can say of one"
    assert state.values == (1.5, None), "charge was never finite"
    assert state.ages(10.0) == [1.0, None]


def test_reports_of_device_and_guard_are_told_once(rig):
    rig._shared.trip.write(Trip(1.0, True, False, write_text("too hot")))
    rig._shared.rescue.write(Trip(2.0, True, True, write_text("it hangs")))
    assert rig.troubles() == ["too hot", "it hangs"]
    assert rig.troubles() == []
    rig._shared.trip.write(Trip(3.0, True, False, write_text("too hot")))
    assert rig.troubles() == ["too hot"]


def beat(rig, safe, age=0.0, call=b"sleep", denied=False, rested=1000):
    """Let the device show a sign of life."""
    rig._shared.beat.write(Beat(time.monotonic() - age, 9, True, safe, call, denied, rested))


def sample(rig, process=9, rested=1000):
    packed = map(pack, ((0.5, 2.0), (0.5, math.nan), (1.5, 0.0), (9.0, 0.0)))
    rig._shared.sample.write(Sample(7, 10.0, 3, *packed, process, rested))


@pytest.mark.parametrize(
    ("safe", "age", "call", "guard", "since"),
    [
        (0.0, 0.0, b"sleep", None, None),
        (50.0, 0.0, b"sleep", None, 50.0),
        (50.0, 1.0, b"sleep", None, None),  # nobody knows
        (50.0, 1.0, ENDED.encode(), None, 50.0),
        (50.0, 1.0, ENDED.encode(), (RESCUING, 0.0, 0.0), None),  # a guard is at it
        (0.0, 1.0, b"read()", (HOLDING, 60.0, 0.0), 60.0),
        (50.0, 0.0, b"sleep", (HOLDING, 60.0, 1.0), None),  # the guard hangs
        (50.0, 0.0, b"sleep", (SERVING, 60.0, 0.0), 50.0),  # another device has it
    ],
)
def test_who_has_the_device_tells_since_when_the_rig_is_safe(rig, safe, age, call, guard, since):
    beat(rig, safe, age, call)
    sample(rig)
    if guard is not None:
        at, safe_of_guard, age_of_guard = guard
        on_duty(rig, at, age=age_of_guard, safe=safe_of_guard, rested=1000)
    assert rig.safe_since() == since
    applied = rig.state().applied
    if since is not None:
        assert applied == (0.0, 0.0)
    else:
        assert applied == ((0.5, 2.0) if age == 0.0 else (None, None)), "unknown of a silent device"


@pytest.mark.parametrize(
    ("process", "rested", "applied"),
    [(9, 2, (0.5, 2.0)), (9, 0, (None, None)), (8, 2, (None, None))],
    ids=["as ordered", "not yet ordered to rest", "of a device before this one"],
)
def test_what_is_applied_belongs_to_the_last_order_and_to_the_present_device(
    rig, process, rested, applied
):
    rig.apply((0.5, 2.0), 10.0)
    rig.go_safe()  # order 2
    beat(rig, safe=0.0, rested=rested)
    sample(rig, process, rested)
    assert rig.state().applied == applied
    assert rig.state().values == (1.5, None)


def test_what_is_applied_is_known_although_a_command_overtook_an_order_to_rest(rig):
    """As that of a session that begins, which a device may never see."""
    beat(rig, safe=50.0, rested=0)
    rig.go_safe()
    rig.apply((0.5, 2.0), 10.0)
    beat(rig, safe=0.0, rested=0)
    sample(rig, rested=0)
    assert rig.state().applied == (0.5, 2.0)


def test_whether_the_device_denies_its_safe_state_is_said_by_who_has_it(rig):
    rig._shared.trip.write(Trip(1.0, False, False, write_text("it has 1 A")))
    rig._shared.rescue.write(Trip(2.0, False, True, write_text("it has 2 A")))
    beat(rig, safe=0.0, denied=True)
    assert rig.denial() == "it has 1 A"
    on_duty(rig, HOLDING)
    assert rig.denial() == ""
    on_duty(rig, HOLDING, denied=True)
    assert rig.denial() == "it has 2 A"


def test_a_device_that_has_not_carried_out_an_order_to_rest_is_not_safe(rig):
    """It was at rest, and has read a command that it is about to carry out."""
    rig.apply([0.5, 2.0], time.monotonic())
    before = rig._shared.command.read().number
    rig.go_safe()
    beat(rig, safe=50.0, rested=before)
    assert rig.safe_since() is None
    beat(rig, safe=50.0, rested=before + 1)
    assert rig.safe_since() == 50.0
    rig.go_safe()
    assert rig.safe_since() is None, "a stop waits for its own"
    beat(rig, safe=51.0, rested=before + 2)
    assert rig.safe_since() == 51.0


def test_however_fast_stops_follow_each_other_a_confirmation_of_the_first_counts(rig):
    before = rig._shared.command.read().number
    for _ in range(5):
        rig.go_safe()
    assert rig._shared.command.read().number == before + 5, "each is written"
    beat(rig, safe=50.0, rested=before + 1)
    assert rig.safe_since() == 50.0


def test_alarms_are_told_once(rig):
    rig._shared.alarm.write(Alarm(1.0, b"voltage", write_text("voltage is stuck")))
    assert rig.alarms() == [Notice("voltage", "voltage is stuck")]
    assert rig.alarms() == []


def test_a_guard_that_ends_has_another_behind_it_for_ever(rig, started):
    """The one that stands by takes its place, and the front starts another that stands by."""
    told = []
    for number in range(1, 20):
        rig._guards[number].alive = False
        on_duty(rig, GONE, number + 1)
        told += rig.troubles()
    assert started == ["", *["standby"] * 20]
    assert told == []


def test_guards_are_started_with_pauses_that_grow(rig, started, monkeypatch):
    monkeypatch.setattr(module, "_PAUSES", (0.05, 10.0))
    rig._pause = 0.0
    begun = time.monotonic()
    for wanted in (3, 4, 5):
        while len(started) < wanted:
            rig._guards.clear()
            rig.troubles()
    assert time.monotonic() - begun >= 0.15
    rig._guards.clear()
    assert rig.troubles() == []
    rig.release()
    assert len(started) == 6, "an operator's acknowledgement starts one at once"


def test_where_no_process_can_be_started_the_reason_is_told_once(rig, started, monkeypatch):
    def fail(rig, rescue, stands_by):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    with monkeypatch.context() as patch:
        patch.setattr(RealTimeRig, "_start_process", fail)
        rig._guards[2].alive = False
        (trouble,) = rig.troubles()
        assert trouble.startswith("no guard process can be started: [Errno 11]")
        assert rig.troubles() == []
    assert rig.troubles() == []
    assert started == ["", "standby", "standby"]


def test_guards_that_both_show_no_sign_of_life_are_replaced(rig, started):
    on_duty(rig, age=0.2)
    (reason,) = rig.troubles()
    assert reason.startswith("the guard shows no sign of life for 0.2")
    assert rig.troubles() == [], "it is told once, and the one that stands by has its chance"
    guards = [*rig._guards.values()]
    on_duty(rig, age=0.4)
    (reason,) = rig.troubles()
    assert reason.startswith("no guard shows a sign of life for 0.4")
    assert not any(one.alive for one in guards)
    assert started[2:] == [reason.partition(";")[0]]
    assert rig.troubles() == [], "the one that was started has not shown any yet"


@pytest.mark.parametrize(
    ("at", "rescue", "trouble"),
    [
        (RETIRED, None, ""),
        (GONE, None, "the guard does not end"),
        (GONE, Trip(1.0, False, True, write_text("it hangs")), "it hangs"),
    ],
)
def test_at_the_end_it_says_whether_the_safe_state_was_reached(
    rig, at, rescue, trouble, monkeypatch
):
    monkeypatch.setattr(module, "_SPARE", -5.0)
    if at == RETIRED:
        for guard in rig._guards.values():
            guard.alive = False
    on_duty(rig, at)
    if rescue is not None:
        rig._shared.rescue.write(rescue)
    assert rig.close() == trouble
    assert rig._shared.command.read().order == END


def test_a_watchdog_that_this_machine_cannot_hold_is_told(rig):
    assert rig._warn_of_wake_ups(0.04) == []
    (line,) = rig._warn_of_wake_ups(0.06)
    assert line == (
        "this machine wakes a process up to 60 ms late: a watchdog below 0.24 s may trip by itself;"
        " give --watchdog more than that, or the machine less to do"
    )
