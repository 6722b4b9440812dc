"""Request handler: it serves one client, takes each message once, and keeps a safe state latched.

The rig is one of the test's own, whose clock the test sets: watchdog and device are tried with real
processes in `tests/end_to_end/test_rig_faults.py`.
"""

from __future__ import annotations

import json
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmus.rig_proxy.protocol import REPLIES, REQUESTS, ProtocolError, decode, encode
from orchestration.rig.access import EVERYBODY, Admission, Peer
from orchestration.rig.backends.backend import Limit
from orchestration.rig.keys import KeyHolder
from orchestration.rig.server import request_handler as module
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.latch_file import LatchKeeper
from orchestration.rig.server.request_handler import RequestHandler
from orchestration.rig.server.rig import Notice, RigState

pytestmark = pytest.mark.real_time

SIGNALS = BackendSignals(
    {"current": "A", "force": "N"},
    {"voltage": "V", "displacement": "m"},
    {"current": Limit(-1.3, 1.3)},
    attributes={"voltage": {"standard_uncertainty": 0.002, "calibration_date": "2026-05-01"}},
)


class SetRig:
    """A rig whose time the test sets."""

    mode, watchdog, bound, signals = "real-time", 0.2, 0.3, SIGNALS

    def __init__(self) -> None:
        self.now = 100.0
        self.commands, self.resting, self.found, self.waiting = [], 0, [], ""
        self.safe, self.alarming = 100.0, []

    def clock(self):
        return self.now

    def beat(self):
        pass

    def safe_since(self):
        return self.safe

    def apply(self, values, now):
        self.commands.append(tuple(values))
        self.safe = None

    def advance(self, step):
        pass

    def go_safe(self):
        self.resting += 1
        self.safe = self.now if self.safe is None else self.safe

    def release(self):
        pass

    def opening(self):
        return self.waiting

    def troubles(self):
        found, self.found = self.found, []
        return found

    def state(self):
        return RigState(1, (0.0, 0.0), (None, 0.1), (0.5, None), (self.now - 0.01, 0.0), 0)

    def alarms(self):
        alarming, self.alarming = self.alarming, []
        return alarming

    def close(self):
        return ""


class Told:
    """A log that keeps its lines."""

    def __init__(self):
        self.lines = []

    def tell(self, text, kind=""):
        self.lines.append(text)


class Trial:
    """A request handler, and messages to it as they come out of a socket."""

    def __init__(self):
        self.rig, self.log = SetRig(), Told()
        self.admission = Admission({"lab's": KeyHolder("lab", "acknowledge")})
        self.handler = RequestHandler(
            self.rig, 1 / 30, self.log, LatchKeeper(), admission=self.admission
        )
        self.session, self.key = "", "lab's"

    def ask(self, kind, peer=b"a", **fields):
        message = decode(encode(kind, **fields), REQUESTS)
        self.handler.check(message)
        reply = self.handler.answer(Peer(peer, KeyHolder("", ""), "10.0.0.1", self.key), message)
        return None if reply is None else decode(reply, REPLIES)

    def connect(self, peer=b"a", client="a", inputs=None, outputs=None, instance="one"):
        answer = self.ask(
            "connect",
            peer,
            client=client,
            instance=instance,
            time=0.0,
            inputs=inputs or SIGNALS.inputs,
            outputs=SIGNALS.outputs if outputs is None else outputs,
        )
        self.session = answer.get("session", self.session)
        return answer

    def take_over(self, **fields):
        """Connect as another client does that would go on from the present one."""
        signals = {"inputs": SIGNALS.inputs, "outputs": SIGNALS.outputs}
        return self.ask("connect", b"b", client="b", instance="two", time=0.0, **signals, **fields)

    def exchange(self, sequence, values=(0.5, 1.0), seen=None, session=None, sent=0.0, peer=b"a"):
        return self.ask(
            "exchange",
            peer,
            session=session or self.session,
            sequence=sequence,
            sent=sent,
            seen=self.rig.now if seen is None else seen,
            time=0.0,
            step=0.02,
            values=list(values),
        )


@pytest.fixture
def trial():
    return Trial()


def test_values_are_in_the_order_of_the_client_and_the_rig_has_them_in_its_own(trial):
    answer = trial.connect(
        inputs={"force": "N", "current": "A"}, outputs={"displacement": "m", "voltage": "V"}
    )
    assert answer["values"] == [None, 0.5]
    assert answer["ages"] == [None, pytest.approx(0.01)]
    assert answer["limits"] == {"current": {"min": -1.3, "max": 1.3, "rate": None}}
    assert trial.exchange(1, [2.0, 0.25])["refused"] == []
    assert trial.rig.commands == [(0.25, 2.0)]


