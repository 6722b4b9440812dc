"""The native engine against a rig that behaves: values, ages, pacing, lockstep, life cycle."""

from __future__ import annotations

import itertools
import math
import os
import random
import shutil
import subprocess
import time

import pytest

from fmus.rig_proxy import local_key
from fmus.rig_proxy.model import RigProxy
from orchestration.rig.keys import left_key
from tests.support.command import posix
from tests.support.rig.native_engine import LATE, MEASURED, NativeEngine
from tests.support.rig.scripted_rig import ScriptedRig, message, served

pytestmark = pytest.mark.real_time


def started(engine: NativeEngine, endpoint: str, time: float = 0.0, **values: object) -> None:
    engine.set(endpoint=endpoint, **values)
    answer = engine.initialize(time)
    assert answer.ok, answer.message


@pytest.mark.slow
def test_a_session_has_the_messages_of_the_protocol(engine):
    rig = ScriptedRig(len(MEASURED))
    with served(rig) as endpoint:
        started(engine, endpoint, 2.0, current=0.1, force=-1.5)
        assert engine.advance(2.0, 0.02).ok
        assert engine.advance(2.02, 0.02).ok
        engine.call("terminate")
    connect, *exchanges, disconnect = rig.requests
    units = {v.name: v.unit for v in RigProxy.layout.outputs}
    assert connect == {
        "ppy": 2,
        "type": "connect",
        "key": "",
        "client": "rig_proxy",
        "instance": connect["instance"],
        "inputs": {"current": "A", "force": "N"},
        "outputs": {name: units[name] for name in MEASURED},
        "time": 2.0,
    }
    assert list(connect["outputs"]) == MEASURED
    assert [e["sequence"] for e in exchanges] == list(range(1, len(exchanges) + 1))
    assert all(e["values"] == [0.1, -1.5] and e["session"] == "session-1" for e in exchanges)
    assert {(e["time"], e["step"]) for e in exchanges} == {(2.0, 0.02), (2.02, 0.02)}
    seen = [e["seen"] for e in exchanges]
    assert seen == sorted(seen)
    assert seen[0] > 1000.0  # the rig's clock, not ours
    assert disconnect == {"ppy": 2, "type": "disconnect", "session": "session-1"}


def test_values_are_those_of_the_end_of_the_step_and_ages_of_now(engine):
    rig = ScriptedRig(len(MEASURED))
    rig.answer = lambda request: (
        [
            (
                0.0,
                rig.sample(
                    request,
                    values=[0.1 * k for k in range(len(MEASURED))],
                    ages=[0.01] * len(MEASURED),
                ),
            )
        ]
        if request["type"] == "exchange"
        else rig.replies(request)
    )
    with served(rig) as endpoint:
        started(engine, endpoint)
        answer = engine.advance(0.0, 0.05)
    assert [answer[name] for name in MEASURED] == pytest.approx(
        [0.1 * k for k in range(len(MEASURED))], abs=0
    )
    for name in MEASURED:
        assert 0.01 <= answer[f"{name}_age"] <= 0.01 + LATE
        assert answer[f"{name}_age"] >= 0.01 + answer["round_trip_time"]
    assert 0.0 < answer["round_trip_time"] < LATE
    assert (answer["missed_deadlines"], answer["link_state"]) == (0.0, 0.0)


def test_steps_keep_the_pace_of_the_clock_without_drift(engine):
    with served(ScriptedRig(len(MEASURED))) as endpoint:
        started(engine, endpoint)
        begin = time.monotonic()
        for k in range(40):
            assert engine.advance(0.02 * k, 0.02).ok
        lasted = time.monotonic() - begin
    assert 0.8 - 0.02 <= lasted <= 0.8 + LATE


def test_a_simulation_that_is_late_by_steps_does_not_race(engine):
    rig = ScriptedRig(len(MEASURED))
    with served(rig) as endpoint:
        started(engine, endpoint)
        engine.advance(0.0, 0.02)  # the clock runs from the first step on
        time.sleep(0.5)
        begin = time.monotonic()
        for k in range(1, 11):
            engine.advance(0.02 * k, 0.02)
        assert time.monotonic() - begin > 0.18 - 1e-3


def test_what_is_late_by_less_than_a_step_is_made_up_for(engine):
    with served(ScriptedRig(len(MEASURED))) as endpoint:
        started(engine, endpoint)
        begin = time.monotonic()
        for k in range(10):
            engine.advance(0.1 * k, 0.1)
            time.sleep(0.03)
        assert 1.0 < time.monotonic() - begin < 1.0 + 0.03 + LATE


def test_a_long_step_does_not_let_the_watchdog_trip(engine):
    rig = ScriptedRig(len(MEASURED), watchdog=0.2)
    at: list[float] = []
    rig.answer = lambda request: at.append(time.monotonic()) or rig.replies(request)
    with served(rig) as endpoint:
        started(engine, endpoint)
        assert engine.advance(0.0, 0.9).ok
    assert max(b - a for a, b in itertools.pairwise(at)) < rig.watchdog
    assert 10 < len(at) < 40


def test_lockstep_steps_the_rig_exactly(engine):
    rig = ScriptedRig(len(MEASURED), mode="lockstep")
    rng, expected, now = random.Random(3), 0.0, 0.0
    with served(rig) as endpoint:
        started(engine, endpoint)
        begin = time.monotonic()
        for _ in range(200):
            current, step = rng.gauss(0.0, 1.0), rng.choice([0.1, 0.03, 1 / 3])
            engine.set(current=current)
            answer = engine.advance(now, step)
            now += step
            expected += step * current
            assert answer.ok
            assert (
                answer["voltage"] == expected
            )  # to the last bit: numbers go to and fro as they are
        assert time.monotonic() - begin < 10.0  # 30 s are simulated
    assert len(rig.exchanges()) == 200


