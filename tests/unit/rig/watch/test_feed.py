"""Feed of the live page: items are in order, bounded, finite and legible, whatever a server sends;
and the listener that feeds it.
"""

from __future__ import annotations

import json
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.rig_proxy import protocol
from orchestration.rig import read_endpoint
from orchestration.rig.watch import feed as module
from orchestration.rig.watch.feed import Feed, Listener
from tests.support.rig.small_rig import SmallRig

CONDITION = {
    "state": "idle",
    "reason": "",
    "latch": "",
    "reached": None,
    "alarm": "",
    "clock": 10.0,
    "client": "",
}
STATUS = {
    **CONDITION,
    "mode": "real-time",
    "period": 0.02,
    "watchdog": 0.2,
    "limits": {"current": {"min": -1.3, "max": 1.3, "rate": None}},
    "inputs": {"current": "A"},
    "outputs": {"voltage": "V"},
    "counts": {},
}
TELEMETRY = {
    **CONDITION,
    "inputs": {"current": 0.5},
    "read_back": {"current": 0.49},
    "outputs": {"voltage": None},
    "ages": {"voltage": None},
    "command_age": None,
    "refused": [],
}


def of_kind(items, kind):
    return [item for item in items if item["kind"] == kind]


def everything(feed):
    """Return the items that a page gets that was just opened."""
    update = feed.since(-1)
    assert update.first
    return update.items


def test_a_page_that_is_opened_late_gets_what_is_needed_and_then_what_is_new():
    feed = Feed()
    feed.take_status(STATUS)
    feed.take_telemetry(TELEMETRY)
    serial, first, items = feed.since(-1)
    assert first
    (rig,), (sample,) = of_kind(items, "rig"), of_kind(items, "sample")
    assert (rig["inputs"], rig["limits"]["current"]["max"]) == ({"current": "A"}, 1.3)
    assert (sample["inputs"], sample["outputs"]) == ({"current": 0.5}, {"voltage": None})
    assert sample["read_back"] == {"current": 0.49}
    assert of_kind(items, "contact") == [{"kind": "contact", "server": True, "samples": True}]
    assert feed.since(serial) == (serial, False, [])
    feed.take_telemetry({**TELEMETRY, "inputs": {"current": None}})
    newest, first, new = feed.since(serial)
    assert (newest, first) == (serial + 1, False)
    assert [item["inputs"] for item in new] == [{"current": None}]


def test_a_page_that_missed_too_much_gets_everything_anew(monkeypatch):
    monkeypatch.setattr(module, "_ITEMS", 50)
    feed = Feed()
    feed.take_status(STATUS)
    serial = feed.since(-1).serial
    for k in range(49):
        feed.event("stop", f"{k}")
    assert len(feed.since(serial).items) == 49
    feed.event("stop", "49")
    feed.event("stop", "50")
    assert feed.since(serial).first
    assert feed.since(10**6).first  # the number is of another program


def test_condition_and_alarm_are_told_with_what_they_say():
    feed = Feed()
    assert feed.condition() == (0, {})
    alarm = "not safe within 0.23 s"
    for changes in (
        {"state": "stopping", "reason": "stopped: by hand", "latch": "a1"},
        {"state": "not reached", "reason": "stopped: by hand", "latch": "a1", "alarm": alarm},
        {
            "state": "safe",
            "reason": "stopped: by hand",
            "latch": "a1",
            "reached": 0.8,
            "alarm": alarm,
        },
    ):
        feed.take_telemetry({**TELEMETRY, **changes})
        assert changes.items() <= feed.condition()[1].items()
    told = [(event["what"], event["text"]) for event in of_kind(everything(feed), "event")]
    assert told == [
        ("stopping", "stopping · stopped: by hand"),
        ("contact", "contact with the rig's server"),
        ("alarm", f"ALARM: {alarm}"),
        ("not reached", "not reached · stopped: by hand"),
        ("safe", "safe (reached after 800 ms) · stopped: by hand"),
    ]


