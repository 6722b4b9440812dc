"""Claims: three ports in a row are bound, and with keys nobody is let in without one."""

from __future__ import annotations

import contextlib
import socket as socket_of_the_system
import time

import pytest
import zmq

from fmus.kit import UserError
from fmus.rig_proxy import OPERATOR, read_client_keys
from orchestration.rig.keys import make_keys
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.sockets import opened
from tests.support.rig.raw_peer import RawPeer, post, say, version_2

real_time = pytest.mark.real_time

PATIENCE = 5000  # ms, for what takes some ten


@pytest.fixture
def client():
    context, made = zmq.Context(), []

    def connected(endpoint, keys=None, kind=zmq.DEALER):
        socket = context.socket(kind)
        made.append(socket)
        if keys is not None:
            keys.secure(socket)
        socket.connect(endpoint)
        return socket

    yield connected
    for socket in made:
        socket.close(linger=0)
    context.term()


def received(sockets) -> list[bytes]:
    assert sockets.requests.poll(PATIENCE)
    return sockets.requests.recv_multipart()


@real_time
def test_a_free_port_has_two_neighbours(client):
    with opened(ServerSettings("any", port=0, no_keys=True)) as sockets:
        for server, offset in ((sockets.requests, 0), (sockets.operators, 2)):
            assert sockets.endpoint(offset) == f"tcp://127.0.0.1:{sockets.port + offset}"
            socket = client(sockets.endpoint(offset))
            socket.send(b"hello")
            assert server.poll(PATIENCE)
            peer, message = server.recv_multipart()
            assert message == b"hello"
            server.send_multipart([peer, b"welcome"])
            assert socket.poll(PATIENCE)
            assert socket.recv() == b"welcome"
        watcher = client(sockets.endpoint(1), kind=zmq.SUB)
        watcher.subscribe(b"")
        until = time.monotonic() + PATIENCE / 1000
        while not watcher.poll(20):
            sockets.telemetry.publish(b"news")
            assert time.monotonic() < until
        assert sockets.requests.context is not sockets.operators.context
        assert sockets.turned_away() == 0


def test_operators_are_two_ports_above_clients():
    with opened(ServerSettings("any", port=0, no_keys=True)) as sockets:
        clients, operators = (
            int(socket.getsockopt_string(zmq.LAST_ENDPOINT).rpartition(":")[2])
            for socket in (sockets.requests, sockets.operators)
        )
    assert (clients, operators) == (sockets.port, sockets.port + 2)


@pytest.mark.parametrize("taken", [0, 1, 2], ids=["requests", "telemetry", "operators"])
def test_a_port_in_use_is_told_with_what_to_do(taken):
    with socket_of_the_system.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1] - taken
        with (
            pytest.raises(
                UserError, match=rf"^one of ports {port} to {port + 2} of .* choose other"
            ),
            opened(ServerSettings("any", port=port, no_keys=True)),
        ):
            pass


def test_ports_are_free_again_afterwards():
    with opened(ServerSettings("any", port=0, no_keys=True)) as sockets:
        port = sockets.port
    with opened(ServerSettings("any", port=port, no_keys=True)) as sockets:
        assert sockets.endpoint() == f"tcp://127.0.0.1:{port}"


def test_the_server_may_have_as_many_connections_as_the_system_allows():
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, before[1]))
    try:
        with opened(ServerSettings("any", port=0, no_keys=True)):
            assert resource.getrlimit(resource.RLIMIT_NOFILE) == (before[1], before[1])
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@real_time
def test_those_who_do_not_get_beyond_the_handshake_are_counted(client):
    """A browser, one of ZMTP 2, one that says nothing; and a client, who is not counted."""
    with opened(ServerSettings("any", port=0, no_keys=True)) as sockets:
        for data in (post(b"stop"), version_2(b"ppy-1", b"stop"), b""):
            say(sockets.port, data)
        say(sockets.port + OPERATOR, post(b"stop"))
        client(sockets.endpoint()).send(b"ours")
        assert received(sockets)[1] == b"ours"
        assert counted(sockets) == 4


@real_time
@pytest.mark.parametrize(("offset", "most"), [(0, 16 * 65536), (OPERATOR, 4096)])
def test_a_message_that_is_much_too_large_ends_its_connection(offset, most):
    with opened(ServerSettings("any", port=0, no_keys=True)) as sockets:
        with RawPeer(sockets.port + offset) as peer:
            peer.send(b"x" * most)
            socket = sockets.operators if offset else sockets.requests
            assert socket.poll(PATIENCE)
            socket.recv_multipart()
            with contextlib.suppress(ConnectionError):
                peer.send(b"x" * (most + 1))
            assert peer.is_closed()
        assert not socket.poll(50)


def counted(sockets, least: int = 4) -> int:
    """Return the number of those turned away, as soon as there are enough."""
    number, until = 0, time.monotonic() + PATIENCE / 1000
    while number < least and time.monotonic() < until:
        number += sockets.turned_away()
        time.sleep(0.02)
    return number


@real_time
def test_with_keys_a_known_client_is_let_in_and_others_are_counted(client, tmp_path):
    server_file, client_file = make_keys(tmp_path / "ours")
    own = read_client_keys(client_file)
    stranger = read_client_keys(make_keys(tmp_path / "theirs")[1])
    wrong = type(own)(own.server_key, stranger.public_key, stranger.secret_key)
    with opened(ServerSettings("any", port=0, keys=server_file)) as sockets:
        client(sockets.endpoint(), own).send(b"ours")
        assert received(sockets)[1] == b"ours"
        assert sockets.turned_away() == 0
        for keys in (None, wrong):
            # a client that is turned away cannot send any more
            with contextlib.suppress(zmq.Again):
                client(sockets.endpoint(), keys).send(b"theirs", zmq.NOBLOCK)
            assert counted(sockets, 1) >= 1
        assert not sockets.requests.poll(0)