@given(
    st.lists(
        st.tuples(
            st.integers(0, 6),
            st.sampled_from(["mine", "other"]),
            st.floats(-2.0, 2.0),
            st.floats(-0.1, 0.5),
            st.floats(0.0, 0.1),
        ),
        max_size=25,
    )
)
def test_a_command_is_carried_out_if_and_only_if_it_is_new_ours_fresh_and_within_limits(messages):
    trial = Trial()
    trial.connect()
    newest, wanted = 0, []
    for sequence, whose, current, age, wait in messages:
        trial.rig.now += wait
        seen = trial.rig.now - age
        answer = trial.exchange(
            sequence, [current, 1.0], seen, None if whose == "mine" else "another"
        )
        if whose != "mine":
            assert answer["type"] == "refused"
        elif sequence <= newest:
            assert answer is None
        else:
            longest = 0.2 if newest else 10.0  # s, for the first
            newest = sequence
            good = 0.0 <= trial.rig.now - seen <= longest and -1.3 <= current <= 1.3
            wanted += [(current, 1.0)] if good else []
            assert bool(answer["refused"]) != good
            assert (answer["sequence"], answer["state"]) == (sequence, "running")
        assert trial.rig.commands == wanted


@pytest.mark.parametrize(
    ("values", "part"), [((0.5,), "1 values; it takes 2"), ((0.5, 1.0, 1.0), "3 values")]
)
def test_an_exchange_of_the_session_with_another_number_of_values_is_malformed(trial, values, part):
    trial.connect()
    with pytest.raises(ProtocolError, match=part):
        trial.exchange(1, values)


def test_of_two_that_wait_only_the_newer_is_of_use(trial):
    trial.connect()
    first, second = ({"session": trial.session, "sequence": k} for k in (1, 2))
    assert trial.handler.drop_earlier(second, first)
    assert trial.handler.counts["late"] == 1
    assert not trial.handler.drop_earlier(second, {"session": "another", "sequence": 1})


def test_one_client_at_a_time(trial):
    first = trial.connect(b"a", "a", instance="one")["session"]
    assert "serves a; one client at a time" in trial.connect(b"b", "b", instance="two")["reason"]
    trial.exchange(1)
    assert trial.connect(b"a", "a", instance="one")["session"] != first, "its own connection may"
    assert trial.exchange(1, session=first)["type"] == "refused"
    trial.exchange(1)
    again = trial.connect(b"b", "a", instance="one")
    assert "one client at a time" in again["reason"], "it commands: no answer was lost"
    assert trial.ask("disconnect", session=trial.session)["type"] == "disconnected"
    assert trial.connect(b"b", "b", instance="two")["type"] == "accepted"


@pytest.mark.parametrize("exchanges", [0, 1], ids=["before", "after"])
def test_another_of_the_same_name_is_refused_and_the_first_goes_on(trial, exchanges):
    session = trial.connect(b"a", "rig_proxy", instance="one")["session"]
    for number in range(exchanges):
        trial.exchange(number + 1)
    refused = trial.connect(b"b", "rig_proxy", instance="two")
    assert refused["type"] == "refused"
    assert "the rig serves another rig_proxy; one client at a time" in refused["reason"]
    assert trial.exchange(exchanges + 1, session=session)["refused"] == []
    assert any("rig_proxy" in line and "refused" in line for line in trial.log.lines)


def test_a_client_that_missed_the_answer_may_connect_again(trial):
    first = trial.connect(b"a", "a")["session"]
    assert trial.connect(b"a", "a")["session"] == first, "a doubled message is the same session"
    assert trial.connect(b"b", "a")["session"] != first, "a new connection is a new one"


def test_the_first_command_may_come_ten_seconds_after_the_answer_and_a_later_one_may_not(trial):
    trial.connect()
    accepted = trial.rig.now
    trial.rig.now += 9.9
    assert trial.exchange(1, seen=accepted)["refused"] == []
    assert trial.rig.commands == [(0.5, 1.0)]
    trial.rig.now += 0.3  # the watchdog time is 0.2 s
    assert "under way" in trial.exchange(2, seen=trial.rig.now - 0.3)["refused"][0]


