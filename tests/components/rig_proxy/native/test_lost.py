"""The native engine when the rig is silent, gone, safe or unwilling; each has its promised outcome
within its bound.
"""

from __future__ import annotations

import socket

import pytest

from tests.support.rig.native_engine import (
    CONNECTED,
    DEADLINE,
    LATE,
    LOST,
    MAX_AGE,
    MEASURED,
    REFUSED,
    STALE,
    STEP,
    TIMEOUT,
    started,
    steps,
)
from tests.support.rig.relay import listening, relay
from tests.support.rig.scripted_rig import Reply, ScriptedRig, served

pytestmark = pytest.mark.real_time

COUNT = len(MEASURED)


def silent(request: object) -> list[Reply]:
    return []


def test_silence_is_stale_then_lost_and_then_found_again(engine):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint)
        steps(engine, 0, 3)
        rig.answer = silent
        answers = steps(engine, 3, 30)
        states = [answer["link_state"] for answer in answers]
        assert states == sorted(states)
        assert set(states) == {CONNECTED, STALE, LOST}
        until_lost = sum(answer.seconds for answer in answers[: states.index(LOST) + 1])
        assert TIMEOUT - STEP <= until_lost <= TIMEOUT + STEP + DEADLINE + LATE
        assert answers[-1]["voltage"] == 0.25
        assert answers[-1]["voltage_age"] > TIMEOUT
        rig.answer = rig.replies
        again = steps(engine, 33, 5)[-1]
        assert (again["link_state"], again["voltage"]) == (CONNECTED, 0.25)
        assert again["voltage_age"] < MAX_AGE
        assert rig.sessions == 2


@pytest.mark.parametrize(
    ("max_age", "text"), [(0.1, "s old; max_age is 0.1 s"), (9.0, "no answer from the rig")]
)
def test_silence_is_an_error_where_it_shall_be(engine, max_age, text):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint, on_stale="fail", max_age=max_age)
        rig.answer = silent
        last = steps(engine, 0, 40)[-1]
    assert not last.ok
    assert text in last.message


def test_a_server_that_is_killed_and_back(engine):
    with served(ScriptedRig(COUNT)) as endpoint:
        started(engine, endpoint)
        steps(engine, 0, 3)
    gone = steps(engine, 3, 30)
    assert all(answer.ok for answer in gone)
    assert gone[-1]["link_state"] == LOST
    assert (
        sum(answer.seconds for answer in gone) > 29 * STEP - LATE
    )  # the pace is kept without a rig, too
    back = ScriptedRig(COUNT)
    with served(back, endpoint):
        assert steps(engine, 33, 5)[-1]["link_state"] == CONNECTED
    assert back.said("connect")


@pytest.mark.parametrize("on_stale", ["hold", "fail"])
def test_a_server_that_has_forgotten_the_session(engine, on_stale):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint, on_stale=on_stale)
        steps(engine, 0, 3)
        rig.sessions += 1
        answers = steps(engine, 3, 3)
    if on_stale == "fail":
        assert "refuses: no such session" in answers[-1].message
    else:
        assert answers[-1]["link_state"] == CONNECTED
        assert rig.sessions == 3


def test_the_safe_state_is_an_error(engine):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint)
        rig.exchanged = lambda request: [
            (0.0, rig.sample(request, state="safe", reason="tension beyond 5 N"))
        ]
        answer = steps(engine, 0, 1)[0]
    assert (answer.ok, answer.message) == (
        False,
        "the rig is in its safe state: tension beyond 5 N",
    )


def test_a_refused_command_is_told(engine):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint)
        rig.exchanged = lambda request: [
            (0.0, rig.sample(request, refused=["current 9 A is beyond\n1.3 A", "more"]))
        ]
        answer = steps(engine, 0, 1)[0]
        assert (answer.ok, answer.message) == (
            True,
            "refused by the rig: current 9 A is beyond 1.3 A",
        )
        assert answer["link_state"] == REFUSED
        rig.exchanged = lambda request: [(0.0, rig.sample(request))]
        answer = steps(engine, 1, 1)[0]
        assert (answer.ok, answer.message, answer["link_state"]) == (True, "", CONNECTED)


def test_a_value_that_is_missing_is_held_and_grows_older(engine):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint, max_age=0.1)
        steps(engine, 0, 2)
        rig.exchanged = lambda request: [
            (0.0, rig.sample(request, values=[None, *[3.0] * (COUNT - 1)]))
        ]
        answers = steps(engine, 2, 10)
    first, others = MEASURED[0], MEASURED[1:]
    assert answers[-1][first] == 0.25
    assert answers[-1][f"{first}_age"] > 9 * STEP
    assert all(answers[-1][name] == 3.0 for name in others)
    assert all(answers[-1][f"{name}_age"] < 0.1 + LATE for name in others)
    assert answers[-1]["link_state"] == STALE


@pytest.mark.parametrize("how", ["silent", "closed", "refused"])
def test_lockstep_without_an_answer_is_an_error(engine, how):
    rig = ScriptedRig(COUNT, mode="lockstep")
    hang_up = {"now": False}

    def spoil(client: socket.socket, data: bytes) -> None:
        if hang_up["now"]:
            raise ConnectionAbortedError
        client.sendall(data)

    with served(rig) as behind, listening(relay(behind, spoil)) as endpoint:
        started(engine, endpoint, on_stale="hold")
        steps(engine, 0, 2)
        if how == "silent":
            rig.answer = silent
        elif how == "refused":
            rig.sessions += 1
        hang_up["now"] = how == "closed"
        answer = steps(engine, 2, 1)[0]
    assert not answer.ok
    expected = {
        "silent": "no answer within 0.4 s",
        "closed": "closed the connection",
        "refused": "no such session",
    }
    assert expected[how] in answer.message
