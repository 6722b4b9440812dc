"""Objects over a stream of bytes: each after a mark, which nobody else writes by accident, and its length."""

from __future__ import annotations

import pickle
from io import FileIO
from typing import IO, Any

_MARK, _LENGTH = b"\x93ppy\r\n\x1a\n", 8
_AT_ONCE = 2**20


def send(stream: IO[bytes], what: Any) -> None:
    """Send an object; OSError if nobody is there any more."""
    data = pickle.dumps(what)
    stream.write(_MARK + len(data).to_bytes(_LENGTH, "little") + data)
    stream.flush()


def receive(stream: IO[bytes] | FileIO) -> Any:
    """Wait for the next object; None when there is none to come, or somebody else has written there."""
    try:
        head = _read(stream, len(_MARK) + _LENGTH)
        size = int.from_bytes(head[len(_MARK) :], "little") if head.startswith(_MARK) else 0
        data = _read(stream, size)
    except (OSError, ValueError):
        return None
    return pickle.loads(data) if data and len(data) == size else None


def _read(stream: IO[bytes] | FileIO, size: int) -> bytes:
    """Read as many bytes, fewer only if there are no more to come; a stream without a buffer gives some at a time."""
    found = bytearray()
    while len(found) < size and (more := stream.read(min(size - len(found), _AT_ONCE))):
        found += more
    return bytes(found)
