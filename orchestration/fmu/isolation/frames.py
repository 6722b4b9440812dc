"""Objects over a stream of bytes: each after its length."""

from __future__ import annotations

import pickle
from typing import IO, Any

_LENGTH = 8


def send(stream: IO[bytes], what: Any) -> None:
    """Send an object; OSError if nobody is there any more."""
    data = pickle.dumps(what)
    stream.write(len(data).to_bytes(_LENGTH, "little") + data)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Wait for the next object; None when there is none to come."""
    try:
        head = stream.read(_LENGTH)
        size = int.from_bytes(head, "little")
        data = stream.read(size) if len(head) == _LENGTH else b""
    except (OSError, ValueError):
        return None
    return pickle.loads(data) if data and len(data) == size else None
