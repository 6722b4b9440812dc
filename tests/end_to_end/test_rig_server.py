"""Claims: a server says where it is and what it allows, answers in lockstep as its backend does, or
why it cannot.
"""

from __future__ import annotations

import re
import signal
from math import fsum, sin

import pytest
import zmq

from demonstrations.backend import Emulator
from fmus.rig_proxy.link import Link
from fmus.rig_proxy.protocol import REPLIES, decode
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import ask
from tests.support.rig.driver import INPUTS, OUTPUTS, Driver
from tests.support.rig.process import Server

pytestmark = [pytest.mark.timeout(60), pytest.mark.real_time]


def test_the_ready_line_says_where_what_and_what_is_allowed(tmp_path):
    with Server(tmp_path, "Logged", "--rate", 100, "--watchdog", 0.5) as server:
        server.wait_ready()
        line = server.lines[0]
    assert re.match(
        r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} ready: tcp://127\.0\.0\.1:\d+ \(telemetry tcp://",
        line,
    )
    for part in (
        "real time at 100 Hz, watchdog 0.5 s",
        "current [A] -1.3 to 1.3",
        "force [N] 0 to 3",
        "measures voltage [V] -2 to 2, displacement [m]",
    ):
        assert part in line
    assert len([text for text in server.lines if "ready" in text]) == 1


@pytest.mark.slow
def test_telemetry_is_published_one_port_higher_at_most_thirty_times_a_second(tmp_path):
    with Server(tmp_path, "Logged", "--rate", 200) as server, zmq.Context() as context:
        host, _, port = server.wait_ready().rpartition(":")
        driver = Driver(server.endpoint, lambda number: [0.5, 1.0]).start()
        with context.socket(zmq.SUB) as watcher:
            watcher.linger = 0
            watcher.subscribe(b"")
            watcher.connect(f"{host}:{int(port) + 1}")
            messages = []
            while len(messages) < 30:
                assert watcher.poll(5000)
                messages.append(decode(watcher.recv(), REPLIES))
        driver.stop()
    assert messages[-1]["inputs"] == {"current": 0.5, "force": 1.0}
    assert messages[-1]["outputs"] == {"voltage": 1.0, "displacement": 0.5}
    assert messages[-1]["client"] == "driver"
    assert (
        0.9 * 29 / 30 < messages[-1]["clock"] - messages[0]["clock"] < 3 * 29 / 30
    )  # on a busy machine