@pytest.mark.slow
def test_the_decimal_comma_of_a_host_changes_nothing(engine, tmp_path, driver):
    if shutil.which("localedef") is None:
        pytest.skip("no locale with a decimal comma can be made here")
    made = subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(tmp_path / "de_DE.UTF-8")], check=False
    )
    if not (tmp_path / "de_DE.UTF-8").exists():
        pytest.skip(f"localedef made none ({made.returncode})")
    os.environ["LOCPATH"] = str(tmp_path)
    try:
        german = NativeEngine(driver)
    finally:
        del os.environ["LOCPATH"]
    rig = ScriptedRig(len(MEASURED), mode="lockstep")
    with served(rig) as endpoint:
        german.set(endpoint=endpoint, current=0.3)
        assert german.line("locale", "de_DE.UTF-8") == "ok"
        assert german.initialize().ok
        assert german.advance(0.0, 0.7)["voltage"] == 0.7 * 0.3
        assert rig.exchanges()[0]["step"] == 0.7
    german.close()


def test_an_instance_serves_again_after_its_end_and_after_an_error(engine):
    rig = ScriptedRig(len(MEASURED))
    with served(rig) as endpoint:
        for _ in range(3):
            started(engine, endpoint)
            assert engine.advance(0.0, 0.01).ok
            engine.call("terminate")
            assert not engine.advance(0.01, 0.01).ok  # there is no link any more
        rig.answer = lambda request: [(0.0, message("refused", reason="busy"))]
        assert "busy" in engine.initialize().message
        rig.answer = rig.replies
        started(engine, endpoint)
        assert engine.advance(0.0, 0.01).ok
    assert rig.sessions == 4


def test_an_error_leaves_the_rig_at_zero(engine):
    rig = ScriptedRig(len(MEASURED))
    with served(rig) as endpoint:
        started(engine, endpoint)
        answer = engine.advance(0.0, 1.5)
        assert answer.message == "a step of 1.5 s is longer than communication_timeout, 1 s"
        assert rig.said("disconnect")


def test_input_that_is_no_number_is_not_sent(engine):
    rig = ScriptedRig(len(MEASURED))
    with served(rig) as endpoint:
        started(engine, endpoint, current=math.nan)
        answer = engine.advance(0.0, 0.01)
    assert (answer.ok, answer.message) == (False, "'current' is not a finite number")
    assert rig.exchanges() == []


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"on_stale": "maybe"}, "parameter 'on_stale' = 'maybe': must be hold or fail"),
        ({"deadline": 2.0}, "parameter 'deadline' = 2 s is longer than communication_timeout, 1 s"),
        ({"max_age": 0.0}, "parameter 'max_age' = 0 s: must be greater than 0"),
        (
            {"communication_timeout": math.nan},
            "parameter 'communication_timeout' = nan s: must be greater than 0",
        ),
        ({"credentials": "/key.toml"}, "ppy rig bridge"),
        ({"endpoint": "tcp://10.0.0.2:5570"}, "ppy rig bridge"),
        ({"endpoint": "tcp://rig.example:5570"}, "ppy rig bridge"),
        ({"endpoint": "tcp://127.0.0.1.evil:5570"}, "ppy rig bridge"),
        ({"endpoint": "tcp://127.0.0.256:5570"}, "ppy rig bridge"),
        ({"endpoint": "tcp://127.0.0:5570"}, "ppy rig bridge"),
        ({"endpoint": "tcp://*:5570"}, "ppy rig bridge"),
        ({"endpoint": "ipc:///tmp/rig"}, "must be tcp://HOST:PORT"),
        ({"endpoint": "tcp://127.0.0.1"}, "must be tcp://HOST:PORT"),
        ({"endpoint": "tcp://127.0.0.1:"}, "must be tcp://HOST:PORT"),
        ({"endpoint": "tcp://127.0.0.1:0"}, "must be tcp://HOST:PORT"),
        ({"endpoint": "tcp://127.0.0.1:65536"}, "must be tcp://HOST:PORT"),
        ({"endpoint": "tcp://127.0.0.1:5570 "}, "must be tcp://HOST:PORT"),
        ({"endpoint": "tcp://:5570"}, "must be tcp://HOST:PORT"),
    ],
)
def test_parameters_that_cannot_be_are_refused_in_a_line(engine, values, text):
    engine.set(**values)
    answer = engine.initialize()
    assert not answer.ok
    assert text in answer.message
    assert answer.seconds < LATE


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "127.0.0.5", "[::1]", "::1"])
def test_every_name_of_this_machine_is_reached(engine, host):
    address = {"localhost": "127.0.0.1", "::1": "[::1]"}.get(host, host)
    options = {"ipv6": True} if ":" in host else {}
    rig = ScriptedRig(len(MEASURED))
    with served(rig, f"tcp://{address}:*", **options) as endpoint:
        port = endpoint.rpartition(":")[2]
        with left_key(f"tcp://{address}:{port}") as holders:
            started(engine, f"tcp://{host}:{port}")
        assert engine.advance(0.0, 0.01).ok
    connect = next(request for request in rig.requests if request["type"] == "connect")
    assert holders[connect["key"]].role == "acknowledge"


@posix
@pytest.mark.parametrize("mode", [0o640, 0o604])
def test_a_key_that_others_can_read_is_not_sent(engine, mode):
    rig = ScriptedRig(len(MEASURED))
    with served(rig, "tcp://127.0.0.1:*") as endpoint, left_key(endpoint):
        local_key.path(endpoint).chmod(mode)
        started(engine, endpoint)
    connect = next(request for request in rig.requests if request["type"] == "connect")
    assert connect["key"] == ""