def test_an_overtaken_message_does_not_turn_the_state_back():
    feed = Feed()
    feed.take_status({**STATUS, "state": "safe", "reason": "stop", "clock": 10.5})
    feed.take_telemetry({**TELEMETRY, "clock": 10.49})  # published before, arrived after
    assert of_kind(everything(feed), "state")[-1]["state"] == "safe"
    feed.take_telemetry({**TELEMETRY, "clock": 0.1})  # of a server that was started again
    assert of_kind(everything(feed), "state")[-1]["state"] == "idle"


def test_a_change_is_told_once():
    feed = Feed()
    for k in range(50):
        feed.take_telemetry(
            {**TELEMETRY, "clock": 10.0 + k, "refused": ["current 2 A is above 1.3 A"]}
        )
    events = [event["text"] for event in of_kind(everything(feed), "event")]
    assert sorted(events) == sorted(
        ["idle", "refused: current 2 A is above 1.3 A", "contact with the rig's server"]
    )


def test_a_refusal_is_shown_again_every_few_seconds(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    feed = Feed()
    shown = []
    for moment in (100.0, 101.0, 106.0, 106.1, 106.2, 112.0):
        now[0] = moment
        feed.take_telemetry({**TELEMETRY, "clock": moment, "refused": ["too much", f"at {moment}"]})
        texts = [event["text"] for event in of_kind(everything(feed), "event")]
        shown.append(texts.count("refused: too much"))
    assert shown == [1, 1, 2, 2, 2, 3]


def test_silence_is_lost_contact(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    feed = Feed()
    feed.take_status(STATUS)
    feed.take_telemetry(TELEMETRY)
    told = []
    for tenth in range(1, 21):
        now[0] = 100.01 + 0.1 * tenth
        feed.check_contact()
        told.append(of_kind(everything(feed), "contact")[0]["server"])
    assert told == [True] * 6 + [False] * 14  # until 0.7 s, so that a page says so within one
    feed.take_telemetry(TELEMETRY)
    assert of_kind(everything(feed), "contact")[0] == {
        "kind": "contact",
        "server": True,
        "samples": True,
    }


@pytest.mark.parametrize(("period", "lost"), [(0.02, True), (1.0, False)])
def test_a_rig_that_samples_slowly_is_waited_for(monkeypatch, period, lost):
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    feed = Feed()
    feed.take_status({**STATUS, "period": period})
    feed.take_telemetry(TELEMETRY)
    now[0] += 2.0
    feed.take_status({**STATUS, "period": period})
    assert of_kind(everything(feed), "contact")[0] == {
        "kind": "contact",
        "server": True,
        "samples": not lost,
    }


@pytest.mark.slow
def test_memory_is_bounded():
    feed = Feed()
    for k in range(5000):
        feed.take_telemetry(
            {
                **TELEMETRY,
                "clock": float(k),
                "reason": f"{k}" * 1000,
                "refused": [f"{k} {j}" for j in range(100)],
            }
        )
    items = everything(feed)
    assert len(items) < 3000
    assert max(len(json.dumps(item)) for item in items) < 2000
    assert len(feed._refused) <= 100
    assert len(feed.since(feed.since(-1).serial - 3999).items) == 3999


texts = st.text(max_size=20)
anything = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-(10**400), 10**400) | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
)
signals = st.dictionaries(texts, anything, max_size=5)


@pytest.mark.slow
@given(signals, signals, st.lists(texts, max_size=5), st.none() | st.floats(-1e308, 1e308))
def test_whatever_is_well_formed_becomes_json_that_a_browser_reads(inputs, outputs, refused, age):
    values = {
        "inputs": inputs,
        "read_back": inputs,
        "outputs": outputs,
        "ages": outputs,
        "refused": refused,
        "command_age": age,
    }
    frame = json.dumps(
        {"ppy": protocol.VERSION, "type": "telemetry", **TELEMETRY, **values}
    ).encode()
    feed = Feed()
    feed.take_telemetry(protocol.decode(frame, protocol.REPLIES))
    text = json.dumps(everything(feed), allow_nan=False)
    (sample,) = of_kind(json.loads(text), "sample")
    assert all(value is None or abs(value) < 1e300 for value in sample["inputs"].values())


