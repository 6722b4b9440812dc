"""The native engine when the rig is silent, gone, safe or unwilling; each has its promised outcome
within its bound.
"""

from __future__ import annotations

import math
import re
import socket
import time

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
    TIMES,
    Answer,
    NativeEngine,
    started,
    steps,
)
from tests.support.rig.relay import listening, relay
from tests.support.rig.scripted_rig import Reply, ScriptedRig, served

pytestmark = pytest.mark.real_time

COUNT = len(MEASURED)
YEAR = 3.2e7  # s


def silent(request: object) -> list[Reply]:
    return []


def test_silence_is_stale_then_lost_and_the_session_goes_on_where_it_still_lives(engine):
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
        assert rig.sessions == 1


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


def assert_held(answers: list[Answer]) -> None:
    """Steps go on with a value that grows older, and a link that is lost."""
    assert all(answer.ok and answer["link_state"] == LOST for answer in answers)
    assert {answer["voltage"] for answer in answers} == {0.25}
    for name in ("voltage_age", "round_trip_time"):
        values = [answer[name] for answer in answers]
        assert values == sorted(values)
        assert values[-1] > values[0] + 0.5 * STEP * (len(answers) - 1)


def test_a_server_that_is_killed_and_back_gets_no_command(engine):
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
        answers = steps(engine, 33, 20)
    assert_held(answers)
    assert [a.message for a in answers if "refuses" in a.message] == [], "it was lost before"
    assert not back.said("connect")
    assert len(back.exchanges()) == 1, "which the server has refused"


@pytest.mark.parametrize("on_stale", ["hold", "fail"])
def test_a_session_that_the_server_has_forgotten_is_over(engine, on_stale):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint, on_stale=on_stale)
        steps(engine, 0, 3)
        rig.sessions += 1
        sent = len(rig.exchanges())
        answers = steps(engine, 3, 10)
        if on_stale == "fail":
            assert "refuses: no such session" in answers[-1].message
        else:
            assert_held(answers)
            assert ["refuses: no such session" in a.message for a in answers] == [True] + 9 * [
                False
            ]
        assert len(rig.exchanges()) == sent + 1
        assert [r["type"] for r in rig.requests].count("connect") == 1


@pytest.mark.parametrize(
    ("state", "text"),
    [
        ("safe", "the rig is in its safe state: tension beyond 5 N"),
        ("stopping", "the rig is on the way to its safe state: tension beyond 5 N"),
        (
            "not reached",
            "the rig HAS NOT REACHED ITS SAFE STATE AND MAY STILL BE ENERGISED: tension beyond 5 N",
        ),
    ],
)
def test_a_latch_is_an_error(engine, state, text):
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint)
        rig.exchanged = lambda request: [
            (0.0, rig.sample(request, state=state, reason="tension beyond 5 N"))
        ]
        answer = engine.advance(0.0, 0.3)
    assert (answer.ok, answer.message) == (False, text)
    assert answer.seconds < LATE, "it is told at once, and not at the end of the step"


@pytest.mark.parametrize("how", ["silent", "latched", "refused", "bad input", "terminated"])
def test_what_is_read_after_the_end_is_as_old_as_it_says(engine, how):
    """An error of a step, or the end of the run, leaves the last values and their true ages."""
    rig = ScriptedRig(COUNT)
    with served(rig) as endpoint:
        started(engine, endpoint, on_stale="fail")
        assert steps(engine, 0, 3)[-1]["voltage_age"] < MAX_AGE
        newest = time.monotonic()
        match how:
            case "silent":
                rig.answer = silent
            case "latched":
                rig.exchanged = lambda request: [
                    (0.0, rig.sample(request, values=[0.5] * COUNT, state="safe"))
                ]
            case "refused":
                rig.sessions += 1
            case "bad input":
                engine.set(current=math.nan)
            case "terminated":
                engine.call("terminate")
        assert not steps(engine, 3, 20)[-1].ok
        time.sleep(0.3)
        first, taken = engine.read(), time.monotonic()
        time.sleep(0.2)
        second = engine.read()
    assert first["voltage"] == second["voltage"] == (0.5 if how == "latched" else 0.25)
    assert 0.3 <= first["voltage_age"] <= taken - newest + STEP + LATE
    assert 0.3 <= first["round_trip_time"] <= taken - newest + STEP + LATE
    for name in (*(f"{value}_age" for value in MEASURED), "round_trip_time"):
        assert 0.2 <= second[name] - first[name] <= 0.2 + LATE
    assert first["link_state"] == second["link_state"] == LOST


def test_before_and_without_a_first_answer_nothing_looks_fresh(engine):
    before = engine.read()
    engine.set(**TIMES | {"endpoint": "tcp://127.0.0.1:1"})
    assert not engine.initialize().ok
    for read in (before, engine.read()):
        assert read["link_state"] == LOST
        assert min(read[f"{name}_age"] for name in MEASURED) > YEAR
        assert read["round_trip_time"] > YEAR


def test_every_instance_and_every_connection_has_a_name_of_its_own(driver):
    instances, names = set(), set()
    for _ in range(2):
        rig = ScriptedRig(COUNT)
        engine = NativeEngine(driver)
        with served(rig) as endpoint:
            for _ in range(2):
                started(engine, endpoint)
                engine.call("terminate")
        engine.close()
        assert len(rig.peers) == 2
        for peer in rig.peers:
            assert re.fullmatch(rb"ppy-[0-9a-f]{16}-\d+", peer)
        instances |= {r["instance"] for r in rig.requests if r["type"] == "connect"}
        names |= rig.peers
    assert len(instances) == 2
    assert {name[4:20].decode() for name in names} == instances
    assert len(names) == 4


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
