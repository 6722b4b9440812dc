"""A peer that means ill, for as long as it is let: ``python -m tests.support.rig.hostile ENDPOINT
SECONDS``.

It sends what is no message, comes and goes under ever new names, speaks HTTP, greets and falls
silent, and asks hundreds of times at once.
"""

from __future__ import annotations

import itertools
import os
import socket
import sys
import time
from contextlib import suppress

from fmus.rig_proxy.protocol import TELEMETRY
from tests.support.rig.peer import Peer, operators

_PAUSE = 0.1  # s between two of its deeds: the machine is to be left to others
_FLOOD = 300  # messages at once
_HTTP = b'POST / HTTP/1.1\r\nHost: rig\r\nContent-Length: 30\r\n\r\n{"ppy":2,"type":"acknowledge"}'
_GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00NULL"


def malformed(endpoint: str) -> None:
    """Send what is no message."""
    with Peer(endpoint) as peer:
        for size in range(100):
            peer.socket.send(os.urandom(10 * size))
        peer.receive(0.02)


def comes_and_goes(endpoint: str) -> None:
    """Connect to every socket of the server, and go."""
    for place in (endpoint, operators(endpoint)):
        for _ in range(5):
            with Peer(place) as peer:
                peer.send("status")
                peer.receive(0.02)


def floods(endpoint: str) -> None:
    """Ask hundreds of times at once, and take no answer."""
    with Peer(endpoint) as peer:
        peer.socket.sndhwm = 0
        for _ in range(_FLOOD):
            peer.send("status")
        peer.receive(0.02)


def speaks_http(endpoint: str) -> None:
    """Send a web page's request, and the beginning of a greeting, to every port."""
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    for offset in (0, TELEMETRY):
        for text in (_HTTP, _GREETING):
            with suppress(OSError), socket.create_connection((host, int(port) + offset)) as to:
                to.sendall(text)
                to.settimeout(0.02)
                to.recv(64)


def main() -> None:
    """Do one thing after another until the time is over, or whoever started this has ended."""
    endpoint, seconds = sys.argv[1], float(sys.argv[2])
    until = time.monotonic() + seconds
    parent = os.getppid()
    for deed in itertools.cycle((malformed, comes_and_goes, floods, speaks_http)):
        if time.monotonic() > until or os.getppid() != parent:
            return
        deed(endpoint)
        time.sleep(_PAUSE)


if __name__ == "__main__":
    main()
