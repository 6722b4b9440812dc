"""Claims: a device carries out the newest command, goes safe by itself, and stays so until an
operator acknowledges.

It runs in a thread here, with nobody to watch it; whole servers are in `tests/end_to_end`.
"""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import pytest

from orchestration.rig.server import device as module
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.device import ENDED, Device
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.shared_memory import (
    END,
    REST,
    RUN,
    Command,
    SharedMemory,
    new_memory,
    pack,
    read_text,
    unpack,
)
from orchestration.rig.signals import Limit
from tests.support.rig import backends
from tests.support.rig.backends import Logged

pytestmark = pytest.mark.real_time

WATCHDOG = 0.15  # s
PATIENCE = 10.0  # s, for what takes milliseconds on an idle machine


def until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


class Bench:
    """A device under way, and the other end of its memory."""

    def __init__(self, folder, backend="Logged", description=None, **options):
        self.log = folder / "log"
        settings = ServerSettings(
            f"{backends.__file__}:{backend}",
            options={"log": str(self.log), **options},
            rate=200.0,
            watchdog=WATCHDOG,
        )
        memory = new_memory()
        self.shared = SharedMemory(memory)
        self.shared.command.write(Command())
        if description is not None:
            self.shared.description.write(description)
        self.device = Device(settings, SharedMemory(memory))
        self.thread = threading.Thread(target=self.device.run)
        self.thread.start()

    def command(self, values=(), order=RUN, acknowledged=0):
        now = time.monotonic()
        self.shared.command.write(Command(order, acknowledged, now, pack(values)))

    def applied(self):
        sample = self.shared.sample.read()
        return None if sample is None else unpack(sample.applied, 2)

    def keep_commanding(self, values, acknowledged, condition):
        """Command afresh until something holds."""

        def held():
            self.command(values, acknowledged=acknowledged)
            return condition()

        until(held)

    def calls(self):
        return [line.split(" ", 2)[2] for line in self.log.read_text().splitlines()]

    def end(self):
        self.device.end()
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.setattr(
        module, "Collector", lambda: SimpleNamespace(collect=lambda now: None)
    )  # the garbage of the tests is their own
    made = []

    def start(**about):
        made.append(Bench(tmp_path, **about))
        return made[-1]

    yield start
    for one in made:
        one.end()


def test_the_signals_are_described_and_the_rig_is_safe_before_any_command(bench):
    one = bench()
    until(lambda: one.applied() is not None)
    signals = BackendSignals.from_record(one.shared.description.read())
    assert signals.inputs == {"current": "A", "force": "N"}
    assert one.applied() == (0.0, 0.0)
    assert set(one.calls()) == {"open", "safe"}


def test_a_command_is_written_and_what_is_measured_is_published(bench):
    one = bench()
    one.keep_commanding((0.5, 2.0), 0, lambda: one.applied() == (0.5, 2.0))
    until(lambda: unpack(one.shared.sample.read().values, 2) == (1.0, 1.0))
    sample = one.shared.sample.read()
    assert all(sample.clock - 0.1 <= taken <= sample.clock for taken in unpack(sample.taken, 2))
    one.command(order=REST)
    until(lambda: one.applied() == (0.0, 0.0))
    assert one.shared.trip.read() is None
    assert one.calls()[-1] == "safe"


def test_without_a_fresh_command_it_goes_safe_and_stays_so_until_acknowledged(bench):
    one = bench()
    one.command((0.5, 2.0))
    begun = time.monotonic()
    until(lambda: one.shared.trip.read() is not None)
    trip = one.shared.trip.read()
    assert trip.time - begun >= WATCHDOG - 0.001
    assert (trip.reached, trip.ended) == (True, False)
    assert read_text(trip.reason) == (
        f"no fresh command for {WATCHDOG:g} s; a busy machine needs a longer --watchdog"
    )
    number = one.shared.sample.read().number
    one.keep_commanding((0.7, 2.0), 0, lambda: one.shared.sample.read().number > number + 10)
    assert one.applied() == (0.0, 0.0)
    one.keep_commanding((0.7, 2.0), 1, lambda: one.applied() == (0.7, 2.0))


