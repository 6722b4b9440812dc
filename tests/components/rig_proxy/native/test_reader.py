"""The native engine reads a frame as Python's own reader does, or not at all, whatever may arrive.

Every frame is read by the engine compiled with the sanitizers, from memory of exactly its size.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from fmus.rig_proxy import protocol
from tests.support.rig.native_engine import MEASURED, NativeEngine

COUNT = len(MEASURED)
STATES = ("running", "stopping", "safe", "not reached")
KINDS = ("none", "accepted", "refused", "sample", "disconnected", "foreign")
# what the driver prints of a frame, in order
COLUMNS = (
    "type",
    "session",
    "sequence",
    "numbers",
    "lockstep",
    "state",
    "reason",
    "refusals",
    "refusal",
    "values",
    "ages",
)
NUMBERS = ("sent", "clock", "period", "watchdog")
OF_KIND = {
    "accepted": ("type", "session", "clock", "period", "watchdog", "lockstep", "values", "ages"),
    "sample": (
        *("type", "session", "sequence", "sent", "clock", "values", "ages"),
        *("state", "reason", "refusals", "refusal"),
    ),
    "refused": ("type", "reason"),
    "disconnected": ("type",),
}


@pytest.fixture(scope="module")
def reader(driver: Path) -> Iterator[NativeEngine]:
    made = NativeEngine(driver)
    yield made
    made.close()


def read(reader: NativeEngine, frame: bytes) -> dict[str, Any]:
    """Return the fields that the engine has found, or {} if the frame is nothing to it."""
    told = dict(zip(COLUMNS, reader.line("frame", frame.hex()).split("\t"), strict=True))
    fields = {
        **told,
        **dict(zip(NUMBERS, floats(told["numbers"]), strict=True)),
        "type": KINDS[int(told["type"])],
        "sequence": int(told["sequence"]),
        "lockstep": told["lockstep"] == "1",
        "state": STATES[int(told["state"])],
        "refusals": int(told["refusals"]),
        "refusal": told["refusal"] if told["refusals"] != "0" else "",
        "values": floats(told["values"]),
        "ages": floats(told["ages"]),
    }
    return {name: fields[name] for name in OF_KIND.get(fields["type"], ())}


def floats(text: str) -> list[float]:
    return [float.fromhex(number) for number in text.split(" ")]


def shown(text: str) -> str:
    """A sentence on one line, as long as the engine keeps it; half a surrogate pair is no
    character.
    """
    clean = "".join(
        " " if c < " " else "\N{REPLACEMENT CHARACTER}" if "\ud800" <= c < "\ue000" else c
        for c in text
    )
    return clean.encode()[:511].decode(errors="ignore")


def numbers(values: list[float | None]) -> list[float]:
    return [math.nan if value is None else float(value) for value in values]


def expected(message: dict[str, Any]) -> dict[str, Any]:
    """The same fields as Python reads them."""
    kind = message["type"]
    if kind in ("refused", "disconnected"):
        return {"type": kind} | ({"reason": shown(message["reason"])} if kind == "refused" else {})
    fields = {name: message[name] for name in ("type", "session", "clock")}
    fields |= {"values": numbers(message["values"]), "ages": numbers(message["ages"])}
    if kind == "accepted":
        fields |= {name: message[name] for name in ("period", "watchdog")}
        return fields | {"lockstep": message["mode"] == "lockstep"}
    fields |= {
        "sequence": message["sequence"],
        "sent": message["sent"],
        "state": message["state"],
    }
    refused = message["refused"]
    return fields | {
        "reason": shown(message["reason"]),
        "refusals": len(refused),
        "refusal": shown(refused[0]) if refused else "",
    }


def assert_no_message(reader: NativeEngine, value: bytes) -> None:
    assert read(reader, b'{"ppy":2,"type":"disconnected","x":1}')
    assert not read(reader, b'{"ppy":2,"type":"disconnected","x":' + value + b"}")


def same(found: dict[str, Any], wanted: dict[str, Any]) -> bool:
    def text(fields: dict[str, Any]) -> str:
        return repr({k: fields[k] for k in sorted(fields)} | {"session": fields.get("session")})

    return text(found) == text({k: float(v) if k in NUMBERS else v for k, v in wanted.items()})


NUMBER = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**70), 2**70)
PRESENT = st.lists(st.none() | NUMBER, min_size=COUNT, max_size=COUNT)
WORD = st.text(st.characters(min_codepoint=32, exclude_categories=["Cs"]), max_size=30)
ANY = st.recursive(
    st.none() | st.booleans() | NUMBER | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=12,
)
LIMIT = st.fixed_dictionaries(
    {}, optional={name: st.none() | NUMBER for name in protocol.LIMIT_KEYS}
)
FIELDS = {
    "accepted": {
        "session": WORD,
        "clock": NUMBER,
        "mode": st.sampled_from(["real-time", "lockstep"]),
        "period": NUMBER,
        "watchdog": NUMBER,
        "limits": st.dictionaries(WORD, LIMIT, max_size=3),
        "values": PRESENT,
        "ages": PRESENT,
    },
    "sample": {
        "session": WORD,
        "sequence": st.integers(0, 2**53 - 1),
        "sent": NUMBER,
        "clock": NUMBER,
        "values": PRESENT,
        "ages": PRESENT,
        "state": st.sampled_from(STATES),
        "reason": st.text(max_size=700),
        "refused": st.lists(st.text(max_size=30), max_size=3),
    },
    "refused": {"reason": st.text()},
    "disconnected": {},
}
MESSAGES = st.sampled_from(sorted(FIELDS)).flatmap(
    lambda kind: st.builds(
        lambda fields, extra: {**extra, "ppy": 2, "type": kind, **fields},
        st.fixed_dictionaries(FIELDS[kind]),
        st.dictionaries(st.text(max_size=8), ANY, max_size=3),
    )
)
STYLES = st.fixed_dictionaries(
    {
        "ensure_ascii": st.booleans(),
        "indent": st.none() | st.integers(0, 3),
        "sort_keys": st.booleans(),
    }
)
often = settings(max_examples=50, suppress_health_check=[HealthCheck.too_slow], derandomize=True)


@pytest.mark.slow
@often
@given(message=MESSAGES, style=STYLES)
def test_every_good_message_is_read_as_python_reads_it(reader, message, style):
    frame = json.dumps(message, **style).encode("utf-8", "surrogatepass")
    try:
        frame.decode()
    except UnicodeDecodeError:
        assert read(reader, frame) == {}
        return
    if len(frame) > protocol.MAX_FRAME:
        return
    wanted = expected(protocol.decode(frame, protocol.REPLIES))
    if len(wanted.get("session", "").encode()) <= 127:
        assert same(read(reader, frame), wanted)


def mutated(frame: bytes, edits: list[tuple[int, str, bytes]]) -> bytes:
    for at, what, inserted in edits:
        place = at % (len(frame) + 1)
        match what:
            case "cut":
                frame = frame[:place]
            case "insert":
                frame = frame[:place] + inserted + frame[place:]
            case "replace":
                frame = frame[:place] + inserted + frame[place + len(inserted) :]
            case "repeat":
                frame = frame[:place] + frame[max(0, place - 20) :]
            case "drop":
                frame = frame[:place] + frame[place + 1 :]
    return frame[: protocol.MAX_FRAME]


TOKENS = [
    b"{",
    b"}",
    b"[",
    b"]",
    b",",
    b":",
    b'"',
    b"\\",
    b"\\u",
    b"\\ud83d",
    b"\\udc00",
    b"null",
    b"true",
    b"-",
    b"0",
    b".",
    b"e",
    b"1e999",
    b"-0",
    b"00",
    b"NaN",
    b"\x00",
    b"\xff",
    b"\xc3",
    b"\xed\xa0\x80",
    b"\xf4\x90\x80\x80",
    b"\xc0\xaf",
    b" ",
    b"\n",
    b"\t",
    b'"values":',
    b'"ppy":3,',
    b'"type":"sample",',
]
EDITS = st.lists(
    st.tuples(
        st.integers(0, 5000),
        st.sampled_from(["cut", "insert", "replace", "repeat", "drop"]),
        st.sampled_from(TOKENS) | st.binary(max_size=4),
    ),
    min_size=1,
    max_size=4,
)


def strict(frame: bytes) -> dict[str, Any] | None:
    """Read a frame in Python, as strictly as the standard is: UTF-8, no NaN, no infinity."""

    def refuse(name: str) -> Any:
        raise ValueError(name)

    try:
        json.loads(frame.decode(), parse_constant=refuse)
        return protocol.decode(frame, protocol.REPLIES)
    except (ValueError, RecursionError, protocol.ProtocolError, OverflowError):
        return None


@often
@given(message=MESSAGES, style=STYLES, edits=EDITS)
@pytest.mark.slow
def test_a_mutated_message_is_read_as_python_reads_it_or_not_at_all(reader, message, style, edits):
    frame = mutated(json.dumps(message, **style).encode("utf-8", "surrogatepass"), edits)
    found, wanted = read(reader, frame), strict(frame)
    if not found:
        return
    assert wanted is not None
    assert same(found, expected(wanted))


@pytest.mark.slow
@often
@given(frame=st.binary(max_size=400))
@example(b"")
@example(b"[" * 60000)
@example(b'{"a":' * 12000)
@example(b'"' + b"\\" * 4001)
@example(b'{"ppy":2,"type":"refused","reason":"\\u123')
@example(b"1" * 60000)
@example(b'{"ppy":' + b"1" * 60000 + b"}")
@example(b'{"ppy":2,"type":"refused","reason":"' + b"\\ud800" * 5000 + b'"}')
@example(b'{"ppy":2,"type":"refused","reason":"' + "\N{SNOWMAN}".encode() * 10000 + b'"}')
@example(b'{"ppy":2,"type":"sample","values":[' + b"null," * 10000 + b"null]}")
def test_any_bytes_are_survived(reader, frame):
    found, wanted = read(reader, frame), strict(frame)
    assert not found or (wanted is not None and same(found, expected(wanted)))


@pytest.mark.parametrize(
    "text",
    [
        "01",
        "1.",
        ".5",
        "+1",
        "1e",
        "1e+",
        "- 1",
        "0x10",
        "1_0",
        "Infinity",
        "NaN",
        "--1",
        "1.e3",
        "truE",
        "nul",
        '"\\x"',
        '"\\u12g4"',
        '"\t"',
        "[1,]",
        "[,1]",
        "[1 2]",
        '{"a"}',
        '{"a":}',
        '{"a":1,}',
        "{a:1}",
        "[",
        "]",
        "{}{}",
        "1 2",
        "/**/1",
        "'a'",
        "\ufeff1",
        '"\ud800"',
    ],
)
def test_what_is_no_json_is_no_message(reader, text):
    assert_no_message(reader, text.encode("utf-8", "surrogatepass"))


@pytest.mark.parametrize(
    "character",
    [
        b"\x80",
        b"\xc0\xaf",
        b"\xe0\x80\xaf",
        b"\xf0\x80\x80\xaf",
        b"\xf4\x90\x80\x80",
        b"\xe2\x98",
        b"\xff",
    ],
)
def test_what_is_no_utf_8_is_no_message(reader, character):
    assert_no_message(reader, b'"' + character + b'"')


@pytest.mark.parametrize("depth", [31, 32])
def test_nesting_has_a_limit(reader, depth):
    frame = b'{"ppy":2,"type":"disconnected","x":' + b"[" * depth + b"]" * depth + b"}"
    assert bool(read(reader, frame)) == (depth < 32)


@pytest.mark.parametrize("count", [0, COUNT - 1, COUNT + 1, 5000])
@pytest.mark.parametrize("name", ["values", "ages"])
def test_there_are_as_many_values_as_were_asked_for(reader, name, count):
    message = {
        "ppy": 2,
        "type": "sample",
        "session": "s",
        "sequence": 1,
        "sent": 1.0,
        "clock": 1.0,
        "state": "running",
        "reason": "",
        "refused": [],
        "values": [1.0] * COUNT,
        "ages": [1.0] * COUNT,
    }
    assert read(reader, json.dumps(message).encode())
    assert not read(reader, json.dumps(message | {name: [1.0] * count}).encode())


def test_numbers_are_read_to_the_last_bit(reader):
    awkward = [
        5e-324,
        1.7976931348623157e308,
        0.1,
        -0.0,
        2.2250738585072011e-308,
        9007199254740993.0,
    ]
    message = {
        "ppy": 2,
        "type": "accepted",
        "session": "s",
        "mode": "lockstep",
        "limits": {},
        "period": 0.1,
    }
    for number in awkward:
        message |= {
            "clock": number,
            "watchdog": number,
            "values": [number] * COUNT,
            "ages": [None] * COUNT,
        }
        found = read(reader, json.dumps(message).encode())
        assert repr(found["clock"]) == repr(number)
        assert repr(found["values"]) == repr([number] * COUNT)
