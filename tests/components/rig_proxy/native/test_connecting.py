"""The native engine where it cannot begin a session: each reason is told in a line, and within the
timeout.
"""

from __future__ import annotations

import json
import random
import socket
import time

import pytest
import zmq

from tests.support.rig.native_engine import FAREWELL, LATE, MEASURED, TIMEOUT, TIMES, NativeEngine
from tests.support.rig.relay import listening
from tests.support.rig.scripted_rig import ScriptedRig, message, served

pytestmark = pytest.mark.real_time

COUNT = len(MEASURED)


def refused_at_start(engine: NativeEngine, endpoint: str, bound: float = TIMEOUT) -> str:
    engine.set(**TIMES | {"endpoint": endpoint})
    answer = engine.initialize()
    assert not answer.ok
    assert answer.seconds < bound + LATE
    assert "\n" not in answer.message
    return answer.message


def unused_endpoint() -> str:
    with socket.create_server(("127.0.0.1", 0)) as unused:
        return f"tcp://127.0.0.1:{unused.getsockname()[1]}"


@pytest.mark.slow
def test_nobody_there(engine):
    endpoint = unused_endpoint()
    assert refused_at_start(engine, endpoint) == (
        f"no answer within 0.4 s from {endpoint}; is `ppy rig serve` running, or do the keys not"
        " match?"
    )


def test_a_server_that_starts_a_moment_later_is_found(engine):
    endpoint = unused_endpoint()
    engine.set(communication_timeout=2.0, endpoint=endpoint)
    process = engine._process
    process.stdin.write(b"initialize 0\n")
    process.stdin.flush()
    time.sleep(0.3)
    with served(ScriptedRig(COUNT), endpoint):
        assert process.stdout.readline().startswith(b"ok")


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"\xff",
        b"\xff" + bytes(8) + b"\x7f",
        b"\xff" + bytes(8) + b"\x7f\x03\x01NULL" + bytes(20),
    ],
    ids=["nothing", "a byte", "a signature", "half a greeting"],
)
def test_somebody_who_never_answers(engine, sent):
    with listening(lambda connection: connection.sendall(sent)) as endpoint:
        assert "no answer within 0.4 s" in refused_at_start(engine, endpoint)


def test_a_router_that_never_answers(engine):
    rig = ScriptedRig(COUNT)
    rig.answer = lambda request: []
    with served(rig) as endpoint:
        assert "no answer within 0.4 s" in refused_at_start(engine, endpoint)
    assert len(rig.requests) == 1


@pytest.mark.parametrize(
    ("greeting", "text"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "ZMTP 3"),
        (b"\x01\x00", "ZMTP 3"),  # ZMTP 1.0
        (b"\xff" + bytes(8) + b"\x7f\x01", "ZMTP 3"),  # ZMTP 2.0
        (b"\xff" + bytes(8) + b"\x7f\x03\x00CURVE" + bytes(15 + 32), "ppy rig bridge"),
        (b"\xff" + bytes(8) + b"\x7f\x03\x00PLAIN" + bytes(15 + 32), "authentication"),
        (b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"X" * 20 + bytes(32), "authentication"),
    ],
)
def test_somebody_with_whom_it_never_works_is_told_at_once(engine, greeting, text):
    with listening(lambda connection: connection.sendall(greeting)) as endpoint:
        assert text in refused_at_start(engine, endpoint, bound=0.0)


def test_a_server_with_keys(engine):
    public, secret = zmq.curve_keypair()
    options = {"curve_server": True, "curve_publickey": public, "curve_secretkey": secret}
    with served(ScriptedRig(COUNT), **options) as endpoint:
        assert (
            refused_at_start(engine, endpoint, bound=0.0)
            == "the rig asks for keys (CURVE), and this build has no encryption: `ppy rig bridge`"
            " carries the proxy on encrypted"
        )


def test_the_port_of_the_telemetry(engine):
    ready = b"\x05READY" + b"\x0bSocket-Type" + (3).to_bytes(4) + b"PUB"
    greeting = b"\xff" + bytes(8) + b"\x7f\x03\x00NULL" + bytes(16 + 32)
    with listening(
        lambda connection: connection.sendall(greeting + b"\x04" + bytes([len(ready)]) + ready)
    ) as endpoint:
        assert "telemetry" in refused_at_start(engine, endpoint, bound=0.0)


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (
            message("refused", reason="the rig is in its safe state since 14:02:11"),
            "since 14:02:11",
        ),
        ({"ppy": 3, "type": "accepted"}, "version 3 of the protocol, the proxy version 2"),
        (
            ScriptedRig(COUNT).accepted(values=[0.0] * (COUNT - 1) + [None]),
            f"the rig has no value of {MEASURED[-1]}",
        ),
    ],
)
def test_a_rig_that_cannot_be_used(engine, answer, text):
    rig = ScriptedRig(COUNT)
    rig.answer = lambda request: (
        [(0.0, answer)] if request["type"] == "connect" else rig.replies(request)
    )
    with served(rig) as endpoint:
        assert text in refused_at_start(engine, endpoint, bound=FAREWELL)


@pytest.mark.parametrize(
    "changes",
    [
        {"values": [0.0] * (COUNT + 1)},
        {"values": [True] * COUNT},
        {"values": {}},
        {"ages": None},
        {"mode": "odd"},
        {"session": 5},
        {"session": "x" * 4000},
        {"clock": "late"},
        {"limits": []},
        {"limits": {"a": {"min": "x"}}},
    ],
)
def test_an_answer_that_is_malformed_is_none(engine, changes):
    rig = ScriptedRig(COUNT)
    rig.answer = lambda request: [(0.0, rig.accepted(**changes))]
    with served(rig) as endpoint:
        assert "no answer within 0.4 s" in refused_at_start(engine, endpoint)


GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x01NULL" + bytes(16 + 32)
READY = b"\x05READY" + b"\x0bSocket-Type" + (6).to_bytes(4) + b"ROUTER"
ACCEPTED = json.dumps(ScriptedRig(COUNT).accepted()).encode()


@pytest.mark.real_time(limit=0.01)  # half of the time in which an answer must come
def test_random_streams_are_survived(engine):
    """A server's stream has a few bytes changed, cut or repeated: any end is right but a crash or a
    hang.
    """
    rng = random.Random(5)
    stream = (
        GREETING
        + b"\x04"
        + bytes([len(READY)])
        + READY
        + b"\x02"
        + len(ACCEPTED).to_bytes(8)
        + ACCEPTED
    )

    def say_something(connection: socket.socket) -> None:
        spoilt = bytearray(stream)
        for _ in range(rng.randrange(5)):
            place = rng.randrange(len(spoilt))
            edit = rng.choice(
                [b"", b"\xff", b"\x00", bytes([rng.randrange(256)]), spoilt[place : place + 9] * 2]
            )
            spoilt[place : place + rng.randrange(3)] = edit
        connection.sendall(spoilt)
        if rng.random() < 0.5:
            raise ConnectionAbortedError

    with listening(say_something) as endpoint:
        engine.set(endpoint=endpoint, communication_timeout=0.02, deadline=0.01)
        ends = [engine.initialize() for _ in range(150)]
    assert all(end.seconds < 0.02 + FAREWELL + LATE for end in ends)
    assert 3 < sum(end.ok for end in ends) < 147
    assert len({end.message for end in ends}) > 2
