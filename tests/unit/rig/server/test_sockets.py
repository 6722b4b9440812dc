"""Claims: two neighbouring ports are bound, and with keys nobody is let in without one."""

from __future__ import annotations

import contextlib
import time

import pytest
import zmq

from fmus.kit import UserError
from fmus.rig_proxy import read_client_keys
from orchestration.rig.keys import make_keys
from orchestration.rig.server.settings import ServerSettings
from orchestration.rig.server.sockets import opened

pytestmark = pytest.mark.real_time

PATIENCE = 5000  # ms, for what takes some ten


@pytest.fixture
def client():
    context, made = zmq.Context(), []

    def connected(endpoint, keys=None):
        socket = context.socket(zmq.DEALER)
        made.append(socket)
        if keys is not None:
            keys.unlock(socket)
        socket.connect(endpoint)
        return socket

    yield connected
    for socket in made:
        socket.close(linger=0)
    context.term()


def received(sockets) -> list[bytes]:
    assert sockets.requests.poll(PATIENCE)
    return sockets.requests.recv_multipart()


def test_a_free_port_has_its_neighbour_for_telemetry(client):
    with opened(ServerSettings("any", port=0)) as sockets:
        ports = [
            int(endpoint.rpartition(":")[2])
            for endpoint in (sockets.endpoint, sockets.telemetry_endpoint)
        ]
        assert ports[1] == ports[0] + 1
        socket = client(sockets.endpoint)
        socket.send(b"hello")
        peer, message = received(sockets)
        assert message == b"hello"
        sockets.requests.send_multipart([peer, b"welcome"])
        assert socket.poll(PATIENCE)
        assert socket.recv() == b"welcome"
        assert sockets.turned_away() == 0


@pytest.mark.parametrize("taken", [0, 1], ids=["requests", "telemetry"])
def test_a_port_in_use_is_told_with_what_to_do(taken):
    with opened(ServerSettings("any", port=0)) as sockets:
        port = int(sockets.endpoint.rpartition(":")[2]) + 1 - taken
        free = port if taken else port - 1
        with (
            pytest.raises(UserError, match=rf"^port {free} or {free + 1} of .* choose another one"),
            opened(ServerSettings("any", port=free)),
        ):
            pass


def test_ports_are_free_again_afterwards():
    with opened(ServerSettings("any", port=0)) as sockets:
        port = int(sockets.endpoint.rpartition(":")[2])
    with opened(ServerSettings("any", port=port)) as sockets:
        assert sockets.endpoint == f"tcp://127.0.0.1:{port}"


def test_with_keys_a_known_client_is_let_in_and_others_are_counted(client, tmp_path):
    server_file, client_file = make_keys(tmp_path / "ours")
    own = read_client_keys(client_file)
    stranger = read_client_keys(make_keys(tmp_path / "theirs")[1])
    wrong = type(own)(own.server_key, stranger.public_key, stranger.secret_key)
    with opened(ServerSettings("any", port=0, keys=server_file)) as sockets:
        client(sockets.endpoint, own).send(b"ours")
        assert received(sockets)[1] == b"ours"
        assert sockets.turned_away() == 0
        for keys in (None, wrong):
            # a client that is turned away cannot send any more
            with contextlib.suppress(zmq.Again):
                client(sockets.endpoint, keys).send(b"theirs", zmq.NOBLOCK)
            until = time.monotonic() + PATIENCE / 1000
            while not sockets.turned_away():
                assert time.monotonic() < until
                time.sleep(0.005)
        assert not sockets.requests.poll(0)