def test_a_first_command_that_answers_nothing_that_was_said_is_refused(trial):
    trial.connect()
    seen = trial.rig.now
    trial.rig.now += 10.1
    assert trial.exchange(1, seen=seen)["refused"] != []
    assert trial.exchange(2, seen=trial.rig.now + 1.0)["refused"] != []
    assert trial.rig.commands == []


def test_disconnecting_a_session_that_is_over_ends_no_other(trial):
    trial.connect()
    trial.ask("disconnect", session="another")
    assert trial.exchange(1)["type"] == "sample"


def test_a_client_that_never_commands_loses_its_session(trial, monkeypatch):
    now = 50.0
    monkeypatch.setattr("orchestration.rig.server.request_handler.monotonic", lambda: now)
    trial.connect()
    now += 9.9
    trial.handler.supervise()
    assert trial.ask("status")["state"] == "running"
    now += 0.2
    trial.handler.supervise()
    assert trial.ask("status")["state"] == "idle"


def test_a_safe_state_is_kept_until_it_is_acknowledged(trial):
    trial.connect()
    trial.exchange(1)
    rests = trial.rig.resting
    trial.rig.found = ["no fresh command for 0.2 s"]
    trial.handler.supervise()
    assert trial.rig.resting > rests
    answer = trial.exchange(2)
    assert (answer["state"], answer["reason"]) == ("safe", "no fresh command for 0.2 s")
    assert "the rig is in its safe state since " in answer["refused"][0]
    assert "in its safe state since" in trial.connect(b"b", "b")["reason"]
    assert trial.ask("disconnect", session=trial.session)["type"] == "disconnected"
    told = trial.ask("status")
    assert told["state"] == "safe", "the orderly end of a client opens no latch"
    assert trial.ask("acknowledge", latch=told["latch"])["state"] == "idle"
    assert trial.exchange(3)["type"] == "refused"
    assert trial.connect()["type"] == "accepted"
    assert trial.rig.commands == [(0.5, 1.0)]


def test_a_late_acknowledgement_does_not_release_a_later_stop(trial):
    first = trial.ask("stop", reason="smoke")["latch"]
    second = trial.ask("stop", reason="smoke")["latch"]  # by another one, who sees more of it
    assert first != second
    answer = trial.ask("acknowledge", latch=first)
    assert answer["type"] == "refused"
    assert second in answer["reason"]
    assert "stopped: smoke" in answer["reason"]
    assert trial.ask("acknowledge", latch="")["type"] == "refused"
    assert trial.ask("status")["latch"] == second
    assert trial.ask("acknowledge", latch=second)["state"] == "idle"
    assert trial.ask("acknowledge", latch=second)["state"] == "idle", "nothing is closed any more"


def test_an_acknowledgement_of_nothing_ends_no_session(trial):
    trial.connect()
    trial.exchange(1)
    assert trial.ask("acknowledge", latch="")["state"] == "running"
    assert trial.exchange(2)["refused"] == []


def test_an_acknowledgement_waits_for_the_device_and_is_void_when_that_fails(trial):
    trial.handler.stop("smoke")
    trial.rig.waiting = "the device is being opened"
    first = trial.ask("status")["latch"]
    assert trial.ask("acknowledge", latch=first)["reason"] == "the device is being opened"
    assert trial.connect()["type"] == "refused"
    trial.rig.found = ["opening raised OSError"]
    trial.handler.supervise()
    trial.rig.waiting = ""
    trial.handler.supervise()
    told = trial.ask("status")
    assert told["reason"] == "opening raised OSError"
    assert trial.ask("acknowledge", latch=told["latch"])["state"] == "idle"


def test_a_rig_that_nobody_commands_and_that_is_not_at_rest_is_latched(trial, monkeypatch):
    now = 50.0
    monkeypatch.setattr("orchestration.rig.server.request_handler.monotonic", lambda: now)
    trial.handler.supervise()
    trial.rig.safe = None
    now += 0.29
    trial.handler.supervise()
    assert trial.ask("status")["state"] == "idle"
    now += 0.02  # the bound is 0.3 s
    trial.handler.supervise()
    told = trial.ask("status")
    assert "not in its safe state, though nobody commands it" in told["reason"]
    assert told["latch"]


