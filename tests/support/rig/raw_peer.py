"""A peer that speaks ZMTP by hand, in versions 1.0, 2.0 and 3, written from the specifications
(ZeroMQ's RFC 13, 15, 23 and 37), or HTTP: it shares nothing with libzmq.
"""

from __future__ import annotations

import json
import socket
import time
from typing import Any

PATIENCE = 5.0  # s, for what takes milliseconds


def greeting(minor: int) -> bytes:
    """Return the greeting of ZMTP 3 with the mechanism NULL."""
    signature = b"\xff" + 8 * b"\0" + b"\x7f"
    return signature + bytes([3, minor]) + b"NULL".ljust(20, b"\0") + 32 * b"\0"


def ready(name: bytes, **properties: bytes) -> bytes:
    """Command READY of a DEALER that says its name, and perhaps more."""
    fields = {"Socket-Type": b"DEALER", "Identity": name, **properties}
    body = b"\x05READY" + b"".join(
        bytes([len(key)]) + key.encode() + len(value).to_bytes(4, "big") + value
        for key, value in fields.items()
    )
    return b"\x04" + bytes([len(body)]) + body


def frame(body: bytes, more: bool = False) -> bytes:
    """A frame of ZMTP 2 or 3."""
    if len(body) < 256:
        return bytes([more, len(body)]) + body
    return bytes([2 + more]) + len(body).to_bytes(8, "big") + body


def message(kind: str, **fields: Any) -> bytes:
    """A message of the protocol."""
    return json.dumps({"ppy": 2, "type": kind, **fields}).encode()


def version_1(name: bytes, body: bytes) -> bytes:
    """All that a peer of ZMTP 1.0 says: its name and a message, each with a length and flags."""
    return b"".join(bytes([len(part) + 1, 0]) + part for part in (name, body))


def version_2(name: bytes, body: bytes) -> bytes:
    """All that a peer of ZMTP 2.0 says: signature, revision, socket type DEALER, name, message."""
    return b"\xff" + 7 * b"\0" + b"\x01\x7f" + b"\x01\x05" + frame(name) + frame(body)


def smuggled(body: bytes) -> list[bytes]:
    """Bodies of HTTP requests, of which one is a message to who takes the request for ZMTP 1.0.

    There the P of POST is the length of a name, and whatever follows are frames: a row of twos,
    each the length of a frame of two bytes, brings any header into step with one of the three.
    """
    return [bytes([2]) * (300 + k) + version_1(b"", body)[2:] for k in range(3)]


def post(body: bytes) -> bytes:
    """Return the bytes that a browser sends for a request of a page, however the page tries."""
    head = f"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {len(body)}\r\n\r\n"
    return head.encode() + body


def say(port: int, data: bytes) -> bytes:
    """Send something, and return all that comes back until the other side closes."""
    answer = b""
    with socket.create_connection(("127.0.0.1", port), PATIENCE) as connection:
        try:
            connection.sendall(data)
            while more := connection.recv(4096):
                answer += more
        except ConnectionError:
            return answer + b"<reset>"
        except TimeoutError:
            return answer + b"<open>"
    return answer + b"<closed>"


class RawPeer:
    """A peer of ZMTP 3.1 without keys; a context.

    Parameters
    ----------
    port : int
    name : bytes
        Its identity.
    **properties
        More of its READY.
    """

    def __init__(self, port: int, name: bytes = b"raw", minor: int = 1, **properties: bytes):
        self._socket = socket.create_connection(("127.0.0.1", port), PATIENCE)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._data = b""
        try:
            self._shake_hands(name, minor, properties)
        except BaseException:
            self._socket.close()
            raise

    def _shake_hands(self, name: bytes, minor: int, properties: dict[str, bytes]) -> None:
        self._socket.sendall(greeting(minor))
        theirs = self._take(64)
        assert theirs[0] == 0xFF
        assert theirs[10] == 3
        self._socket.sendall(ready(name, **properties))
        flags, body = self._frame()
        assert flags & 4
        assert body.startswith(b"\x05READY")

    def _take(self, size: int) -> bytes:
        while len(self._data) < size:
            more = self._socket.recv(4096)
            if not more:
                raise ConnectionResetError("the server has closed the connection")
            self._data += more
        taken, self._data = self._data[:size], self._data[size:]
        return taken

    def _frame(self) -> tuple[int, bytes]:
        flags = self._take(1)[0]
        size = int.from_bytes(self._take(8 if flags & 2 else 1), "big")
        return flags, self._take(size)

    def send(self, *bodies: bytes) -> None:
        """Send a message of one or more frames."""
        last = len(bodies) - 1
        self._socket.sendall(b"".join(frame(body, k < last) for k, body in enumerate(bodies)))

    def receive(self, patience: float = PATIENCE) -> dict[str, Any] | None:
        """The next message; None if there is none. A PING is answered."""
        until = time.monotonic() + patience
        while (remaining := until - time.monotonic()) > 0:
            self._socket.settimeout(remaining)
            try:
                flags, body = self._frame()
            except TimeoutError:
                return None
            if not flags & 4:
                told: dict[str, Any] = json.loads(body)
                return told
            if body.startswith(b"\x04PING"):
                pong = b"\x04PONG" + body[7:]
                self._socket.sendall(b"\x04" + bytes([len(pong)]) + pong)
        return None

    def ask(self, kind: str, **fields: Any) -> dict[str, Any] | None:
        """Send a message and take the answer."""
        self.send(message(kind, **fields))
        return self.receive()

    def is_closed(self, patience: float = PATIENCE) -> bool:
        """Return True if the server closes the connection without an answer."""
        self._socket.settimeout(patience)
        try:
            while self._socket.recv(4096):
                continue
        except TimeoutError:
            return False
        except ConnectionError:
            pass
        return True

    def __enter__(self) -> RawPeer:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()
