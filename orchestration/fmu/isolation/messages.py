"""Sending of Python objects over a byte stream, each after a mark and its length.

FMUs may print to the same stream, but will not write the mark by accident.
"""

from __future__ import annotations

import pickle
from io import FileIO
from typing import IO, Any

_MARK = b"\x93ppy\r\n\x1a\n"
_LENGTH_SIZE = 8  # bytes
_CHUNK = 2**20  # bytes read at once


def send(stream: IO[bytes], message: Any) -> None:
    """Send an object that can be pickled.

    Raises
    ------
    OSError
        If the other end is closed.
    """
    data = pickle.dumps(message)
    stream.write(_MARK + len(data).to_bytes(_LENGTH_SIZE, "little") + data)
    stream.flush()


def receive(stream: IO[bytes] | FileIO) -> Any:
    """Return the next object; None at the end of the stream or if it contains other data."""
    try:
        head = _read(stream, len(_MARK) + _LENGTH_SIZE)
        size = int.from_bytes(head[len(_MARK) :], "little") if head.startswith(_MARK) else 0
        data = _read(stream, size)
    except (OSError, ValueError):
        return None
    return pickle.loads(data) if data and len(data) == size else None


def _read(stream: IO[bytes] | FileIO, size: int) -> bytes:
    """Return the next `size` bytes, fewer at the end; an unbuffered stream needs several reads."""
    data = bytearray()
    while len(data) < size:
        chunk = stream.read(min(size - len(data), _CHUNK))
        if not chunk:
            break
        data += chunk
    return bytes(data)
