"""The rig protocol, version 2: its messages and their encoding (``docs/reference/protocol.md``).

Needs the standard library alone: it is part of the Python FMU, and the server imports it.
"""

from __future__ import annotations

import json
import sys
from secrets import token_hex
from typing import Any

from ..kit import UserError

VERSION = 2
MAX_FRAME = 65536  # bytes
PORT = 5570  # of a client's requests
TELEMETRY, OPERATOR = 1, 2  # offsets of the ports of telemetry and of an operator's requests
ENDPOINT = f"tcp://127.0.0.1:{PORT}"

REAL_TIME, LOCKSTEP = "real-time", "lockstep"
IDLE, RUNNING = "idle", "running"
# latched: on the way to the safe state, confirmed to be in it, and not in it within the bound
STOPPING, SAFE, NOT_REACHED = "stopping", "safe", "not reached"
LATCHED = (STOPPING, SAFE, NOT_REACHED)


class ProtocolError(UserError):
    """A frame is not a message of the protocol; the text says why."""


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_number(value: Any) -> bool:
    # an integer may be too large for a float
    return (
        isinstance(value, (int, float))
        and not isinstance(value, bool)
        and abs(value) <= sys.float_info.max
    )


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53


def _is_number_or_null(value: Any) -> bool:
    return value is None or _is_number(value)


def _is_numbers(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_number, value))


def _is_values(value: Any) -> bool:
    return isinstance(value, list) and all(v is None or _is_number(v) for v in value)


def _is_texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


def _is_units(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_is_text, value.values()))


def _is_limits(value: Any) -> bool:
    return isinstance(value, dict) and all(
        isinstance(limit, dict)
        and all(limit.get(key) is None or _is_number(limit[key]) for key in LIMIT_KEYS)
        for limit in value.values()
    )


def _is_mapping(value: Any) -> bool:
    return isinstance(value, dict)


LIMIT_KEYS = ("min", "max", "rate")

_SAMPLE = {"values": _is_values, "ages": _is_values}
_RIG = {"mode": _is_text, "period": _is_number, "watchdog": _is_number, "limits": _is_limits}
# `latch` is the name of the active latch, `reached` the time from it to the safe state in s, and
# `alarm` a text on all alarms that nobody has acknowledged
_STATE = {
    "state": _is_text,
    "reason": _is_text,
    "latch": _is_text,
    "reached": _is_number_or_null,
    "alarm": _is_text,
    "clock": _is_number,
    "client": _is_text,
}
_NAMED = {"inputs": _is_units, "outputs": _is_units}

# Fields that each message must have, in addition to its version and type. `key`, `take_over` and
# `operator` may be missing, as at those that were written before them.
REQUESTS = {
    "connect": {"client": _is_text, "instance": _is_text, **_NAMED, "time": _is_number},
    "exchange": {
        "session": _is_text,
        "sequence": _is_count,
        "sent": _is_number,
        "seen": _is_number,
        "time": _is_number,
        "step": _is_number,
        "values": _is_numbers,
    },
    "disconnect": {"session": _is_text},
    "hand_over": {"session": _is_text},
    "stop": {"reason": _is_text},
    "acknowledge": {"latch": _is_text},  # or the name of an alarm
    "shelve": {"alarm": _is_text, "time": _is_number},
    "status": {},
}
REPLIES = {
    "accepted": {"session": _is_text, "clock": _is_number, **_RIG, **_SAMPLE},
    "refused": {"reason": _is_text},
    "sample": {
        "session": _is_text,
        "sequence": _is_count,
        "sent": _is_number,
        "clock": _is_number,
        **_SAMPLE,
        "state": _is_text,
        "reason": _is_text,
        "refused": _is_texts,
    },
    "disconnected": {},
    "offered": {},
    "status": {**_STATE, **_RIG, **_NAMED, "counts": _is_mapping},
    "telemetry": {
        **_STATE,
        "inputs": _is_mapping,
        "read_back": _is_mapping,
        "outputs": _is_mapping,
        "ages": _is_mapping,
        "command_age": _is_number_or_null,
        "refused": _is_texts,
    },
}


def new_name() -> bytes:
    """Return a unique name for a connection, which a server requires."""
    return f"ppy-{token_hex(8)}".encode()


def encode(kind: str, **fields: Any) -> bytes:
    """Encode a message.

    Parameters
    ----------
    kind : str
        Type of the message.
    **fields
        Its other fields; numbers are finite.

    Returns
    -------
    bytes
        One frame.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    return json.dumps(
        {"ppy": VERSION, "type": kind, **fields}, allow_nan=False, separators=(",", ":")
    ).encode()


def decode(frame: bytes, known: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Decode a message.

    Parameters
    ----------
    frame : bytes
        Frame as received.
    known : dict
        :data:`REQUESTS` for a server, :data:`REPLIES` for a client.

    Returns
    -------
    dict of str to object
        Fields of the message, including ``type``.

    Raises
    ------
    ProtocolError
        If the frame is too long, not a JSON object, of another version or an unknown type, or if a
        field is missing or not valid.
    """
    if len(frame) > MAX_FRAME:
        raise ProtocolError(f"a frame of {len(frame)} bytes; {MAX_FRAME} are allowed")
    try:
        message = json.loads(frame)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(f"a frame that is no JSON ({type(error).__name__})") from error
    if not isinstance(message, dict):
        raise ProtocolError("a frame that is no JSON object")
    if message.get("ppy") != VERSION:
        raise ProtocolError(
            f"protocol version {str(message.get('ppy'))[:20]}; this is version {VERSION}"
        )
    kind = message.get("type")
    fields = known.get(kind) if isinstance(kind, str) else None
    if fields is None:
        raise ProtocolError(f"a message of type {str(kind)[:40]!r}; there are {', '.join(known)}")
    for name, is_right in fields.items():
        if name not in message or not is_right(message[name]):
            raise ProtocolError(
                f"a message {kind} whose {name} is {str(message.get(name, 'missing'))[:60]}"
            )
    return message