def test_a_measured_value_beyond_its_limit_trips(bench, tmp_path):
    trigger = tmp_path / "trigger"
    one = bench(backend="Faulty", trigger=str(trigger), where="read", how="beyond")
    one.keep_commanding((0.5, 2.0), 0, lambda: one.applied() == (0.5, 2.0))
    trigger.touch()
    one.keep_commanding((0.5, 2.0), 0, lambda: one.shared.trip.read() is not None)
    assert "measured voltage 2.5 V is above 2 V" in read_text(one.shared.trip.read().reason)
    until(lambda: one.applied() == (0.0, 0.0))


def test_a_backend_that_raises_is_left_safe_and_closed(bench, tmp_path):
    trigger = tmp_path / "trigger"
    one = bench(backend="Faulty", trigger=str(trigger), where="write", how="raise")
    until(lambda: one.applied() is not None)
    trigger.touch()
    one.command((0.5, 2.0))
    one.thread.join(PATIENCE)
    trip = one.shared.trip.read()
    assert (trip.reached, trip.ended) == (True, True)
    assert read_text(trip.reason).startswith("write() raised OSError: [Errno 5] the cable of write")
    assert one.calls()[-2:] == ["safe", "close"]


def test_it_ends_safe_and_says_so(bench):
    one = bench()
    one.keep_commanding((0.5, 2.0), 0, lambda: one.applied() == (0.5, 2.0))
    one.command(order=END)
    one.thread.join(PATIENCE)
    assert one.calls()[-2:] == ["safe", "close"]
    beat = one.shared.beat.read()
    assert read_text(beat.call) == ENDED
    assert beat.safe > 0.0


def test_whatever_is_raised_it_goes_safe(bench, monkeypatch):
    one = bench()
    one.keep_commanding((0.5, 2.0), 0, lambda: one.applied() == (0.5, 2.0))

    def fail(*arguments):
        raise MemoryError

    monkeypatch.setattr(one.device._monitor, "check", fail)
    one.thread.join(PATIENCE)
    trip = one.shared.trip.read()
    assert (trip.reached, trip.ended, read_text(trip.reason)) == (True, True, "MemoryError()")
    assert one.calls()[-2:] == ["safe", "close"]


@pytest.mark.parametrize("values", [(4.0, 1.0), (0.5, -1.0), (float("nan"), 1.0), (1e300, 1.0)])
def test_a_command_beyond_its_limits_is_not_written_though_the_front_let_it_pass(bench, values):
    one = bench()
    one.keep_commanding((0.5, 2.0), 0, lambda: one.applied() == (0.5, 2.0))
    one.keep_commanding(values, 0, lambda: one.shared.trip.read() is not None)
    assert "has passed the limits of the front" in read_text(one.shared.trip.read().reason)
    until(lambda: one.applied() == (0.0, 0.0))
    assert {call for call in one.calls() if call.startswith("write")} == {"write 0.5 2.0"}


def test_signals_are_those_of_the_first_opening(bench):
    signals = BackendSignals(
        {"force": "N", "current": "A"}, Logged.outputs, {"current": Limit(-0.1, 0.1)}
    )
    one = bench(description=signals.to_record())
    one.keep_commanding((2.0, 0.05), 0, lambda: one.applied() == (2.0, 0.05))
    assert one.calls()[-1] == "write 0.05 2.0", "by name"
    one.keep_commanding((2.0, 0.5), 0, lambda: one.shared.trip.read() is not None)


def test_every_order_to_rest_is_written_although_it_is_safe_already(bench):
    one = bench()
    until(lambda: one.applied() is not None)
    for number in (1, 2):
        before = one.calls().count("safe")
        order = Command(REST, 0, time.monotonic(), number=number)
        one.shared.command.write(order)
        until(lambda known=before: one.calls().count("safe") > known)


def test_other_signals_than_at_the_first_opening_are_refused(bench):
    signals = BackendSignals({"current": "mA", "force": "N"}, Logged.outputs, {})
    one = bench(description=signals.to_record())
    one.thread.join(PATIENCE)
    assert "other signals than at the start" in read_text(one.shared.trip.read().reason)
    assert one.calls()[-2:] == ["safe", "close"]
