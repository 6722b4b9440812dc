"""Claims: each check passes on a rig whose protection works and fails on one whose does not; what
nobody answers is not confirmed; what is left out after a failure is not called passed.

The rig is one of the tests' own, which breaks one protection at a time.
"""

from __future__ import annotations

import time
from math import inf
from types import SimpleNamespace

import pytest

from fmus.kit import UserError
from orchestration.plugins.commission import ServedRig, procedure
from orchestration.plugins.commission.protocol import (
    FAILED,
    NOT_APPLICABLE,
    NOT_CONFIRMED,
    PASS,
    Row,
)

BOUND = 0.25
TITLES = [check.title for check in procedure.CHECKS]


class Process:
    def __init__(self, rig, pid):
        self.rig, self.pid = rig, pid

    def kill(self):
        self.rig.acts.append(("kill", self.pid))
        if self.pid == "standby" and self.rig.broken != "standby":
            self.rig.standby = "another"

    def suspend(self):
        self.rig.acts.append(("suspend", self.pid))


class Newcomer:
    def connect(self, begin, timeout):
        raise procedure.LinkError("latched")

    def close(self):
        pass


class FakeRig:
    """A rig of one input from −1 to 1 A, driven to 0.2 A; `broken` names what does not work."""

    bound, words, credentials = BOUND, (), None
    rest, targets = {"current": 0.0}, {"current": 0.2}
    remote, inputs, drives = None, {"current": "A"}, True

    def __init__(self, broken="", rate=inf, interlock="", answer=None, beats=False, names=("d",)):
        self.broken, self.answers, self.acts, self.log = broken, answer, [], []
        self.standby = "standby"
        self.limits = {"current": {"min": -1.0, "max": 1.0, "rate": rate}}
        limits = (
            self.limits | {interlock: {"min": 0.5, "max": 1.5, "rate": None}} if interlock else {}
        )
        self.status = {
            "state": "idle",
            "latch": "",
            "reason": "",
            "reached": 0.012,
            "period": 0.01,
            "watchdog": 0.2,
            "limits": limits,
            "inputs": {"current": "A"},
            "outputs": {"voltage": "V", **({interlock: "1"} if interlock else {})},
        }
        self.device = SimpleNamespace(
            backend="fake", options={}, names=names, facts={}, has_heartbeat=beats
        )
        self.rows = []
        self.is_over = False
        self.turn()

    def _row(self, value=0.2, state="running"):
        values = {"current": value}
        self.rows.append(Row(time.monotonic(), state, values, values, values))

    def ask(self, question):
        return self.answers

    def answer(self, question):
        return {True: PASS, False: FAILED, None: NOT_CONFIRMED}[self.answers]

    def describe(self, values):
        return str(dict(values))

    def link(self, **inputs):
        return Newcomer()

    def ramp(self, name):
        return 0.05 if self.broken == "rates" else 0.4

    def deviations(self, values, wanted):
        return "" if values == wanted or self.broken != "front" else "current 1 A"

    found = ServedRig.found

    def begin(self):
        self.is_over, self.verdict, self.marks = False, PASS, ()
        self._row()

    def release(self):
        self.status |= {"state": "idle", "latch": ""}

    def exchange(self, values):
        if self.broken == "limits" and abs(values["current"]) > 1.0:
            return True
        if self.status["latch"] and self.broken == "release":
            return True
        if self.is_over:
            raise procedure.LinkError("over")
        return not self.status["latch"] and 0.0 < abs(values["current"]) <= 1.0

    def turn(self):
        self._row()

    def wait(self, done, timeout):
        if self.status["outputs"].get("door"):
            self.status |= {"latch": "a", "reason": "measured door 0 1 is below 0.5 1"}
        until = time.monotonic() + min(timeout, 0.1)
        while not done() and time.monotonic() < until:
            self.turn()
        return done()

    def wait_safe(self, fault, latch=""):
        self.status |= {"state": "safe", "latch": f"{len(self.acts)}"}
        if self.broken == "safe":
            self.status["state"] = "not reached"
            raise UserError("NOT REACHED")
        return "safe"

    def processes(self):
        roles = {"front": "front", "guard": "guard", "device": "device", "standby": self.standby}
        return {role: Process(self, pid) for role, pid in roles.items()}

    def kill_front(self):
        return self.broken != "left"

    def start(self):
        self.status["latch"] = "" if self.broken == "latch" else "b"

    def read_device(self):
        return {} if self.broken == "mute" else {"current": 0.0}

    def close(self):
        self.acts.append(("close", ""))
        return 0


@pytest.fixture(autouse=True)
def operators(monkeypatch):
    """The requests of an operator go nowhere; another name is refused, and a stop is taken."""

    def ask(remote, kind, **fields):
        if kind == "acknowledge":
            raise UserError("refused")

    monkeypatch.setattr(procedure.operator, "ask", ask)
    monkeypatch.setattr(procedure.operator, "acknowledge", lambda *arguments: None)
    monkeypatch.setattr(procedure, "_IMPORTS", 0.0)


