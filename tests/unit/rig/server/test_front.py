"""Claims: of exchanges that wait only the newest of a session is carried out, all else in order;
telemetry is bounded, and signals end the server or stop the rig.
"""

from __future__ import annotations

import json
import os
import signal
from collections import Counter
from types import SimpleNamespace

import pytest
import zmq

from fmus.rig_proxy import ProtocolError
from orchestration.rig.server import front as module
from orchestration.rig.server.front import Front, ReceivedSignals, received_signals
from tests.support.command import posix


class Requests:
    """A socket that delivers what waits at once, and then says that the server is to end."""

    def __init__(self, messages, signals):
        self.messages, self.signals, self.sent = list(messages), signals, []

    def recv_multipart(self, flags):
        if not self.messages:
            self.signals.ending = "SIGTERM"
            raise zmq.Again
        return self.messages.pop(0)

    def send_multipart(self, frames, flags):
        self.sent.append(frames)

    def send(self, text, flags):
        """Of telemetry, which nobody hears."""


class Handler:
    """A handler that writes down what it is to carry out; sessions are real-time ones."""

    def __init__(self):
        self.counts, self.done, self.stops, self.number = Counter(), [], [], 0

    def check(self, message):
        if message.get("session") == "misfit":
            raise ProtocolError("an exchange that does not fit")

    def supersedes(self, message, before):
        if message["session"] != before["session"]:
            return False
        self.counts["late"] += 1
        return True

    def answer(self, peer, message):
        if message["type"] == "exchange":
            self.done.append((peer.decode(), message["sequence"]))
        else:
            self.done.append((peer.decode(), message["type"]))
        return b"reply"

    def supervise(self):
        pass

    def stop(self, reason):
        self.stops.append(reason)

    def sample_number(self):
        return self.number

    def telemetry(self):
        return b"telemetry"


class Log:
    def __init__(self):
        self.lines = []

    def tell(self, text, kind=""):
        self.lines.append(text)


def exchange(peer, sequence, session="one"):
    fields = {"session": session, "sequence": sequence, "sent": 0.0, "seen": 0.0}
    fields |= {"time": 0.0, "step": 0.1, "values": [0.5]}
    return [peer, json.dumps({"ppy": 1, "type": "exchange", **fields}).encode()]


STATUS = [b"b", json.dumps({"ppy": 1, "type": "status"}).encode()]


@pytest.fixture
def serve(monkeypatch):
    """Serve messages until none waits; return the handler, what was sent and the log."""
    monkeypatch.setattr(
        module, "Collector", lambda: SimpleNamespace(collect=lambda now: None)
    )  # the garbage of the tests is their own

    def run(*messages, signals=None):
        signals = signals or ReceivedSignals()
        requests, handler, log = Requests(messages, signals), Handler(), Log()
        sockets = SimpleNamespace(requests=requests, telemetry=requests, turned_away=lambda: 0)
        Front(sockets, handler, log, signals).run()
        return handler, requests.sent, log.lines

    return run


def test_a_message_is_answered_to_whom_it_came_from(serve):
    handler, sent, lines = serve(exchange(b"a", 1))
    assert handler.done == [("a", 1)]
    assert sent == [[b"a", b"reply"]]
    assert lines == []


@pytest.mark.parametrize("order", [(1, 2, 3), (3, 1, 2), (2, 3, 3)])
def test_of_a_session_that_waits_the_newest_is_carried_out(serve, order):
    handler, sent, _ = serve(*(exchange(b"a", number) for number in order))
    assert handler.done == [("a", 3)]
    assert len(sent) == 1
    assert handler.counts["late"] == 2


def test_an_exchange_of_another_session_lets_the_one_before_be_carried_out(serve):
    handler, _, _ = serve(exchange(b"a", 7), exchange(b"b", 1, "two"), exchange(b"b", 2, "two"))
    assert handler.done == [("a", 7), ("b", 2)]
    assert handler.counts["late"] == 1


def test_what_is_no_exchange_does_not_wait(serve):
    handler, _, _ = serve(exchange(b"a", 1), STATUS, exchange(b"a", 2))
    assert handler.done == [("b", "status"), ("a", 2)]


@pytest.mark.parametrize(
    ("frames", "said"),
    [
        ([b"a", b"one", b"two"], "dropped a message of 2 frames; it must be one"),
        ([b"a", b"\xff"], "dropped "),
        (exchange(b"a", 9, "misfit"), "dropped an exchange that does not fit"),
    ],
)
def test_what_is_no_message_is_dropped_counted_and_told(serve, frames, said):
    handler, sent, lines = serve(frames, exchange(b"a", 1))
    assert handler.done == [("a", 1)]
    assert handler.counts["malformed"] == 1
    assert len(sent) == 1
    assert lines[0].startswith(said)


@pytest.mark.parametrize(("fresh", "most", "least"), [(True, 1 / 30, 1 / 31.5), (False, 0.2, 0.19)])
def test_telemetry_has_a_pace_whatever_the_rig_has(monkeypatch, serve, fresh, most, least):
    """Clock of the test: a loop takes a millisecond; new samples come at every one, or never."""
    clock = iter(100.0 + 1e-3 * k for k in range(10_000))
    monkeypatch.setattr(module, "monotonic", lambda: next(clock))
    signals = ReceivedSignals()
    sent, handler = [], Handler()

    class Idle(Requests):
        loops = 0

        def recv_multipart(self, flags):
            Idle.loops += 1
            handler.number += fresh
            if Idle.loops > 1000:
                signals.ending = "SIGTERM"
            raise zmq.Again

        def send(self, text, flags):
            sent.append(text)

    idle = Idle([], signals)
    sockets = SimpleNamespace(requests=idle, telemetry=idle, turned_away=lambda: 0)
    Front(sockets, handler, Log(), signals).run()
    assert 1.0 / most * 0.95 - 1 <= len(sent) <= 1.0 / least + 1


def test_a_stop_is_carried_out_once(serve):
    signals = ReceivedSignals()
    signals.stopping = "SIGUSR1"
    # more than are taken at once: so the loop comes round before the server is to end
    handler, _, _ = serve(*([exchange(b"a", 1)] * (module._AT_ONCE + 1)), signals=signals)
    assert handler.stops == ["SIGUSR1"]
    assert signals.stopping == ""


@posix
def test_signals_are_taken_note_of_and_given_back():
    before = signal.getsignal(signal.SIGTERM)
    with received_signals() as signals:
        assert (signals.ending, signals.stopping) == ("", "")
        os.kill(os.getpid(), signal.SIGUSR1)
        assert (signals.ending, signals.stopping) == ("", "SIGUSR1")
        os.kill(os.getpid(), signal.SIGTERM)
        assert signals.ending == "SIGTERM"
    assert signal.getsignal(signal.SIGTERM) is before