@pytest.mark.slow
def test_samples_are_taken_at_the_rate_and_their_age_is_below_a_period(tmp_path):
    with Server(tmp_path, "Logged", "--rate", 100) as server:
        server.wait_ready()
        driver = Driver(server.endpoint).start(100)
        driver.stop()
    ages = sorted(sample["ages"][0] for sample in driver.samples)
    assert 0.0 < ages[len(ages) // 2] < 0.01 + 0.01  # half of them; the allowance is a period
    assert driver.unanswered == 0


def test_lockstep_waits_for_the_client_and_holds_its_commands(tmp_path):
    """The backend integrates the current; the sum of current times step is this test's own."""
    with Server(tmp_path, "Stepped", "--lockstep") as server:
        server.wait_ready()
        assert "lockstep, no watchdog" in server.lines[0]
        link = Link(server.endpoint, INPUTS, OUTPUTS)
        accepted = link.connect(0.0, 5.0)
        assert (accepted["mode"], accepted["watchdog"]) == ("lockstep", 0.0)
        steps = [0.01 * (1 + k % 3) for k in range(60)]
        currents = [sin(k) for k in range(60)]
        for k, (current, step) in enumerate(zip(currents, steps, strict=True)):
            sample = link.exchange([current, 0.1], 0.0, step, 5.0)
            assert sample is not None
            assert sample["values"][0] == pytest.approx(
                fsum(i * t for i, t in zip(currents[: k + 1], steps[: k + 1], strict=True)),
                abs=1e-12,
            )
            assert sample["clock"] == pytest.approx(fsum(steps[: k + 1]))
            assert sample["ages"] == [0.0, 0.0]
        beyond = link.exchange([5.0, 0.1], 0.0, 0.01, 5.0)
        assert beyond is not None
        assert beyond["refused"] == [f"current 5 A is above 1.3 A; {currents[-1]:g} A goes on"]
        link.disconnect()
        link.close()
        assert server.calls()[-1].what == "safe"


def test_lockstep_needs_a_backend_that_can_wait(tmp_path):
    with Server(tmp_path, "Logged", "--lockstep") as server:
        assert server.wait_end() == 2
        assert server.errors().count("\n") == 1


@pytest.mark.parametrize(
    ("backend", "arguments", "part"),
    [
        ("Missing", (), "Missing"),
        ("Limitless", (), "limits of current are no limits: -1.3 to 1.3, None/s"),
        ("Logged", ("--option", "colour=red"), "colour"),
        ("Logged", ("--option", "colour"), "write KEY=VALUE"),
        ("Logged", ("--rate", "2000"), "--rate 2000: allowed are 0.1 to 1000 Hz"),
        ("Logged", ("--bind", "0.0.0.0"), "with keys only"),
        ("Logged", ("--keys", "none.toml"), "none.toml"),
        ("Logged", ("--endpoint", "tcp://127.0.0.1:0", "--port", "1"), "give one of them"),
        ("Logged", ("--log", "missing/rig.log"), "--log missing/rig.log: "),
        ("Logged", ("--bind", "127.0.0.1.nip.invalid"), "with keys only"),
    ],
)
def test_a_server_that_cannot_start_says_why_in_a_line(backend, arguments, part, tmp_path):
    with Server(tmp_path, backend, *arguments) as server:
        assert server.wait_end() == 2
        errors = server.errors()
    assert part in errors
    assert errors.startswith("error: ")
    assert errors.count("\n") == 1


def test_a_thread_of_a_driver_does_not_hold_the_end(tmp_path):
    with Server(tmp_path, "Threaded") as server:
        server.wait_ready()
        server.send(signal.SIGTERM)
        assert server.wait_end() == 0
        assert "ended, in the safe state: SIGTERM" in server.lines[-1]
        calls = [call.what for call in server.calls()]
        assert (calls.count("open"), calls[-2:]) == (1, ["safe", "close"])  # not done by another


def test_a_driver_that_hangs_after_the_safe_state_is_no_unsafe_end(tmp_path):
    (tmp_path / "trigger").touch()
    options = {"trigger": tmp_path / "trigger", "where": "close", "how": "hang"}
    with Server(tmp_path, "Faulty", options=options) as server:
        server.wait_ready()
        server.send(signal.SIGTERM)
        assert server.wait_end() == 0
        assert "ended, in the safe state: SIGTERM" in server.lines[-1]


def test_the_emulated_rig_in_lockstep_answers_as_it_does_when_it_is_stepped_directly(tmp_path):
    names = {"current": "A", "force": "N"}
    direct = Emulator(signals="force-driven", seed="3", hidden="drawn", noise="off")
    direct.safe()
    options = {"signals": "force-driven", "seed": 3, "hidden": "drawn", "noise": "off"}
    with Server(tmp_path, "emulator", "--lockstep", options=options) as server:
        server.wait_ready()
        link = Link(server.endpoint, names, dict(direct.outputs))
        link.connect(0.0, 5.0)
        for k in range(100):
            commands = {"current": 0.5 * sin(0.1 * k), "force": 1.0 + 0.5 * (k % 20 > 10)}
            direct.write(commands)
            direct.advance(0.05)
            sample = link.exchange(list(commands.values()), 0.05 * k, 0.05, 5.0)
            assert sample is not None
            assert sample["refused"] == []
            assert sample["values"] == pytest.approx(
                list(direct.read().values()), rel=1e-12, abs=1e-15
            )
        link.disconnect()
        link.close()


@pytest.mark.slow
def test_the_emulated_rig_in_real_time_is_served_at_a_hundred_hertz(tmp_path):
    # the driver is a thread of this process: on a busy machine it may be late by the usual watchdog
    late = ["--watchdog", 2.0]
    with Server(tmp_path, "emulator", "--rate", 100, *late, options={"noise": "off"}) as server:
        server.wait_ready()
        driver = Driver(server.endpoint, lambda number: [0.5, 1.0]).start(100)
        driver.stop()
        status = ask(read_endpoint(server.endpoint), "status")
    assert driver.unanswered == 0
    assert {sample["state"] for sample in driver.samples} == {"running"}
    voltages = [sample["values"][0] for sample in driver.samples]
    assert voltages[-1] > voltages[10] > 0.0, "a capacitor is charged"
    assert status["state"] == "idle"
