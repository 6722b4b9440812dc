"""The native engine on a link that drops, delays, repeats, reorders, spoils and cuts what the rig
sends.
"""

from __future__ import annotations

import itertools
import random
import socket
import time

import pytest

from tests.support.rig.native_engine import CONNECTED, LATE, LOST, MEASURED, TIMES, started, steps
from tests.support.rig.relay import listening, relay
from tests.support.rig.scripted_rig import Reply, ScriptedRig, served

pytestmark = pytest.mark.real_time

COUNT = len(MEASURED)


def test_dropped_messages_are_missed_deadlines_and_no_hang(engine):
    rig, rng = ScriptedRig(COUNT, watchdog=10.0), random.Random(1)
    drop = {"share": 0.0}
    rig.exchanged = lambda request: (
        [] if rng.random() < drop["share"] else [(0.0, rig.sample(request))]
    )
    with served(rig) as endpoint:
        started(engine, endpoint, max_age=10.0)
        drop["share"] = 0.5
        answers = steps(engine, 0, 60)
    assert all(answer.ok for answer in answers)
    counts = [answer["missed_deadlines"] for answer in answers]
    assert counts == sorted(counts)
    assert 10 <= counts[-1] <= 50
    assert all(b - a in (0.0, 1.0) for a, b in itertools.pairwise(counts))


def test_a_reply_after_the_deadline_counts_and_is_taken_with_the_next_step(engine):
    """Counted from before the reply that is late: a busy machine may have missed one by then."""
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint, max_age=10.0)
        before = steps(engine, 0, 5)[-1]
        rig.exchanged = lambda request: [(0.09, rig.sample(request, values=[7.0] * COUNT))]
        answers = steps(engine, 5, 1)
        while answers[-1]["voltage"] != 7.0 and len(answers) < 100:
            answers += steps(engine, 5 + len(answers), 1)
    first, last = answers[0], answers[-1]
    assert first["missed_deadlines"] == before["missed_deadlines"] + 1.0
    assert first["voltage"] == 0.25  # held
    assert last["voltage"] == 7.0
    assert last["voltage_age"] >= 0.09  # the round trip is in it: an upper bound
    assert 2.0 <= last["missed_deadlines"] - before["missed_deadlines"] <= len(answers)


def test_replies_that_come_twice_or_out_of_order_are_taken_once_and_in_order(engine):
    rig = ScriptedRig(COUNT)
    held: list[Reply] = []

    def answer(request: dict) -> list[Reply]:
        reply = (0.0, rig.sample(request, values=[float(request["sequence"])] * COUNT))
        stale, held[:] = held[:], [reply]
        return [reply, reply, *stale]  # the one before comes once more, behind

    rig.exchanged = answer
    with served(rig) as endpoint:
        started(engine, endpoint)
        answers = steps(engine, 0, 20)
        count = len(rig.exchanges())
        old = [(0.0, rig.sample(rig.exchanges()[0], values=[-1.0] * COUNT))]
        rig.exchanged = lambda request: old  # and nothing else
        after = steps(engine, 20, 1)[0]
    values = [answer["voltage"] for answer in answers]
    assert values == sorted(values)
    assert values[-1] == count
    assert answers[-1]["missed_deadlines"] == 0.0
    assert (after["voltage"], after["missed_deadlines"]) == (values[-1], 1.0)


GARBAGE = [
    b"",
    b"\x00",
    b"{",
    b"null",
    b"[" * 60000,
    b'{"ppy":2,"type":"sample"}',
    b"\xff" * 500,
    b"x" * 65536,
    b"y" * 100000,
    b"y" * 200000,
    b'{"ppy":2,"type":"sample","values":[1e999]}',
    b'"' + b"\\u0000" * 1000 + b'"',
]


def test_garbage_among_the_replies_is_passed_over(engine):
    rig, rng = ScriptedRig(COUNT), random.Random(2)

    def answer(request: dict) -> list[Reply]:
        noise = [(0.0, rng.choice(GARBAGE)) for _ in range(4)]
        return [*noise, *rig.replies(request), *noise]

    rig.answer = answer
    with served(rig) as endpoint:
        started(engine, endpoint)
        answers = steps(engine, 0, 30)
    assert answers[-1]["missed_deadlines"] == 0.0
    assert answers[-1]["voltage"] == 0.25


@pytest.mark.parametrize(
    "changes",
    [
        {"session": "another"},
        {"sequence": 10**6},
        {"sequence": 0},
        {"sequence": 1.5},
        {"sequence": -1},
        {"sent": 1e300},
        {"values": []},
        {"ages": ["old"] * COUNT},
        {"state": None},
        {"refused": "no"},
        {"refused": [1]},
        {"ppy": 3},
        {"type": "telemetry"},
    ],
)
def test_a_sample_that_cannot_be_right_is_no_reply(engine, changes):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint)
        rig.exchanged = lambda request: [
            (0.0, rig.sample(request, **{"values": [9.0] * COUNT} | changes))
        ]
        answer = steps(engine, 0, 3)[-1]
    assert answer["missed_deadlines"] == 3.0
    assert answer["voltage"] == 0.0


