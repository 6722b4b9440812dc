"""Faults of bytes, below ZeroMQ: a listener on TCP, and a relay that spoils what a server sends
back.

Faults of whole messages are in :mod:`tests.support.rig.bad_link`.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


@contextmanager
def listening(behave: Callable[[socket.socket], None]) -> Iterator[str]:
    """Listen on TCP and do something to every connection, in threads; gives the endpoint."""
    listener = socket.create_server(("127.0.0.1", 0))
    listener.setsockopt(
        socket.SOL_SOCKET, socket.SO_RCVBUF, 4096
    )  # soon full, where a test stops reading
    listener.settimeout(0.02)
    over = threading.Event()
    threads: list[threading.Thread] = []
    connections: list[socket.socket] = []

    def handle(connection: socket.socket) -> None:
        with connection:
            connection.settimeout(0.02)
            try:
                behave(connection)
                over.wait()
            except OSError:
                pass

    def accept() -> None:
        while not over.is_set():
            try:
                connection, _ = listener.accept()
            except OSError:
                continue
            connections.append(connection)
            threads.append(threading.Thread(target=handle, args=(connection,), daemon=True))
            threads[-1].start()

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    try:
        yield f"tcp://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        over.set()
        for connection in connections:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        for each in (thread, *threads):
            each.join(5.0)
        listener.close()


def relay(
    endpoint: str, spoil: Callable[[socket.socket, bytes], None]
) -> Callable[[socket.socket], None]:
    """Pass bytes on to a server unchanged, and let `spoil` send those that come back; for
    `listening`.

    `spoil` raises `OSError` in order to hang up.
    """
    host, port = endpoint.removeprefix("tcp://").split(":")

    def behave(client: socket.socket) -> None:
        with socket.create_connection((host, int(port))) as server:
            server.settimeout(0.002)
            client.settimeout(0.002)
            while True:
                for source, send in (
                    (client, server.sendall),
                    (server, lambda data: spoil(client, data)),
                ):
                    try:
                        data = source.recv(65536)
                    except TimeoutError:
                        continue
                    if not data:
                        return
                    send(data)

    return behave