def test_an_alarm_holds_until_it_is_acknowledged_while_the_rig_goes_on(trial):
    trial.connect()
    trial.exchange(1)
    trial.rig.alarming = [Notice("voltage", "voltage has not changed for 100 samples")]
    trial.handler.supervise()
    trial.rig.alarming = [Notice("current", "current is ignored")]
    trial.handler.supervise()
    told = trial.ask("status")
    assert told["state"] == "running"
    assert told["alarm"] == "voltage has not changed for 100 samples; current is ignored"
    first, second = [one["name"] for one in told["alarms"]]
    for _ in range(2):  # one that is said again clears no other
        assert trial.ask("acknowledge", latch="")["alarm"] == told["alarm"]
    for _ in range(2):
        assert trial.ask("acknowledge", latch=first)["alarm"] == "current is ignored"
    assert trial.ask("shelve", alarm=second, time=1e6)["type"] == "refused"
    assert trial.ask("shelve", alarm=second, time=60.0)["alarm"] == ""
    assert trial.exchange(2)["refused"] == []


@pytest.mark.parametrize(
    ("role", "allowed"),
    [
        ("watch", {"status", "stop", "exchange", "disconnect"}),  # whoever can name the session
        ("command", {"status", "stop", "connect", "exchange", "disconnect"}),
        ("acknowledge", {*REQUESTS}),
        ("", {"stop"}),
    ],
)
def test_a_key_is_for_what_its_role_says(trial, role, allowed):
    trial.connect(b"z", "z", instance="present")  # so that its session can be named
    trial.key = "page's"
    trial.admission.holders = {**trial.admission.holders, "page's": KeyHolder("page", role)}
    messages = {
        "connect": {"client": "p", "instance": "i", "inputs": {}, "outputs": {}, "time": 0.0},
        "exchange": {"session": trial.session, "sequence": 1, "sent": 0.0, "seen": 100.0}
        | {"time": 0.0, "step": 0.02, "values": [0.5, 1.0]},
        "disconnect": {"session": trial.session},
        "status": {},
        "stop": {"reason": "smoke"},
        "acknowledge": {"latch": ""},
    }
    for kind, fields in messages.items():
        answer = trial.ask(kind, b"p", **fields)
        refusals = (f"the key of page is for {role}, not for {kind}", "its key is none of")
        assert (not answer.get("reason", "").startswith(refusals)) == (kind in allowed), kind
    assert bool(trial.rig.commands) == ("exchange" in allowed)


def test_after_a_rest_a_rate_counts_from_zero_and_no_pause_makes_it_slower(trial):
    trial.rig.signals = BackendSignals(
        SIGNALS.inputs, SIGNALS.outputs, {"current": Limit(rate=1.0)}
    )
    trial.handler = RequestHandler(
        trial.rig, 1 / 30, trial.log, LatchKeeper(), admission=trial.admission
    )
    trial.connect()
    trial.rig.now += 100.0
    assert "faster than 1 A/s" in trial.exchange(1, [0.3, 0.0])["refused"][0]
    assert trial.exchange(2, [0.19, 0.0])["refused"] == [], (
        "0.2 s, the watchdog time, is the longest that counts"
    )
    trial.rig.now += 0.05
    assert trial.exchange(3, [0.27, 0.0])["refused"] != []
    assert trial.exchange(4, [0.23, 0.0])["refused"] == []


def test_the_status_says_what_the_backend_states_of_its_signals(trial):
    assert trial.ask("status")["attributes"] == {
        "voltage": {"standard_uncertainty": 0.002, "calibration_date": "2026-05-01"}
    }


def test_telemetry_and_status_are_of_the_protocol(trial):
    trial.connect()
    trial.exchange(1, [9.0, 1.0])
    trial.exchange(2, [1.0, 1.0])
    trial.exchange(3, [9.0, 1.0])
    trial.rig.now += 0.05
    told = decode(trial.handler.telemetry(), REPLIES)
    assert told["inputs"] == {"current": 0.0, "force": 0.0}
    assert told["read_back"] == {"force": 0.1}, "of what the device can tell"
    assert told["outputs"] == {"voltage": 0.5, "displacement": None}
    assert told["command_age"] == pytest.approx(0.05)
    assert "current 9 A is above 1.3 A; 1 A goes on" in told["refused"]
    assert json.loads(trial.handler.telemetry())["refused"] == [], "told once"
    assert trial.ask("status")["counts"]["refused"] == 2