def test_slow_bytes(engine):
    rig = ScriptedRig(COUNT)

    def trickle(client: socket.socket, data: bytes) -> None:
        for i in range(0, len(data), 7):
            client.sendall(data[i : i + 7])
            time.sleep(0.0002)

    with served(rig) as behind, listening(relay(behind, trickle)) as endpoint:
        started(engine, endpoint)
        assert steps(engine, 0, 10)[-1]["link_state"] == CONNECTED


@pytest.mark.parametrize("on_stale", ["hold", "fail"])
def test_a_connection_cut_in_the_middle_of_a_frame(engine, on_stale):
    rig = ScriptedRig(COUNT)
    cut = {"now": False, "for good": False}

    def spoil(client: socket.socket, data: bytes) -> None:
        if cut["now"]:
            cut["now"] = cut["for good"]
            client.sendall(data[: len(data) // 2])
            raise ConnectionAbortedError
        client.sendall(data)

    with served(rig) as behind, listening(relay(behind, spoil)) as endpoint:
        # A handshake is a dozen turns of four threads: the deadline leaves a busy machine time for
        # one.
        started(
            engine,
            endpoint,
            on_stale=on_stale,
            deadline=0.2,
            max_age=0.7,
            communication_timeout=1.0,
        )
        steps(engine, 0, 3)
        cut["now"] = True
        answers = steps(engine, 3, 30)
        assert answers[-1].ok  # the session went on over a new connection
        assert answers[-1]["link_state"] == CONNECTED
        assert 1.0 <= answers[-1]["missed_deadlines"] <= 3.0
        assert rig.sessions == 1
        cut["now"] = cut["for good"] = True
        last = steps(engine, 33, 1)[-1]
        begin, k = time.monotonic(), 34
        while last.ok and last["link_state"] != LOST and time.monotonic() - begin < 3.0:
            last = steps(engine, k, 1)[-1]
            k += 1
    if on_stale == "fail":
        assert "max_age is 0.7 s" in last.message
    else:
        assert last["link_state"] == LOST


def test_random_bytes_in_the_stream(engine):
    rig, rng = ScriptedRig(COUNT), random.Random(4)

    def spoil(client: socket.socket, data: bytes) -> None:
        spoilt = bytearray(data)
        if rng.random() < 0.3:
            spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
        client.sendall(spoilt)

    with served(rig) as behind, listening(relay(behind, spoil)) as endpoint:
        for _ in range(8):
            engine.set(**TIMES | {"endpoint": endpoint, "on_stale": "hold"})
            if engine.initialize().ok:
                steps(engine, 0, 20)
            engine.call("terminate")


def test_a_flood_does_not_hold_a_step(engine):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint)
        rig.exchanged = lambda request: [(0.0, b"{}")] * 20000
        assert steps(engine, 0, 4)[-1]["missed_deadlines"] >= 3.0


def test_heartbeats_are_answered(engine):
    """libzmq hangs up on a peer that does not answer its PING in time."""
    rig = ScriptedRig(COUNT, watchdog=100.0)  # so that nothing else is said for half a second
    with served(rig, heartbeat_ivl=30, heartbeat_timeout=100) as endpoint:
        started(engine, endpoint, communication_timeout=2.0)
        assert all(
            answer["missed_deadlines"] == 0.0
            for answer in [engine.advance(0.5 * k, 0.5) for k in range(3)]
        )
    assert rig.sessions == 1


@pytest.mark.parametrize("mode", ["real-time", "lockstep"])
def test_a_connection_that_was_given_up_between_steps_is_mended(engine, mode):
    """A master that pauses answers no PING; the session is as it was."""
    rig = ScriptedRig(COUNT, mode=mode, watchdog=100.0)
    with served(rig, heartbeat_ivl=30, heartbeat_timeout=100) as endpoint:
        started(engine, endpoint, communication_timeout=2.0, deadline=0.5)
        for k in range(2):
            time.sleep(0.4)
            answer = engine.advance(0.02 * k, 0.02)
            assert answer.ok, answer.message
            assert (answer["link_state"], answer["missed_deadlines"]) == (CONNECTED, 0.0)
    assert rig.sessions == 1
    assert len(rig.peers) == 3, "a connection each, under names of their own"


def test_a_server_that_takes_nothing_does_not_block(engine):
    """Once the buffers of the system are full, nothing goes out any more; the steps go on."""
    rig = ScriptedRig(COUNT)
    blocked = {"now": False}

    def stall(client: socket.socket, data: bytes) -> None:
        client.sendall(data)
        while blocked["now"]:
            time.sleep(0.01)

    with served(rig) as behind, listening(relay(behind, stall)) as endpoint:
        started(engine, endpoint, communication_timeout=60.0, deadline=1e-5, max_age=60.0)
        blocked["now"] = True
        answer = engine.call("burst", 1e-5, 30000)  # some 10 MB
        blocked["now"] = False
        time.sleep(0.3)
    assert answer.ok
    assert answer.seconds < LATE
    assert 1 < len(rig.exchanges()) < 30000  # they were full
