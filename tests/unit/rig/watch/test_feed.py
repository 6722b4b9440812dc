"""Feed of the live page: items are in order, bounded and finite, whatever a server sends."""

from __future__ import annotations

import json
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.rig_proxy import protocol
from orchestration.rig.watch import feed as module
from orchestration.rig.watch.feed import Feed

STATUS = {
    "state": "idle",
    "reason": "",
    "clock": 10.0,
    "client": "",
    "mode": "real-time",
    "period": 0.02,
    "watchdog": 0.2,
    "limits": {"current": {"min": -1.3, "max": 1.3, "rate": None}},
    "inputs": {"current": "A"},
    "outputs": {"voltage": "V"},
    "counts": {},
}
TELEMETRY = {
    "clock": 10.0,
    "state": "idle",
    "reason": "",
    "client": "",
    "inputs": {"current": 0.5},
    "outputs": {"voltage": None},
    "ages": {"voltage": None},
    "command_age": None,
    "refused": [],
}


def of_kind(items, kind):
    return [item for item in items if item["kind"] == kind]


def test_a_page_that_is_opened_late_gets_what_is_needed_and_then_what_is_new():
    feed = Feed()
    feed.status(STATUS)
    feed.telemetry(TELEMETRY)
    serial, items = feed.everything()
    (rig,), (sample,) = of_kind(items, "rig"), of_kind(items, "sample")
    assert (rig["inputs"], rig["limits"]["current"]["max"]) == ({"current": "A"}, 1.3)
    assert (sample["inputs"], sample["outputs"]) == ({"current": 0.5}, {"voltage": None})
    assert of_kind(items, "contact") == [{"kind": "contact", "server": True, "samples": True}]
    assert feed.since(serial, 0.0) == (serial, [])
    feed.telemetry({**TELEMETRY, "inputs": {"current": 0.7}})
    _, new = feed.since(serial, 0.0)
    assert [item["inputs"] for item in new] == [{"current": 0.7}]


def test_waiting_ends_when_something_happens_and_when_nothing_does():
    feed = Feed()
    serial, _ = feed.everything()
    began = time.monotonic()
    assert feed.since(serial, 0.2)[1] == []
    assert 0.15 < time.monotonic() - began < 5.0
    threading.Timer(0.1, lambda: feed.event("stop", "pressed")).start()
    assert [item["text"] for item in feed.since(serial, 10.0)[1]] == ["pressed"]


def test_an_overtaken_message_does_not_turn_the_state_back():
    feed = Feed()
    feed.status({**STATUS, "state": "safe", "reason": "stop", "clock": 10.5})
    feed.telemetry({**TELEMETRY, "clock": 10.49})  # published before, arrived after
    assert of_kind(feed.everything()[1], "state")[-1]["state"] == "safe"
    feed.telemetry({**TELEMETRY, "clock": 0.1})  # of a server that was started again
    assert of_kind(feed.everything()[1], "state")[-1]["state"] == "idle"


def test_a_change_is_told_once():
    feed = Feed()
    for k in range(50):
        feed.telemetry({**TELEMETRY, "clock": 10.0 + k, "refused": ["current 2 A is above 1.3 A"]})
    events = [event["text"] for event in of_kind(feed.everything()[1], "event")]
    assert sorted(events) == sorted(
        ["idle", "refused: current 2 A is above 1.3 A", "contact with the rig's server"]
    )


def test_silence_is_lost_contact(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    feed = Feed()
    feed.status(STATUS)
    feed.telemetry(TELEMETRY)
    told = []
    for tenth in range(1, 21):
        now[0] = 100.01 + 0.1 * tenth
        feed.look()
        told.append(of_kind(feed.everything()[1], "contact")[0]["server"])
    assert told == [True] * 6 + [False] * 14  # until 0.7 s, so that a page says so within one
    feed.telemetry(TELEMETRY)
    assert of_kind(feed.everything()[1], "contact")[0] == {
        "kind": "contact",
        "server": True,
        "samples": True,
    }


@pytest.mark.parametrize(("period", "lost"), [(0.02, True), (1.0, False)])
def test_a_rig_that_samples_slowly_is_waited_for(monkeypatch, period, lost):
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    feed = Feed()
    feed.status({**STATUS, "period": period})
    feed.telemetry(TELEMETRY)
    now[0] += 2.0
    feed.status({**STATUS, "period": period})
    assert of_kind(feed.everything()[1], "contact")[0] == {
        "kind": "contact",
        "server": True,
        "samples": not lost,
    }


def test_memory_is_bounded():
    feed = Feed()
    for k in range(5000):
        feed.telemetry(
            {
                **TELEMETRY,
                "clock": float(k),
                "reason": f"{k}" * 1000,
                "refused": [f"{k} {j}" for j in range(100)],
            }
        )
    _, items = feed.everything()
    assert len(items) < 3000
    assert max(len(json.dumps(item)) for item in items) < 2000
    assert len(feed._refused) <= 100
    assert len(feed.since(0, 0.0)[1]) <= 4000


texts = st.text(max_size=20)
anything = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-(10**400), 10**400) | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
)
signals = st.dictionaries(texts, anything, max_size=5)


@given(signals, signals, st.lists(texts, max_size=5), anything)
def test_whatever_is_well_formed_becomes_json_that_a_browser_reads(inputs, outputs, refused, age):
    values = {
        "inputs": inputs,
        "outputs": outputs,
        "ages": outputs,
        "refused": refused,
        "command_age": age,
    }
    frame = json.dumps({"ppy": 1, "type": "telemetry", **TELEMETRY, **values}).encode()
    feed = Feed()
    feed.telemetry(protocol.decode(frame, protocol.REPLIES))
    text = json.dumps(feed.everything()[1], allow_nan=False)
    (sample,) = of_kind(json.loads(text), "sample")
    assert all(value is None or abs(value) < 1e300 for value in sample["inputs"].values())


@pytest.mark.parametrize("number", ["1" + "0" * 400, "-1" + "0" * 400, "1e999", "NaN"])
def test_a_number_that_is_none_is_malformed(number):
    frame = json.dumps({"ppy": 1, "type": "telemetry", **TELEMETRY}).replace(
        '"clock": 10.0', f'"clock": {number}'
    )
    assert number in frame
    with pytest.raises(protocol.ProtocolError, match="clock"):
        protocol.decode(frame.encode(), protocol.REPLIES)