@pytest.mark.parametrize("letter", ["x", "\U0001f4a3"])
def test_a_long_name_of_a_client_leaves_room_for_the_answers(trial, letter):
    trial.connect(client=letter * 5000)
    status = trial.ask("status")  # decoding refuses a long frame
    assert status["client"] == letter * 200
    assert decode(trial.handler.telemetry(), REPLIES)["client"] == letter * 200


def test_without_curve_the_key_is_in_the_message_and_everybody_may_stop(trial):
    trial.key = ""  # of the connection
    owner = KeyHolder("owner", "acknowledge")
    trial.admission.holders = {"": KeyHolder("", "watch"), "secret": owner}
    assert "connect needs the key" in trial.take_over()["reason"]
    assert "connect needs the key" in trial.take_over(key="guess")["reason"]
    assert "connect needs the key" in trial.take_over(key=["secret"])["reason"]
    trial.session = trial.take_over(key="secret")["session"]
    assert trial.exchange(1)["refused"] == []
    assert trial.ask("status")["operator"] == "owner"
    latch = trial.ask("stop", reason="smoke")["latch"]
    assert "acknowledge needs the key" in trial.ask("acknowledge", latch=latch)["reason"]
    assert trial.ask("acknowledge", latch=latch, key="secret")["acknowledged"].startswith("owner (")


def test_where_no_keys_are_asked_for_one_of_a_server_before_does_no_harm(trial):
    trial.key = ""
    trial.admission.holders = EVERYBODY.holders
    assert trial.take_over(key="of the server before")["type"] == "accepted"


def test_with_curve_a_key_in_a_message_is_nothing(trial):
    trial.admission.holders = {**trial.admission.holders, "page's": KeyHolder("page", "watch")}
    trial.key = "page's"
    answer = trial.ask("acknowledge", latch="", key="lab's")
    assert answer["reason"] == "the key of page is for watch, not for acknowledge"


@pytest.mark.parametrize("left", [{}, {"lab's": KeyHolder("lab", "watch")}], ids=["gone", "watch"])
def test_a_key_that_is_struck_out_drives_no_more(trial, left):
    trial.connect()
    trial.exchange(1)
    trial.admission.holders = left
    trial.handler.supervise()
    assert trial.rig.resting == 2  # at the connection and now
    assert "client a is shut out: the key of lab may not drive" in trial.log.lines
    assert trial.exchange(2)["type"] == "refused"
    assert trial.connect()["type"] == "refused"
    assert trial.ask("stop", reason="smoke")["latch"]


def test_a_rig_is_handed_over_only_by_whom_it_serves(trial):
    trial.connect(b"a", "a", instance="one")
    trial.exchange(1)
    mine = trial.session
    assert "serves a" in trial.take_over(take_over=True)["reason"]
    assert trial.ask("hand_over", b"b", session="other")["type"] == "refused"
    assert trial.ask("hand_over", session=mine)["type"] == "offered"
    assert "serves a" in trial.take_over()["reason"]
    accepted = trial.take_over(take_over=True)
    assert accepted["applied"] == {"current": 0.5, "force": 1.0}
    assert "serves b" in trial.connect(b"c", "c", instance="three")["reason"]
    assert trial.exchange(2, session=mine)["type"] == "refused"


def test_at_a_change_of_client_commands_go_from_the_applied_values_within_a_second(trial):
    """The oracle is the straight line between both clients' values; the rig never rests."""
    trial.connect(b"a", "a", instance="one")
    trial.exchange(1, [0.5, 1.0])
    trial.ask("hand_over", session=trial.session)
    rests = trial.rig.resting
    session = trial.take_over(take_over=True)["session"]
    trial.handler.supervise()
    begun, applied = trial.rig.now, []
    for k in range(7):
        trial.rig.now = begun + 0.2 * k
        assert trial.exchange(k + 1, [-0.5, 0.0], session=session)["refused"] == []
        applied.append(trial.rig.commands[-1])
    shares = [min(1.0, 0.2 * k) for k in range(7)]
    line = [(0.5 - share, 1.0 - share) for share in shares]
    assert [list(values) for values in applied] == [pytest.approx(values) for values in line]
    assert trial.rig.resting == rests


def test_an_offer_holds_for_ten_seconds(trial, monkeypatch):
    trial.connect()
    trial.exchange(1)
    trial.ask("hand_over", session=trial.session)
    later = time.monotonic() + 10.5
    monkeypatch.setattr(module, "monotonic", lambda: later)
    assert "serves a" in trial.take_over(take_over=True)["reason"]
