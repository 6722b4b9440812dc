"""Requests of an operator: a status is one line, and a server that is silent is an error."""

from __future__ import annotations

import time

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import ask, summarise_status
from tests.support.rig.small_rig import SmallRig, free_port

STATUS = {
    "state": "running",
    "reason": "",
    "client": "lab",
    "mode": "real-time",
    "period": 1 / 30,
    "watchdog": 0.2,
    "counts": {"late": 3, "stale": 0, "refused": 1},
}


def test_a_status_is_one_line():
    assert summarise_status(STATUS) == (
        "running; client lab; real-time, period 0.03333 s, watchdog 0.2 s; 3 late; 1 refused"
    )
    safe = {**STATUS, "state": "safe", "reason": "stopped: smoke", "client": "", "counts": {}}
    assert (
        summarise_status(safe)
        == "safe: stopped: smoke; real-time, period 0.03333 s, watchdog 0.2 s"
    )


def test_the_status_of_a_server():
    with SmallRig() as rig:
        answer = ask(read_endpoint(rig.endpoint), "status")
    assert answer["state"] == "idle"


def test_a_server_that_does_not_answer_is_given_up_in_time():
    endpoint = f"tcp://127.0.0.1:{free_port()}"
    begin = time.monotonic()
    with pytest.raises(UserError, match=rf"no answer within 0.2 s from {endpoint}, without keys"):
        ask(read_endpoint(endpoint), "status", 0.2)
    assert time.monotonic() - begin < 5.0
