"""Requests of an operator: a status is one line, and a server that is silent is an error."""

from __future__ import annotations

import time
from threading import Timer

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import acknowledge, ask, stop, summarise_status
from tests.support.rig.small_rig import SmallRig, free_port

STATUS = {
    "state": "running",
    "reason": "",
    "latch": "",
    "reached": None,
    "alarm": "",
    "client": "lab",
    "mode": "real-time",
    "period": 1 / 30,
    "watchdog": 0.2,
    "counts": {"late": 3, "stale": 0, "refused": 1},
}
LATCHED = {
    **STATUS,
    "state": "safe",
    "reason": "stopped: smoke",
    "latch": "0123456789abcdef",
    "reached": 0.012,
    "client": "",
    "counts": {},
}


@pytest.mark.parametrize(
    ("status", "line"),
    [
        (
            STATUS,
            "running; client lab; real-time, period 0.03333 s, watchdog 0.2 s; 3 late; 1 refused",
        ),
        (
            LATCHED,
            "safe (reached after 12 ms): stopped: smoke; latch 0123456789abcdef; real-time, period"
            " 0.03333 s, watchdog 0.2 s",
        ),
        (
            {**LATCHED, "state": "stopping", "reached": None},
            "stopping: stopped: smoke; latch 0123456789abcdef; real-time, period 0.03333 s,"
            " watchdog 0.2 s",
        ),
        (
            {**LATCHED, "state": "not reached", "reached": None, "alarm": "look"},
            "THE SAFE STATE WAS NOT REACHED: stopped: smoke; ALARM: look; latch 0123456789abcdef;"
            " real-time, period 0.03333 s, watchdog 0.2 s",
        ),
    ],
)
def test_a_status_is_one_line(status, line):
    assert summarise_status(status) == line


def test_the_status_of_a_server_and_a_stop_that_an_acknowledgement_of_it_releases():
    with SmallRig() as rig:
        remote = read_endpoint(rig.endpoint)
        assert ask(remote, "status")["state"] == "idle"
        first = stop(remote, "smoke")
        assert (first["state"], first["reason"]) == ("safe", "smoke")
        second = stop(remote, "fire")
        with pytest.raises(UserError, match=f"refuses: the present latch is .*{second['latch']}"):
            acknowledge(remote, first["latch"])
        assert acknowledge(remote, second["latch"])["state"] == "idle"


@pytest.mark.parametrize(("later", "state"), [("safe", "safe"), ("not reached", "not reached")])
def test_a_stop_waits_until_it_is_safe_or_known_not_to_be(later, state):
    with SmallRig() as rig:

        def safe(reason):
            rig.state, rig.latch = "stopping", "one"
            Timer(0.2, lambda: setattr(rig, "state", later)).start()

        rig.safe = safe
        begun = time.monotonic()
        assert stop(read_endpoint(rig.endpoint), "smoke")["state"] == state
        assert 0.2 <= time.monotonic() - begun < 1.5


def test_a_stop_that_takes_for_ever_is_told_as_it_is():
    with SmallRig() as rig:
        rig.safe = lambda reason: setattr(rig, "state", "stopping")
        assert stop(read_endpoint(rig.endpoint), "smoke", 0.3)["state"] == "stopping"


def test_a_server_that_does_not_answer_is_given_up_in_time():
    endpoint = f"tcp://127.0.0.1:{free_port()}"
    begin = time.monotonic()
    said = rf"no answer within 0.2 s from {endpoint}, without keys; .* or do the keys not match\?"
    with pytest.raises(UserError, match=said):
        ask(read_endpoint(endpoint), "status", 0.2)
    assert time.monotonic() - begin < 5.0


def test_what_a_stranger_gives_for_a_reason_does_nothing_to_a_terminal():
    status = {**LATCHED, "reason": "\x1b[2Jsafe\u202e\nidle", "client": "a\x07"}
    line = summarise_status(status)
    assert line.isprintable()
    assert "\\x1b[2Jsafe\\u202e idle" in line


def test_who_drives_and_who_acknowledged_is_named():
    line = summarise_status({**STATUS, "operator": "anna", "acknowledged": "ben (acknowledge)"})
    assert "client lab of anna; acknowledged by ben (acknowledge)" in line


def test_a_safe_state_that_the_device_does_not_report_is_not_called_verified():
    line = summarise_status({**LATCHED, "verified": False})
    assert line.startswith("safe (reached after 12 ms; commanded safe, not verified): stopped")
