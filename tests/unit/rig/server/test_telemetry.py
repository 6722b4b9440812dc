"""Telemetry goes to whoever asks for everything, and who asks for many topics fills no memory."""

from __future__ import annotations

import time

import pytest
import zmq

from orchestration.rig.server.telemetry import TelemetrySocket
from tests.support.rig.raw_peer import RawPeer, frame

pytestmark = pytest.mark.real_time

PATIENCE = 5.0  # s


@pytest.fixture
def made():
    """The sockets that were made, the telemetry, and its port."""
    with zmq.Context() as context, zmq.Context() as other, other.socket(zmq.XPUB) as free:
        port = free.bind_to_random_port("tcp://127.0.0.1")
        free.unbind(free.last_endpoint)
        sockets = []

        def make():
            sockets.append(context.socket(zmq.XPUB))
            return sockets[-1]

        until = time.monotonic() + PATIENCE
        while True:
            try:
                telemetry = TelemetrySocket(make, f"tcp://127.0.0.1:{port}")
                break
            except zmq.ZMQError:
                assert time.monotonic() < until
        yield sockets, telemetry, port
        telemetry.close()


def hears(telemetry, watcher):
    """Return True if a published message arrives."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        telemetry.publish(b"news")
        if watcher.poll(10):
            return watcher.recv() == b"news"
    return False


def test_many_topics_begin_it_anew_and_watchers_hear_it_again(made):
    sockets, telemetry, port = made
    with zmq.Context() as context, context.socket(zmq.SUB) as watcher:
        watcher.linger = 0
        watcher.reconnect_ivl = 20
        watcher.subscribe(b"")
        watcher.connect(f"tcp://127.0.0.1:{port}")
        assert hears(telemetry, watcher)
        opened = len(sockets)
        with RawPeer(port, b"greedy", **{"Socket-Type": b"SUB"}) as greedy:
            greedy.send(b"\x01")
            for k in range(101):
                greedy.send(b"\x01topic %d" % k)
            until = time.monotonic() + PATIENCE
            while telemetry.publish(b"news"):
                assert time.monotonic() < until
            assert sockets[-1].closed
        assert hears(telemetry, watcher)
        assert len(sockets) > opened


def test_many_watchers_do_not(made):
    sockets, telemetry, port = made
    opened = len(sockets)
    peers = [RawPeer(port, b"", **{"Socket-Type": b"SUB"}) for _ in range(150)]
    for peer in peers:
        peer._socket.sendall(frame(b"\x01"))
    until = time.monotonic() + 0.3
    while time.monotonic() < until:
        assert telemetry.publish(b"{}")
    assert len(sockets) == opened
    for peer in peers:
        assert peer.receive() == {}
        peer._socket.close()


def test_a_port_in_use_is_an_error(made):
    _, _, port = made
    with zmq.Context() as context, pytest.raises(zmq.ZMQError):
        TelemetrySocket(lambda: context.socket(zmq.XPUB), f"tcp://127.0.0.1:{port}")
