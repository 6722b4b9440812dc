"""Access to the sockets of a rig: other protocols are refused, and a sender is known by its key.

Peers speak by hand (`tests/support/rig/raw_peer.py`).
"""

from __future__ import annotations

import time
from dataclasses import replace

import pytest
import zmq

from fmus.rig_proxy import read_client_keys
from orchestration.rig.access import (
    EVERYBODY,
    HANDSHAKE,
    Admission,
    access_control,
    guard_access,
)
from orchestration.rig.access import received as received_from
from orchestration.rig.keys import KeyHolder, add_client, make_keys, read_server_keys
from tests.support.rig.raw_peer import RawPeer, message, post, say, smuggled, version_1, version_2

pytestmark = pytest.mark.real_time

PATIENCE = 5000  # ms
STOP = message("stop", reason="smoke")


def received(socket):
    return received_from(socket, EVERYBODY)


BOSS = KeyHolder("first-client", "acknowledge")


@pytest.fixture
def router():
    """A guarded ROUTER without keys, and its port."""
    with (
        zmq.Context() as context,
        access_control([context], EVERYBODY),
        context.socket(zmq.ROUTER) as socket,
    ):
        guard_access(socket)
        yield socket, socket.bind_to_random_port("tcp://127.0.0.1")


@pytest.mark.parametrize(
    "data",
    [
        post(STOP),
        *map(post, smuggled(STOP)),
        version_1(b"", STOP),
        version_1(b"ppy-1", STOP),
        version_2(b"ppy-1", STOP),
        b"\xff" + 7 * b"\0" + b"\x01\x7f" + b"\x00\x05" + version_1(b"ppy-1", STOP),
        b"GET / HTTP/1.1\r\nUpgrade: websocket\r\n\r\n",
    ],
    ids=[
        "post",
        "post-0",
        "post-1",
        "post-2",
        "1.0-unnamed",
        "1.0",
        "2.0",
        "1.0-signed",
        "websocket",
    ],
)
def test_what_is_no_zmtp_3_brings_no_message(router, data):
    socket, port = router
    begun = time.monotonic()
    assert not say(port, data).endswith(b"<open>")
    assert time.monotonic() - begun < HANDSHAKE / 1000 + 1.0
    assert not socket.poll(50)


@pytest.mark.parametrize("minor", [0, 1])
def test_a_peer_of_zmtp_3_is_known_by_the_name_it_said(router, minor):
    socket, port = router
    with RawPeer(port, b"ppy-12", minor) as peer:
        peer.send(STOP)
        assert socket.poll(PATIENCE)
        sender, frames = received(socket)
    assert (sender.connection, sender.has_name, frames) == (b"ppy-12", True, [STOP])
    assert str(sender) == sender.address == "127.0.0.1"


@pytest.mark.parametrize("name", [b"", b"\0abcd"])
def test_a_peer_without_a_name_is_known_as_such(router, name):
    socket, port = router
    with RawPeer(port, name) as peer:
        peer.send(STOP)
        assert socket.poll(PATIENCE)
        assert not received(socket)[0].has_name
    with pytest.raises(zmq.Again):
        received(socket)


def test_nobody_can_say_of_himself_who_he_is(router):
    socket, port = router
    claims = {"User-Id": b"acknowledge boss", "Peer-Address": b"10.0.0.1"}
    with RawPeer(port, b"ppy-1", **claims) as peer:
        peer.send(STOP)
        assert socket.poll(PATIENCE)
        sender, _ = received(socket)
    assert sender.holder == KeyHolder("", "acknowledge")  # of everybody where there are no keys
    assert sender.address == "127.0.0.1"


def test_who_connects_and_says_nothing_is_let_go_of(router):
    _, port = router
    begun = time.monotonic()
    assert say(port, b"").endswith((b"<closed>", b"<reset>"))
    assert 0.9 * HANDSHAKE / 1000 < time.monotonic() - begun < HANDSHAKE / 1000 + 1.0


def test_who_does_not_answer_any_more_is_let_go_of(router):
    _, port = router
    with RawPeer(port, b"ppy-1") as peer:  # which answers no PING here
        assert peer.is_closed(10.0)


def test_without_a_handler_nobody_is_let_in():
    with zmq.Context() as context, context.socket(zmq.ROUTER) as socket:
        guard_access(socket)
        port = socket.bind_to_random_port("tcp://127.0.0.1")
        with pytest.raises(OSError):
            RawPeer(port)


def heard(router, keys, file, patience=PATIENCE):
    """Return who is heard when the holder of a key file says something; None if nobody is."""
    with zmq.Context() as context, context.socket(zmq.DEALER) as client:
        client.linger, client.routing_id = 0, file.stem.encode()
        replace(read_client_keys(file), server_key=keys.public_key).secure(client)
        client.connect(router.last_endpoint)
        client.send(STOP)
        return received_from(router, Admission(keys.clients))[0] if router.poll(patience) else None


def test_a_key_says_name_and_role_of_its_holder_at_each_context(tmp_path):
    server_file, boss = make_keys(tmp_path / "ours")
    page = add_client(tmp_path / "ours", "page", "watch")
    _, stranger = make_keys(tmp_path / "theirs")
    keys = read_server_keys(server_file)
    contexts = [zmq.Context(), zmq.Context()]
    with access_control(contexts, Admission(keys.clients)):
        for context in contexts:
            with context.socket(zmq.ROUTER) as router:
                guard_access(router)
                router.curve_server = True
                router.curve_secretkey = keys.secret_key.encode()
                router.bind("tcp://127.0.0.1:*")
                assert heard(router, keys, stranger, 500) is None
                first = heard(router, keys, boss)
                assert (first.connection, first.holder) == (b"rig-client", BOSS)
                assert str(heard(router, keys, page)) == "page (watch) at 127.0.0.1"
    for context in contexts:
        context.term()
