"""Messages of the rig protocol, and every block of JSON in its description."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.rig_proxy import protocol

PAGE = (Path(__file__).parents[3] / "docs/reference/protocol.md").read_text(encoding="utf-8")
SAMPLE = {
    "session": "s",
    "sequence": 3,
    "sent": 1.5,
    "clock": 2.5,
    "values": [1.0, None],
    "ages": [0.1, None],
    "state": "running",
    "reason": "",
    "refused": [],
}
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=8,
)


def test_every_message_of_the_page_is_one():
    """The page is the contract for programs of others: its examples have to be messages of ours."""
    shown = [
        line for block in re.findall(r"```json\n(.*?)```", PAGE, re.S) for line in messages(block)
    ]
    assert len(shown) >= 9
    kinds = set()
    for text in shown:
        message = json.loads(text)
        kinds.add(message["type"])
        known = (
            protocol.REQUESTS
            if message["type"] in protocol.REQUESTS and "state" not in message
            else protocol.REPLIES
        )
        assert protocol.decode(text.encode(), known) == message
    assert kinds == {
        "connect",
        "accepted",
        "refused",
        "exchange",
        "sample",
        "disconnect",
        "disconnected",
        "hand_over",
        "offered",
        "status",
        "telemetry",
    }


def messages(block: str) -> list[str]:
    decoder, found, at = json.JSONDecoder(), [], 0
    while at < len(block.rstrip()):
        _, end = decoder.raw_decode(block, at)
        found.append(block[at:end])
        at = end + len(block[end:]) - len(block[end:].lstrip())
    return found


def test_what_is_encoded_is_decoded():
    frame = protocol.encode("sample", **SAMPLE)
    assert protocol.decode(frame, protocol.REPLIES) == {"ppy": 2, "type": "sample", **SAMPLE}
    assert b"\n" not in frame


def test_a_name_is_that_of_no_other_connection():
    names = {protocol.new_name() for _ in range(1000)}
    assert len(names) == 1000
    assert all(re.fullmatch(rb"ppy-[0-9a-f]{16}", name) for name in names)


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_numbers_that_are_none_are_never_sent(number):
    with pytest.raises(ValueError):
        protocol.encode("exchange", values=[number])


@given(st.binary(max_size=200))
def test_bytes_are_a_message_or_a_protocol_error(frame):
    refused(frame)


@pytest.mark.slow
@given(st.dictionaries(st.sampled_from(["ppy", "type", *SAMPLE]), anything))
def test_objects_are_a_message_or_a_protocol_error(fields):
    refused(json.dumps(fields).encode())
    refused(json.dumps({"ppy": 2, "type": "sample"} | fields).encode())


def refused(frame: bytes) -> None:
    for known in (protocol.REQUESTS, protocol.REPLIES):
        try:
            message = protocol.decode(frame, known)
        except protocol.ProtocolError as error:
            said = str(error)
        else:
            said = ""
            assert message["ppy"] == 2
            assert set(known[message["type"]]) <= set(message)
        assert len(said) < 300


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        (b"x" * 70_000, "70000 bytes; 65536 are allowed"),
        (b"[1]", "no JSON object"),
        (b'{"ppy": 3, "type": "stop", "reason": ""}', "version 3; this is version 2"),
        (b'{"ppy": 2, "type": "shutdown"}', "type 'shutdown'; there are connect"),
        (b'{"ppy": 2, "type": "stop"}', "stop whose reason is missing"),
        (b'{"ppy": 2, "type": "stop", "reason": 3}', "stop whose reason is 3"),
        (b"[" * 60_000, "no JSON"),
    ],
)
def test_the_reason_is_told(frame, said):
    with pytest.raises(protocol.ProtocolError, match=re.escape(said)):
        protocol.decode(frame, protocol.REQUESTS)


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("sequence", -1),
        ("sequence", 1.5),
        ("sequence", True),
        ("sent", None),
        ("values", ["1"]),
        ("values", [True]),
        ("ages", {}),
        ("refused", [1]),
        ("session", 5),
        ("sent", 10**400),
    ],
)
def test_a_field_of_another_type_is_none(name, bad):
    with pytest.raises(protocol.ProtocolError, match=f"sample whose {name}"):
        protocol.decode(
            json.dumps({"ppy": 2, "type": "sample"} | SAMPLE | {name: bad}).encode(),
            protocol.REPLIES,
        )