def verdicts(rig):
    told = []
    protocol = procedure.commission(rig, told.append)
    assert list(protocol.lines) == told
    return {line.title: line.verdict for line in protocol.lines}, protocol


def acknowledged(rig, monkeypatch):
    """An acknowledgement ends the session of before."""
    monkeypatch.setattr(
        procedure.operator, "acknowledge", lambda *arguments: setattr(rig, "is_over", True)
    )
    return rig


def test_a_rig_whose_protections_work_passes(monkeypatch):
    rig = acknowledged(FakeRig(rate=0.5, beats=True, answer=True), monkeypatch)
    found, protocol = verdicts(rig)
    assert list(found) == [*TITLES[:-1], "Interlocks", TITLES[-1]]
    assert {title for title, verdict in found.items() if verdict != PASS} == {"Interlocks"}
    assert protocol.summary == "12 pass, 1 not applicable"
    assert not protocol.has_failed
    assert rig.acts == [
        ("kill", "device"),
        ("kill", "guard"),
        ("kill", "standby"),
        ("kill", "guard"),
        ("suspend", "device"),
        ("suspend", "device"),
        ("close", ""),
    ]


@pytest.mark.parametrize(
    ("broken", "title"),
    [
        ("limits", "Limits"),
        ("rates", "Rates"),
        ("standby", "Standby killed"),
        ("release", "Release"),
        ("left", "Front killed"),
        ("front", "Front killed"),
        ("latch", "Front killed"),
    ],
)
def test_a_protection_that_does_not_work_fails_and_no_other(monkeypatch, broken, title):
    rig = FakeRig(broken, rate=0.5)
    if broken != "release":
        acknowledged(rig, monkeypatch)
    if broken == "front":
        rig.read_device = lambda: {"current": 1.0}
    found, protocol = verdicts(rig)
    failed = [title for title, verdict in found.items() if verdict == FAILED]
    assert failed == [title]
    assert protocol.has_failed


def test_a_rate_that_the_level_cannot_show_is_not_confirmed():
    rig = FakeRig(rate=2.0)
    rig.exchange = lambda values: True
    assert "larger --level" in procedure._rates(rig)
    assert rig.verdict == NOT_CONFIRMED
    rig.limits["current"]["rate"] = 0.5  # the jump is beyond what 0.2 s allow
    with pytest.raises(UserError, match="the jump is not refused"):
        procedure._rates(rig)


def test_nothing_is_driven_any_more_when_the_safe_state_was_not_reached():
    found, protocol = verdicts(FakeRig("safe"))
    assert list(found) == ["Limits", "Rates", "Stop"]
    assert found["Stop"] == FAILED
    assert "not reached" in protocol.interrupted


@pytest.mark.parametrize(
    ("answer", "verdict"), [(True, PASS), (False, FAILED), (None, NOT_CONFIRMED)]
)
def test_the_operator_says_whether_the_relay_dropped(answer, verdict):
    found, _ = verdicts(FakeRig(beats=True, answer=answer))
    assert found["Heartbeat"] == verdict


def test_a_question_that_does_not_apply_is_not_asked():
    found, _ = verdicts(FakeRig(names=()))
    assert {found[title] for title in ("Rates", "Heartbeat", "Interlocks")} == {NOT_APPLICABLE}


def test_an_interlock_is_opened_by_the_operator_or_not_confirmed():
    found, _ = verdicts(FakeRig(interlock="door"))
    assert found["Interlock door"] == NOT_CONFIRMED
    found, protocol = verdicts(FakeRig(interlock="door", answer=True))
    assert found["Interlock door"] == PASS, protocol.lines


def test_an_interlock_that_latches_nothing_fails():
    rig = FakeRig(interlock="door", answer=True)
    rig.wait = lambda done, timeout: False
    with pytest.raises(UserError, match="no latch within 60 s"):
        procedure._interlock(rig, "door")


def test_a_device_that_does_not_say_what_it_has_is_not_confirmed():
    found, _ = verdicts(FakeRig("mute"))
    assert found["Front killed"] == NOT_CONFIRMED


def test_an_interrupt_keeps_what_was_done_and_ends_the_server():
    rig = FakeRig()

    def interrupt(line):
        raise KeyboardInterrupt

    protocol = procedure.commission(rig, interrupt)
    assert [line.title for line in protocol.lines] == ["Limits"]
    assert protocol.interrupted == "interrupted by the operator"
    assert rig.acts == [("close", "")]


@pytest.mark.parametrize("step", ["release", "begin"])
def test_a_rig_that_cannot_be_used_ends_the_procedure_with_the_reason(step):
    rig = FakeRig()

    def latched():
        raise UserError("the rig cannot be used: smoke")

    setattr(rig, step, latched)
    protocol = procedure.commission(rig, print)
    assert not protocol.lines
    assert protocol.interrupted == "the rig cannot be used: smoke"
