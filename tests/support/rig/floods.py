"""Hostile peers of a server on this machine, in a process of their own, and the times of stops
beside them.

``python -m tests.support.rig.floods KIND PORT`` floods a port for a bounded time;
:func:`stop_times` measures.
"""

from __future__ import annotations

import socket
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import count
from pathlib import Path

import zmq

from fmus.rig_proxy import OPERATOR
from orchestration.rig.endpoint import Endpoint, read_endpoint
from orchestration.rig.keys import make_keys
from orchestration.rig.operator import ask
from tests.support.rig.process import Server, module_process
from tests.support.rig.raw_peer import RawPeer, frame, message

LONGEST = 60.0  # s that a flood lasts
CONNECTIONS = 1004
STRANGERS = 200  # handshakes in a second
PEERS = 4  # that send as fast as they can


def idle(port: int, until: float) -> None:
    """Hold connections on which nothing is said, and make those anew that are closed."""
    held: list[socket.socket] = []
    while time.monotonic() < until:
        while len(held) < CONNECTIONS:
            held.append(socket.create_connection(("127.0.0.1", port)))
            held[-1].setblocking(False)
        _tell_ready()
        time.sleep(0.05)
        for connection in list(held):
            with suppress(BlockingIOError, OSError):
                if connection.recv(100):
                    continue
                connection.close()
            if connection.fileno() < 0:
                held.remove(connection)


def silent(port: int, until: float) -> None:
    """Hold connections of peers that have said their name and say no more."""
    held = []
    for k in range(CONNECTIONS):
        with suppress(OSError):
            held.append(RawPeer(port, b"silent-%d" % k))
    _tell_ready()
    time.sleep(max(0.0, until - time.monotonic()))


def strangers(port: int, until: float) -> None:
    """Begin handshakes with keys that the server does not know."""
    public, _ = zmq.curve_keypair()
    with zmq.Context() as context:
        sockets: list[zmq.Socket[bytes]] = []
        for k in count():
            if time.monotonic() > until:
                break
            stranger = context.socket(zmq.DEALER)
            stranger.linger = 0
            stranger.reconnect_ivl = -1
            stranger.curve_serverkey = SERVER_KEY or public
            stranger.curve_publickey, stranger.curve_secretkey = zmq.curve_keypair()
            stranger.connect(f"tcp://127.0.0.1:{port}")
            sockets.append(stranger)
            if len(sockets) > STRANGERS // 2:
                sockets.pop(0).close()
            if k == 20:
                _tell_ready()
            time.sleep(1 / STRANGERS)
        context.destroy(linger=0)


def _sent(bodies: Callable[[int], bytes]) -> Callable[[int, float], None]:
    def flood(port: int, until: float) -> None:
        peers = [RawPeer(port, b"flood-%d" % k) for k in range(PEERS)]
        chunks = [b"".join(frame(bodies(k)) for _ in range(50)) for k in range(PEERS)]
        waiting = [b""] * PEERS
        for peer in peers:
            peer._socket.setblocking(False)
        _tell_ready()
        while time.monotonic() < until:
            for k, peer in enumerate(peers):
                waiting[k] = waiting[k] or chunks[k]
                with suppress(BlockingIOError):
                    waiting[k] = waiting[k][peer._socket.send(waiting[k]) :]
                with suppress(BlockingIOError):
                    peer._socket.recv(1 << 20)

    return flood


SERVER_KEY = sys.argv[3].encode() if len(sys.argv) > 3 and __name__ == "__main__" else b""
_CONNECT = {"inputs": {"current": "A", "force": "N"}, "outputs": {}, "time": 0.0}
FLOODS: dict[str, Callable[[int, float], None]] = {
    "idle": idle,
    "silent": silent,
    "strangers": strangers,
    "status": _sent(lambda k: message("status")),
    "malformed": _sent(lambda k: b"{" * 3000),
    "large": _sent(lambda k: b"{" * 60000),
    "connect": _sent(lambda k: message("connect", client="x", instance=f"{k}", **_CONNECT)),
    "stop": _sent(lambda k: message("stop", reason=f"{k}")),
}


# at which ports, as offsets; a large message ends its connection at the operators' port
CASES = [
    (kind, offset)
    for offset in (0, OPERATOR)
    for kind in FLOODS
    if (kind, offset) != ("large", OPERATOR)
]


def _tell_ready() -> None:
    with suppress(BrokenPipeError):
        print("ready", flush=True)


@contextmanager
def flooded(kind: str, port: int, server_key: str = "") -> Iterator[None]:
    """Flood a port while the context lasts."""
    with module_process(__name__, kind, port, server_key) as process:
        yield
        assert process.poll() is None, "the flood has ended"


@contextmanager
def flooded_server(kind: str, offset: int, folder: Path) -> Iterator[Endpoint]:
    """Serve a rig one of whose ports is flooded; without a kind, one that nobody floods."""
    server_file, client = make_keys(folder / "keys")
    has_keys = kind == "strangers"
    arguments = ("--keys", server_file) if has_keys else ("--no-keys",)
    with ExitStack() as opened:
        server = opened.enter_context(Server(folder, "Logged", *arguments))
        port = int(server.wait_ready().rpartition(":")[2])
        if kind:
            key = tomllib.loads(server_file.read_text())["public_key"] if has_keys else ""
            opened.enter_context(flooded(kind, port + offset, key))
        yield read_endpoint(server.endpoint, client if has_keys else None)


def stop_times(remote: Endpoint, number: int) -> list[float]:
    """Return the times that stops take until their answers, s, each on a connection of its own."""
    times = []
    for k in range(number):
        begun = time.monotonic()
        ask(remote, "stop", 5.0, reason=f"stop {k}")
        times.append(time.monotonic() - begun)
        time.sleep(0.02)
    return sorted(times)


if __name__ == "__main__":
    FLOODS[sys.argv[1]](int(sys.argv[2]), time.monotonic() + LONGEST)
