"""Rules of the protocol: each is found broken at a server that breaks it, and told with what was
seen. All of them hold at the server as it is (`test_check.py`).
"""

from __future__ import annotations

import pytest

from orchestration.rig import access
from orchestration.rig.server import front, latch, request_handler, sockets
from orchestration.rig.server.session import Session
from tests.support.rig.conformance.probe import BrokenError, NotTriedError, Probe
from tests.support.rig.conformance.rules import RULES

pytestmark = pytest.mark.real_time


def rule(part):
    (found,) = (each for each in RULES if part in each.text)
    return found


def replaced(monkeypatch, place, name, value):
    monkeypatch.setattr(place, name, value)


def wrong_sample(monkeypatch):
    encode = request_handler.encode
    monkeypatch.setattr(
        request_handler,
        "encode",
        lambda kind, **fields: encode(
            kind, **{**fields, **({"sent": 0.0} if kind == "sample" else {})}
        ),
    )


def takes_any_unit(monkeypatch):
    misfit = request_handler.describe_misfit

    def without_units(message, signals):
        units = {name: signals.inputs.get(name, unit) for name, unit in message["inputs"].items()}
        return misfit({**message, "inputs": units}, signals)

    monkeypatch.setattr(request_handler, "describe_misfit", without_units)


def one_latch(monkeypatch):
    monkeypatch.setattr(latch, "token_hex", lambda size: "always the same")


def counts_nothing(monkeypatch):
    status = request_handler.RequestHandler._status

    def told(self):
        self.counts["malformed"] = 0
        return status(self)

    monkeypatch.setattr(request_handler.RequestHandler, "_status", told)


def keeps_its_session(monkeypatch):
    monkeypatch.setattr(
        request_handler.RequestHandler, "_end_session", lambda self, how: self._rig.go_safe()
    )


def ends_any_session(monkeypatch):
    def disconnect(self, peer, message):
        self._end_session("disconnected")
        return request_handler.encode("disconnected")

    monkeypatch.setattr(request_handler.RequestHandler, "_disconnect", disconnect)


def answers_any_session(monkeypatch):
    exchange = request_handler.RequestHandler._exchange

    def answered(self, peer, message):
        key = "" if self._session is None else self._session.key
        return exchange(self, peer, {**message, "session": key})

    monkeypatch.setattr(request_handler.RequestHandler, "_exchange", answered)


@pytest.mark.parametrize(
    ("part", "spoil", "seen"),
    [
        (
            "what is no ZMTP 3",
            lambda m: replaced(m, sockets, "guard_access", lambda socket: None),
            "keeps a connection 1.0 open|stopped by one of them",
        ),
        (
            "has not said its name",
            lambda m: replaced(m, access.Peer, "has_name", True),
            "answers it",
        ),
        (
            "operators' socket takes no connect",
            lambda m: replaced(m, front, "_OF_OPERATORS", front.REQUESTS),
            "connect is answered at the operators'",
        ),
        (
            "operators' socket takes no connect",
            lambda m: replaced(m, front, "_OF_CLIENTS", front.REQUESTS),
            "acknowledge is answered at the clients'",
        ),
        ("malformed message", counts_nothing, "0 of 8 are counted"),
        ("does not fit is refused", takes_any_unit, "another unit of current is answered by acc"),
        (
            "one client at a time",
            lambda m: replaced(m, Session, "may_be_taken_up", lambda self, message, peer: True),
            "another instance of the same name is answered by accepted",
        ),
        (
            "may connect again",
            lambda m: replaced(m, Session, "may_be_taken_up", lambda self, message, peer: False),
            "a connect that fits is answered by .*refused",
        ),
        ("brings back sequence and sent", wrong_sample, "it has "),
        (
            "not taken twice",
            lambda m: replaced(m, Session, "repeats", lambda self, message, counts: False),
            "3 after 3 is answered",
        ),
        ("not the present one", answers_any_session, "it is answered by .*sample"),
        ("disconnect ends its own session and no", ends_any_session, "exchange 2 is answered by"),
        ("disconnect ends its own session and no", keeps_its_session, "the state is running then"),
        (
            "beyond a limit is refused",
            lambda m: replaced(m, request_handler.CommandFilter, "take", lambda self, *of: []),
            "current = 2.3 is carried out",
        ),
        ("every stop is another latch", one_latch, "two stops have latches"),
        (
            "every stop is another latch",
            lambda m: replaced(m, latch.Latch, "acknowledge", lambda self, name, who: ""),
            "is answered by status",
        ),
        ("does not outlive", keeps_its_session, "not idle: the state is 'running'"),
        (
            "telemetry is published",
            lambda m: replaced(m, front, "_SILENCE", 1.0),
            "messages a second",
        ),
    ],
)
def test_a_rule_is_found_broken(server, monkeypatch, part, spoil, seen):
    spoil(monkeypatch)
    with server() as remote:
        probe = Probe(remote, beyond_limits=True)
        try:
            with pytest.raises(BrokenError, match=seen):
                rule(part).check(probe)
        finally:
            probe.close()


@pytest.mark.parametrize("part", ["under way for longer", "goes safe, latched", "beyond a limit"])
def test_what_cannot_be_tried_is_told_as_such(server, part):
    with server() as remote:
        probe = Probe(remote)
        try:
            with pytest.raises(NotTriedError):
                rule(part).check(probe)
        finally:
            probe.close()
