"""Claims: of exchanges that wait only the newest of a session is carried out, all else in order;
operators come first, and may send what is theirs; telemetry is bounded, and signals end the server
or stop the rig.
"""

from __future__ import annotations

import json
import os
import signal
from collections import Counter
from itertools import pairwise
from types import SimpleNamespace

import pytest
import zmq

from fmus.rig_proxy import ProtocolError
from orchestration.rig.access import EVERYBODY, Peer
from orchestration.rig.keys import KeyHolder
from orchestration.rig.server import front as module
from orchestration.rig.server.front import EventLoop, ReceivedSignals, received_signals
from tests.support.command import posix


class Requests:
    """A socket that delivers what waits at once, and then says that the server is to end."""

    def __init__(self, messages, signals=None):
        self.messages, self.signals, self.sent = list(messages), signals, []

    def receive(self):
        if not self.messages:
            if self.signals is not None:
                self.signals.ending = "SIGTERM"
            raise zmq.Again
        name, *frames = self.messages.pop(0)
        return Peer(name, KeyHolder("", "acknowledge"), "127.0.0.1"), frames

    def send_multipart(self, frames, flags):
        self.sent.append(frames)

    def publish(self, text):
        """Telemetry, which nobody hears."""
        return True


class Handler:
    """A handler that writes down what it is to carry out; sessions are real-time ones."""

    def __init__(self):
        self.counts, self.done, self.stops, self.number = Counter(), [], [], 0

    def check(self, message):
        if message.get("session") == "misfit":
            raise ProtocolError("an exchange that does not fit")

    def drop_earlier(self, message, before):
        if message["session"] != before["session"]:
            return False
        self.counts["late"] += 1
        return True

    def answer(self, peer, message):
        what = message["sequence"] if message["type"] == "exchange" else message["type"]
        self.done.append((peer.connection.decode(), what))
        return b"reply"

    def supervise(self):
        pass

    def state(self):
        return "idle"

    def beat(self):
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
    return [peer, json.dumps({"ppy": 2, "type": "exchange", **fields}).encode()]


def request(kind, peer=b"b", **fields):
    return [peer, json.dumps({"ppy": 2, "type": kind, **fields}).encode()]


STATUS = [b"b", json.dumps({"ppy": 2, "type": "status"}).encode()]


@pytest.fixture(autouse=True)
def sockets_of_the_test(monkeypatch):
    poller = SimpleNamespace(register=lambda socket, flags: None, poll=lambda wait: [])
    monkeypatch.setattr(module.zmq, "Poller", lambda: poller)
    monkeypatch.setattr(module, "received", lambda socket, admission: socket.receive())
    # the garbage of the tests is their own
    monkeypatch.setattr(module, "Collector", lambda: SimpleNamespace(collect=lambda now: None))


@pytest.fixture
def serve():
    """Serve messages until none waits; return the handler, what was sent and the log."""

    def run(*messages, signals=None, operators=()):
        signals = signals or ReceivedSignals()
        requests, handler, log = Requests(messages, signals), Handler(), Log()
        sockets = SimpleNamespace(
            admission=EVERYBODY,
            requests=requests,
            telemetry=requests,
            operators=Requests(operators),
            turned_away=lambda: 0,
        )
        EventLoop(sockets, handler, log, signals).run()
        return handler, requests.sent + sockets.operators.sent, log.lines

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


def test_a_peer_that_has_not_said_its_name_is_not_listened_to(serve):
    handler, sent, lines = serve(
        request("stop", b"\0\1\2\3\4", reason="page"),
        operators=[request("acknowledge", b"\0\1\2\3\4", latch="")],
    )
    assert handler.done == sent == []
    assert handler.counts["turned away"] == 2
    assert "without a name" in lines[0]


def test_operators_come_first(serve):
    handler, _, _ = serve(STATUS, operators=[request("stop", b"o", reason="smoke")])
    assert handler.done == [("o", "stop"), ("b", "status")]


