"""Claims: objects arrive as they were sent, and whatever else is in the stream is no message."""

from __future__ import annotations

import io

import pytest

from orchestration.fmu.isolation.messages import receive, send


class Dripping(io.BytesIO):
    """A stream that gives few bytes at a time, as one without a buffer may."""

    def read(self, size=-1):
        return super().read(min(size, 3))


MESSAGES = [("result", 1.5), None, "interrupt", {"a": list(range(1000))}, b"\0" * 10_000]


@pytest.mark.parametrize("stream", [io.BytesIO, Dripping])
def test_messages_arrive_in_their_order(stream):
    sent = io.BytesIO()
    for message in MESSAGES:
        send(sent, message)
    received = stream(sent.getvalue())
    assert [receive(received) for _ in MESSAGES] == MESSAGES
    assert receive(received) is None, "the stream is at its end"


def test_what_an_fmu_prints_is_no_message():
    sent = io.BytesIO()
    send(sent, "result")
    assert receive(io.BytesIO(b"I am an FMU\n" + sent.getvalue())) is None


@pytest.mark.parametrize("length", range(0, 30, 3))
def test_what_is_cut_off_is_no_message(length):
    sent = io.BytesIO()
    send(sent, "a text of some length")
    assert receive(io.BytesIO(sent.getvalue()[:length])) is None


def test_a_closed_stream_holds_no_message():
    stream = io.BytesIO()
    stream.close()
    assert receive(stream) is None
