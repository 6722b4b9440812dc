"""Latch of the safe state: it says no more than is known, and opens for who names it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from orchestration.rig.server import latch as module
from orchestration.rig.server.alarms import Alarms
from orchestration.rig.server.latch import Latch
from orchestration.rig.server.latch_file import LatchKeeper, LatchRecord


class Rig:
    """A rig whose safe state the test confirms, with a bound of 0.3 s."""

    bound = 0.3

    def __init__(self):
        self.now, self.safe, self.orders, self.released, self.waiting = 1000.0, None, 0, 0, ""
        self.denied = ""
        self.signals = SimpleNamespace(unreported=[])

    def clock(self):
        return self.now

    def go_safe(self):
        self.orders += 1

    def safe_since(self):
        return self.safe

    def denial(self):
        return self.denied

    def release(self):
        self.released += 1

    def opening(self):
        return self.waiting


class Log:
    def __init__(self):
        self.lines = []

    def tell(self, text, kind=""):
        self.lines.append(text)


class Keeper(LatchKeeper):
    def __init__(self, held=None):
        self.held, self.kept = held, []

    def keep(self, record):
        self.kept.append(record)


class Trial:
    """A latch whose clocks the test sets, both in step."""

    def __init__(self, held=None):
        self.rig, self.log, self.keeper = Rig(), Log(), Keeper(held)
        self.alarms = Alarms(self.log)
        self.latch = Latch(self.rig, self.log, self.keeper, self.alarms)

    def after(self, seconds):
        self.rig.now += seconds
        self.latch.supervise()
        return self.latch.state


@pytest.fixture
def trial(monkeypatch):
    made = Trial()
    monkeypatch.setattr(module, "monotonic", lambda: made.rig.now)
    return made


def test_safe_is_said_when_it_is_confirmed_and_not_before(trial):
    trial.latch.close("stopped: smoke")
    assert trial.rig.orders == 1
    assert trial.latch.state == "stopping"
    assert trial.after(0.02) == "stopping"
    assert trial.latch.reached is None
    trial.rig.safe = 1000.012
    assert trial.after(0.01) == "safe"
    assert trial.latch.reached == pytest.approx(0.012)
    assert trial.log.lines == ["SAFE STATE: stopped: smoke", "safe, reached after 12 ms"]
    assert trial.alarms.text == ""


def test_a_rig_that_is_safe_already_is_safe_at_once(trial):
    trial.rig.safe = 990.0
    trial.latch.close("the device failed")
    assert (trial.latch.state, trial.latch.reached) == ("safe", 0.0)


def test_a_safe_state_that_is_not_confirmed_in_time_is_an_alarm_that_stays(trial):
    trial.latch.close("stopped: smoke")
    assert trial.after(0.29) == "stopping"
    assert trial.after(0.02) == "not reached"
    alarm = "THE SAFE STATE WAS NOT REACHED within 300 ms"
    assert trial.alarms.text == f"{alarm}; see to the rig itself"
    assert any(alarm in line for line in trial.log.lines)
    assert trial.latch.sentence().startswith("THE SAFE STATE OF THE RIG WAS NOT REACHED since ")
    trial.rig.safe = 1004.2
    assert trial.after(4.0) == "safe"
    assert trial.latch.reached == pytest.approx(4.2)
    assert alarm in trial.alarms.text
    assert trial.log.lines[-1] == "safe, reached after 4.2 s"
    assert trial.keeper.kept[-1].alarm == alarm


def test_a_confirmation_that_is_lost_is_not_told_any_more(trial):
    trial.rig.safe = 1000.0
    trial.latch.close("stopped: smoke")
    trial.rig.safe = None
    assert trial.after(0.1) == "stopping"
    assert trial.after(0.3) == "not reached"
    assert trial.latch.reached is None


def test_a_confirmation_that_is_lost_has_as_much_time_to_come_back(trial):
    """However long the rig was safe before: 0.3 s from the last time that it was seen."""
    trial.rig.safe = 1000.0
    trial.latch.close("stopped: smoke")
    for _ in range(10):
        assert trial.after(0.2) == "safe"
    trial.rig.safe = None
    assert trial.after(0.29) == "stopping"
    assert trial.after(0.02) == "not reached"


def test_what_the_device_denies_is_an_alarm_at_once_until_it_is_safe_again(trial):
    trial.rig.safe = 1000.0
    trial.latch.close("stopped: smoke")
    trial.rig.safe, trial.rig.denied = None, "the device has 1 A"
    assert trial.after(0.01) == "not reached"
    assert trial.alarms.text.startswith("THE SAFE STATE WAS NOT REACHED: the device has 1 A")
    trial.latch.close("stopped: again")
    assert trial.latch.state == "not reached", "a stop alone is no news of the device"
    trial.rig.safe, trial.rig.denied = 1000.2, ""
    assert trial.after(0.2) == "safe"
    assert "NOT REACHED" in trial.alarms.text


def test_the_time_to_the_safe_state_is_that_of_the_first_time(trial):
    trial.latch.close("stopped: smoke")
    trial.rig.safe = 1000.1
    assert trial.after(0.1) == "safe"
    assert trial.after(5.0) == "safe"
    trial.rig.safe = None
    assert trial.after(0.1) == "stopping"
    trial.rig.safe = 1005.3
    assert trial.after(0.2) == "safe"
    assert trial.latch.reached == pytest.approx(0.1)


def test_a_further_stop_waits_for_a_confirmation_of_its_own(trial):
    trial.rig.safe = 1000.0
    trial.latch.close("stopped: smoke")
    trial.rig.now += 10.0
    trial.rig.go_safe = lambda: setattr(trial.rig, "safe", None)
    trial.latch.close("stopped: again")
    assert trial.latch.state == "stopping"
    trial.rig.safe = 1010.03
    assert trial.after(0.1) == "safe"
    assert trial.latch.reached == pytest.approx(0.03)


def test_stops_that_follow_each_other_faster_than_they_are_seen_to_are_no_alarm(trial):
    """Each is confirmed before the next, and no moment is left to look between them."""
    trial.latch.close("stopped: 0")
    for k in range(100):
        trial.rig.now += 0.01
        trial.rig.safe = trial.rig.now
        go_safe = trial.rig.go_safe
        trial.rig.go_safe = lambda: setattr(trial.rig, "safe", None)
        trial.latch.close(f"stopped: {k}")
        trial.rig.go_safe = go_safe
    assert trial.latch.state == "stopping"
    assert trial.alarms.text == ""


def test_what_the_device_does_not_report_is_not_called_verified():
    rig = Rig()
    rig.safe = 1000.0
    assert Latch(rig, Log(), Keeper(), Alarms(Log())).fields()["verified"]
    rig.signals.unreported.append("force")
    latch = Latch(rig, Log(), Keeper(), Alarms(Log()))
    latch.close("stopped: smoke")
    assert not latch.fields()["verified"]
    assert "commanded safe, not verified: the device does not report force" in latch.sentence()


def test_further_stops_do_not_put_off_the_alarm(trial):
    trial.latch.close("stopped: smoke")
    for k in range(5):
        trial.rig.now += 0.1
        trial.latch.close(f"stopped: {k}")
    assert trial.latch.state == "not reached"
    assert trial.rig.orders == 6


def test_it_opens_for_its_name_alone(trial):
    trial.rig.safe = 1000.0
    trial.latch.close("stopped: smoke")
    first = trial.latch.name
    trial.latch.close("stopped: smoke")
    assert first != trial.latch.name
    for wrong in (first, ""):
        assert trial.latch.name in trial.latch.acknowledge(wrong, "lab")
        assert trial.latch.is_closed
    assert trial.rig.released == 0
    assert trial.latch.acknowledge(trial.latch.name, "lab") == ""
    assert not trial.latch.is_closed
    assert trial.rig.released == 1
    assert [record and record.reason for record in trial.keeper.kept] == [
        "stopped: smoke",
        "stopped: smoke",
        None,
    ]


def test_nothing_opens_before_the_safe_state_is_confirmed(trial):
    trial.latch.close("stopped: smoke")
    trial.after(0.4)
    assert trial.latch.acknowledge(trial.latch.name, "lab") == ""
    assert trial.latch.is_closed
    assert trial.latch.reason == "the safe state is not confirmed yet"
    trial.rig.safe, trial.rig.waiting = 1000.5, "the device is being opened"
    trial.after(0.1)
    assert trial.latch.reason == "the device is being opened"
    trial.rig.waiting = ""
    trial.after(0.1)
    assert not trial.latch.is_closed
    assert trial.alarms.text == ""


def test_a_device_that_is_opened_anew_has_time_to_start(trial):
    """Nobody can ask the device meanwhile; before, it was confirmed to be safe."""
    trial.rig.safe = 1000.0
    trial.latch.close("stopped: smoke")
    trial.rig.waiting = "the device is being opened"
    trial.latch.acknowledge(trial.latch.name, "lab")
    trial.rig.safe = None
    assert trial.after(5.2) == "stopping"
    assert trial.after(0.2) == "not reached"


def test_what_fails_while_it_opens_has_the_whole_bound_to_be_safe_again(trial):
    """As the device that is opened anew and cannot be read."""
    trial.rig.safe = 1000.0
    trial.latch.close("the cable is out")
    trial.rig.waiting = "the device is being opened"
    trial.latch.acknowledge(trial.latch.name, "lab")
    trial.rig.safe = None
    assert trial.after(0.4) == "stopping"
    trial.latch.close("the cable is out")
    assert trial.after(0.2) == "stopping"
    assert trial.after(0.2) == "not reached"


def test_what_stops_the_rig_while_it_opens_holds_it(trial):
    trial.rig.safe, trial.rig.waiting = 1000.0, "the device is being opened"
    trial.latch.close("stopped: smoke")
    first = trial.latch.name
    trial.latch.acknowledge(first, "lab")
    trial.latch.close("stopped: fire")
    trial.rig.waiting = ""
    trial.after(0.1)
    assert trial.latch.is_closed
    assert trial.latch.name != first
    assert trial.latch.reason == "stopped: fire"


def test_a_latch_that_was_kept_is_closed_from_the_start(monkeypatch):
    held = LatchRecord("0123456789abcdef", "stopped: smoke", "look at it", "2026-01-02 03:04:05")
    trial = Trial(held)
    monkeypatch.setattr(module, "monotonic", lambda: trial.rig.now)
    assert trial.latch.is_closed
    assert (trial.latch.name, trial.alarms.text) == ("0123456789abcdef", "look at it")
    assert "before this start: stopped: smoke" in trial.log.lines[1]
    trial.rig.safe = 999.0
    assert trial.after(0.01) == "safe"
    trial.latch.acknowledge("0123456789abcdef", "lab")
    assert not trial.latch.is_closed


def test_what_a_stranger_gives_for_a_reason_is_one_bounded_line(trial):
    trial.latch.close("stopped:\n" + "x" * 5000)
    assert "\n" not in trial.latch.reason
    assert len(trial.latch.reason) == 1000