@pytest.mark.parametrize("kind", ["connect", "exchange", "disconnect"])
def test_operators_command_nothing(serve, kind):
    handler, _, lines = serve(operators=[request(kind, session="one")])
    assert handler.done == []
    assert handler.counts["malformed"] == 1
    assert "there are stop, acknowledge, shelve, status" in lines[0]


def test_clients_acknowledge_nothing(serve):
    handler, _, lines = serve(request("acknowledge", latch=""), request("stop", reason="smoke"))
    assert handler.done == [("b", "stop")]
    assert "'acknowledge'; there are connect" in lines[0]


def test_clients_that_keep_sending_hold_up_no_operator(monkeypatch, serve):
    """Clock of the test: a message takes a millisecond, and they never end."""
    clock = iter(100.0 + 1e-3 * k for k in range(10_000))
    monkeypatch.setattr(module, "monotonic", lambda: next(clock))
    handler, signals = Handler(), ReceivedSignals()
    requests = Requests([STATUS] * 1000, signals)
    operators = Requests([])
    receive = operators.receive

    def look():
        looks.append(len(handler.done))
        return receive()

    looks, operators.receive = [], look
    sockets = SimpleNamespace(
        admission=EVERYBODY,
        requests=requests,
        telemetry=requests,
        operators=operators,
        turned_away=lambda: 0,
    )
    EventLoop(sockets, handler, Log(), signals).run()
    assert len(handler.done) == 1000
    assert max(b - a for a, b in pairwise(looks)) <= 6


@pytest.mark.parametrize(("waiting", "expected"), [(1, 0), (450, 2)])
def test_a_flood_leaves_processor_time_to_others(monkeypatch, serve, waiting, expected):
    """As the front comes before all that has no real-time priority, such as an operator's stop."""
    clock = iter(100.0 + 1e-9 * k for k in range(100_000))
    monkeypatch.setattr(module, "monotonic", lambda: next(clock))
    rests = []
    monkeypatch.setattr(module, "sleep", rests.append)
    handler, *_ = serve(*[STATUS] * waiting)
    assert len(handler.done) == waiting
    assert len(rests) == expected


@pytest.mark.parametrize(("fresh", "most", "least"), [(True, 1 / 30, 1 / 31.5), (False, 0.2, 0.19)])
def test_telemetry_has_a_pace_whatever_the_rig_has(monkeypatch, serve, fresh, most, least):
    """Clock of the test: a loop takes a millisecond; new samples come at every one, or never."""
    monkeypatch.setattr(module, "monotonic", lambda: 100.0 + 1e-3 * Idle.loops)
    signals = ReceivedSignals()
    sent, handler = [], Handler()

    class Idle(Requests):
        loops = 0

        def receive(self):
            Idle.loops += 1
            handler.number += fresh
            if Idle.loops > 1000:
                signals.ending = "SIGTERM"
            raise zmq.Again

        def publish(self, text):
            sent.append(text)
            return True

    idle = Idle([], signals)
    sockets = SimpleNamespace(
        admission=EVERYBODY,
        requests=idle,
        telemetry=idle,
        operators=Requests([]),
        turned_away=lambda: 0,
    )
    EventLoop(sockets, handler, Log(), signals).run()
    assert 1.0 / most * 0.95 - 1 <= len(sent) <= 1.0 / least + 1


def test_a_server_whose_memory_fills_stops_the_rig_and_ends(monkeypatch):
    used = iter([5, 5, 5 + 2**30, 6 + 2**30])
    process = SimpleNamespace(memory_info=lambda: SimpleNamespace(rss=next(used)))
    monkeypatch.setattr(module.psutil, "Process", lambda: process)
    monkeypatch.setattr(module, "_LOOK", -1.0)
    handler, signals, idle = Handler(), ReceivedSignals(), Requests([])
    sockets = SimpleNamespace(
        admission=EVERYBODY, requests=idle, telemetry=idle, operators=idle, turned_away=lambda: 0
    )
    EventLoop(sockets, handler, Log(), signals).run()
    assert handler.stops == [signals.ending] == ["a peer filled 1024 MiB of memory"]
    assert next(used, None) is None


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
