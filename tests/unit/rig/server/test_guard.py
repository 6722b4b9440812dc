"""Claims: a device that hangs or is late is noticed, and one that is slow but well is left alone.

Guards as processes are tried in `tests/end_to_end/test_rig_faults.py`.
"""

from __future__ import annotations

import os
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import pytest

from orchestration.rig.server import guard as module
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.device import longest_sleep
from orchestration.rig.server.guard import Guard, fault_of
from orchestration.rig.server.processes import Output
from orchestration.rig.server.settings import WATCHDOGS, ServerSettings
from orchestration.rig.server.shared_memory import (
    HOLDING,
    RESCUING,
    REST,
    RUN,
    Beat,
    Command,
    SharedMemory,
    Trip,
    new_memory,
    read_text,
)
from tests.support.rig.backends import Logged
from tests.support.rig.backends import __file__ as BACKENDS

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


class Withheld:
    """The processor time of a device that the machine has not run for a while, or has run."""

    def __init__(self, answer):
        self.answer = answer

    def was_withheld(self, silence):
        assert silence == pytest.approx(0.16)
        return self.answer


@pytest.mark.parametrize(
    ("withheld", "reason"),
    [
        (True, "the machine did not run the device in 0.16 s, in write(); a busy machine needs"),
        (False, "the device hangs: write() for 0.16 s"),
    ],
)
def test_a_device_that_was_not_run_does_not_hang(withheld, reason):
    beat = Beat(NOW - 0.16, 1, True, 0.0, b"write()")
    assert fault_of(beat, Command(RUN, 0, NOW), NOW, SETTINGS, Withheld(withheld)).startswith(
        reason
    )


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


class Bench:
    """A guard whose device has failed, with a clock of the test's own."""

    def __init__(self, folder, monkeypatch, backend="Faulty", **options):
        self.now = 1000.0
        self.log = folder / "log"
        self.trigger = folder / "trigger"
        options = {"log": str(self.log), "trigger": str(self.trigger), **options}
        settings = ServerSettings(f"{BACKENDS}:{backend}", options=options)
        memory = new_memory()
        self.shared = SharedMemory(memory)
        self.shared.command.write(Command())
        description = BackendSignals(Logged.inputs, Logged.outputs, {}).to_record()
        self.shared.description.write(description)
        monkeypatch.setattr(module, "monotonic", lambda: self.now)
        monkeypatch.setattr(module, "deadline", lambda seconds: nullcontext())
        self.guard = Guard(settings, memory, Output())
        self.guard._device = SimpleNamespace(is_alive=lambda: False)
        self.started = []
        monkeypatch.setattr(self.guard, "_start", lambda: self.started.append(self.now))

    def calls(self, what):
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        return sum(line.split(" ", 2)[2].startswith(what) for line in lines)

    def turn(self, seconds=0.01):
        self.now += seconds
        self.guard._hold()
        return self.shared.watch.read()


def test_a_guard_tries_for_ever_with_pauses_and_at_once_at_a_stop(tmp_path, monkeypatch):
    bench = Bench(tmp_path, monkeypatch, where="open", how="raise")
    bench.trigger.touch()
    bench.guard._take_over("it hangs")
    for _ in range(6000):
        assert bench.turn().at == RESCUING
    assert 28 <= bench.calls("fault open") <= 34, "60 s, every 2 s after some shorter pauses"
    reported = bench.shared.rescue.read()
    assert "it hangs; its safe state cannot be reached: " in read_text(reported.reason)
    assert reported.time < 1000.01, "it is told once"
    before = bench.calls("fault open")
    bench.shared.command.write(Command(REST, number=7))
    bench.turn(0.0)
    bench.turn(0.0)
    assert bench.calls("fault open") == before + 1
    bench.trigger.unlink()
    for _ in range(210):
        watch = bench.turn()
    assert (watch.at, watch.safe > 0.0) == (HOLDING, True)


def test_a_guard_that_holds_the_rig_writes_safe_values_at_every_stop(tmp_path, monkeypatch):
    bench = Bench(tmp_path, monkeypatch, "Reporting")
    bench.guard._take_over("it hangs")
    before = bench.calls("safe")
    for number in (3, 4, 9):
        bench.shared.command.write(Command(REST, number=number))
        assert bench.turn().rested == number
        assert bench.calls("safe") == before + 1
        before += 1
    assert bench.calls("open") == 1


def test_an_acknowledgement_starts_a_device_once_the_rig_is_safe(tmp_path, monkeypatch):
    bench = Bench(tmp_path, monkeypatch, where="safe", how="raise")
    bench.trigger.touch()
    bench.guard._take_over("it hangs")
    bench.shared.command.write(Command(REST, acknowledged=1, number=2))
    bench.turn(9.0)
    assert bench.started == []
    bench.trigger.unlink()
    bench.turn(9.0)
    bench.turn()
    assert len(bench.started) == 1
    assert bench.calls("close") == bench.calls("open"), "it is open once at most"


def test_where_no_device_can_be_started_the_guard_holds_the_rig_again(tmp_path, monkeypatch):
    def fail():
        raise BlockingIOError(11, os.strerror(11))

    bench = Bench(tmp_path, monkeypatch, "Reporting")
    bench.guard._take_over("it hangs")
    monkeypatch.setattr(bench.guard, "_start", fail)
    bench.shared.command.write(Command(REST, acknowledged=1, number=2))
    bench.turn()
    watch = bench.turn()
    assert (watch.at, watch.safe > 0.0) == (HOLDING, True)
    assert bench.calls("open") == 2