@pytest.mark.parametrize("number", ["1" + "0" * 400, "-1" + "0" * 400, "1e999", "NaN"])
def test_a_number_that_is_none_is_malformed(number):
    frame = json.dumps({"ppy": protocol.VERSION, "type": "telemetry", **TELEMETRY}).replace(
        '"clock": 10.0', f'"clock": {number}'
    )
    assert number in frame
    with pytest.raises(protocol.ProtocolError, match="clock"):
        protocol.decode(frame.encode(), protocol.REPLIES)


# --- what is seen
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("bench PC, 20 °C, µ", "bench PC, 20 °C, µ"),
        ("gnp.\u202eexe", r"gnp.\u202eexe"),
        ("\u2066a\u2069 \u200b \ufeff", r"\u2066a\u2069 \u200b \ufeff"),
        ("two\nlines\x1b[2J", r"two\nlines\x1b[2J"),
        ("\ud800 \U000e0041", r"\ud800 \U000e0041"),
    ],
)
def test_what_cannot_be_seen_is_written_out(said, shown):
    feed = Feed()
    rig = {"inputs": {said: said}, "outputs": {said: said}, "limits": {said: {}}, "mode": said}
    condition = dict.fromkeys(("state", "reason", "latch", "alarm", "client"), said)
    values = {"inputs": {said: 1.0}, "outputs": {said: 1.0}, "ages": {said: 1.0}}
    feed.take_status({**STATUS, **rig, **condition})
    feed.take_telemetry(
        {**TELEMETRY, **condition, **values, "read_back": {said: 1.0}, "refused": [said]}
    )
    feed.event("stop", said)
    text = json.dumps(everything(feed), ensure_ascii=False)
    assert json.dumps(shown, ensure_ascii=False)[1:-1] in text
    assert said == shown or not any(c in text for c in said if not c.isprintable())
    (told,) = (e["text"] for e in of_kind(everything(feed), "event") if e["what"] == "stop")
    assert told == shown


# --- how long a sample was under way
# --------------------------------------------------------------------------------------------------


def test_a_sample_says_how_long_it_was_under_way_at_most(monkeypatch):
    """The rig's clock is 500 s ahead; the requests take 10 ms and the answer 30 ms."""
    now = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: now[0])
    feed = Feed()
    feed.take_telemetry({**TELEMETRY, "clock": 599.0})
    now[0] = 100.04
    feed.take_status({**STATUS, "clock": 600.01}, sent=100.0)
    now[0] = 101.07
    feed.take_telemetry({**TELEMETRY, "clock": 601.0})  # sent at 101
    before, after = of_kind(everything(feed), "sample")
    assert before["transit"] is None  # nobody knows
    assert 0.07 <= after["transit"] <= 0.07 + 0.01 + 0.002
    assert after["at"] == 101.07


def test_in_lockstep_the_time_of_the_rig_stands_still_under_way():
    feed = Feed()
    feed.take_status({**STATUS, "mode": "lockstep"}, sent=time.monotonic())
    feed.take_telemetry({**TELEMETRY, "clock": 1e6})
    assert of_kind(everything(feed), "sample")[0]["transit"] == 0.0


# --- the listener
# --------------------------------------------------------------------------------------------------


def until(condition, within=10.0):
    began = time.monotonic()
    while not condition():
        assert time.monotonic() - began < within
        time.sleep(0.01)


def test_the_listener_asks_at_the_port_of_operators_and_one_thing_at_a_time():
    """A server that does not answer for a while, and then late, gets no second request meanwhile,
    and its late answer is of another connection.
    """
    feed = Feed()
    with SmallRig() as rig, Listener(read_endpoint(rig.endpoint), feed):
        until(lambda: feed.condition()[1].get("state") == "idle")
        until(lambda: of_kind(everything(feed), "sample")[-1]["transit"] is not None)
        transit = of_kind(everything(feed), "sample")[-1]["transit"]
        assert 0.0 <= transit < 1.0  # the clocks are the same, and the machine may be busy
        rig.answers = False
        time.sleep(0.5)
        asked = len(rig.of_type("status"))
        time.sleep(1.0)
        assert len(rig.of_type("status")) <= asked + 1
        rig.answers = True
        answered = len(rig.of_type("status"))
        until(lambda: len(rig.of_type("status")) > answered + 3)
