"""Claims: a stop outlives its server, however that ends; safe is said when it is confirmed, and not
when it is not; an acknowledgement releases what it names; of two servers one has a device.
"""

from __future__ import annotations

import os
import re
import signal
import time
from contextlib import suppress

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import acknowledge, ask, stop
from tests.support.command import here, posix
from tests.support.rig.driver import Driver, refusal
from tests.support.rig.process import Server

pytestmark = [pytest.mark.timeout(120), pytest.mark.real_time]


def status(server):
    return ask(read_endpoint(server.endpoint), "status")


@pytest.mark.slow
def test_a_stop_holds_over_a_restart_until_it_is_acknowledged(tmp_path):
    with Server(tmp_path) as server:
        remote = read_endpoint(server.wait_ready())
        with Driver(server.endpoint):
            told = stop(remote, "smoke")
        assert told["state"] == "safe"
        assert 0.0 <= told["reached"] < 0.5
        server.wait_line("SAFE STATE: stopped: smoke (by ")
        server.wait_line("safe, reached after ")
        server.process.terminate()
        assert server.wait_end() == 0
    with Server(tmp_path) as server:
        remote = read_endpoint(server.wait_ready())
        server.wait_line("before this start: stopped: smoke")
        again = status(server)
        assert (again["state"], again["latch"]) == ("safe", told["latch"])
        assert "stopped: smoke" in refusal(server.endpoint)
        assert acknowledge(remote, told["latch"])["state"] == "idle"
        assert refusal(server.endpoint) == ""
        server.process.terminate()
        assert server.wait_end() == 0
    with Server(tmp_path) as server:
        server.wait_ready()
        assert status(server)["state"] == "idle"


@pytest.mark.slow
@posix
def test_a_server_that_was_killed_as_a_whole_leaves_the_next_one_latched(tmp_path):
    with Server(tmp_path) as server, Driver(server.wait_ready()) as driver:
        for number in server.family():
            with suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)
        driver._orderly = False
    with Server(tmp_path) as server:
        server.wait_ready()
        told = status(server)
        assert told["state"] in ("stopping", "safe")
        assert "did not end in order" in told["reason"]
        assert "did not end in order" in refusal(server.endpoint)
        assert acknowledge(read_endpoint(server.endpoint), told["latch"])["state"] == "idle"


def test_a_late_acknowledgement_releases_no_later_stop(tmp_path):
    with Server(tmp_path) as server:
        remote = read_endpoint(server.wait_ready())
        first = stop(remote, "smoke")["latch"]
        second = stop(remote, "fire")["latch"]
        with pytest.raises(UserError, match=rf"refuses: the present latch is {second} .*fire"):
            acknowledge(remote, first)
        told = status(server)
        assert (told["latch"], told["reason"]) == (second, "stopped: fire")
        options = ("--endpoint", server.endpoint)
        late = here("rig", "acknowledge", *options, "--latch", first, cwd=tmp_path)
        assert late.returncode == 2
        assert second in late.stderr
        unnamed = here("rig", "acknowledge", *options, cwd=tmp_path)
        assert unnamed.returncode == 2, "another one might have been closed meanwhile"
        assert f"stopped: fire; type: ppy rig acknowledge --latch {second}" in unnamed.stderr
        assert status(server)["latch"] == second
        done = here("rig", "acknowledge", *options, "--latch", second, cwd=tmp_path)
        assert done.returncode == 0
        assert "stopped: fire" in done.stderr
        assert done.stdout.startswith("idle")


def test_ppy_rig_stop_waits_until_it_is_safe_and_says_how_long_that_took(tmp_path):
    with Server(tmp_path) as server:
        server.wait_ready()
        with Driver(server.endpoint):
            done = here("rig", "stop", "--endpoint", server.endpoint, cwd=tmp_path)
        assert done.returncode == 0
        assert re.match(
            r"safe \(reached after \d+ ms\): stopped: ppy rig stop; latch ", done.stdout
        )


@pytest.mark.slow
def test_a_stop_that_does_not_reach_the_device_is_an_alarm_and_no_success(tmp_path):
    options = {"trigger": tmp_path / "trigger", "where": "safe", "how": "raise"}
    with Server(tmp_path, "Faulty", options=options) as server:
        server.wait_ready()
        with Driver(server.endpoint) as driver:
            (tmp_path / "trigger").touch()
            begun = time.monotonic()
            done = here("rig", "stop", "--endpoint", server.endpoint, "--timeout", 20, cwd=tmp_path)
            driver.wait(1)
        assert done.returncode == 1
        assert done.stdout.startswith("THE SAFE STATE WAS NOT REACHED: ")
        assert time.monotonic() - begun < 15.0
        told = status(server)
        assert told["state"] == "not reached"
        assert "THE SAFE STATE WAS NOT REACHED within" in told["alarm"]
        server.wait_line("THE SAFE STATE WAS NOT REACHED within")
        assert not any("safe, reached" in line for line in server.lines)
        assert driver.samples[-1]["state"] in ("stopping", "not reached")
        (tmp_path / "trigger").unlink()  # somebody has put the cable back
        remote = read_endpoint(server.endpoint)
        server.wait_line("safe, reached after")
        told = status(server)
        assert (told["state"], told["alarm"] != "") == ("safe", True)
        assert acknowledge(remote, told["latch"], 20.0)["state"] == "idle"
        assert status(server)["alarm"] == ""


@pytest.mark.slow
def test_of_two_servers_of_a_device_the_second_says_who_has_it(tmp_path):
    with Server(tmp_path) as first:
        first.wait_ready()
        holders = first.processes()
        with Server(tmp_path) as second:
            assert second.wait_end() == 2
            errors = second.errors()
        assert f"is served already, by process {first.process.pid} since" in errors
        assert errors.count("\n") == 1
        # where the machine has paused, another process of the first has taken over
        assert first.processes() - holders <= first.family(), "\n".join(first.lines)
    with Server(tmp_path, "emulator") as first, Server(tmp_path, "emulator") as second:
        first.wait_ready()
        second.wait_ready()
    kept = list((tmp_path / "state").glob("*.json"))
    assert len(kept) == 1, "of the backend, and none of the emulator"


def test_a_folder_for_the_latch_that_cannot_be_used_is_told_before_the_device_is_opened(tmp_path):
    (tmp_path / "file").touch()
    with Server(tmp_path, "Logged", "--state", tmp_path / "file") as server:
        assert server.wait_end() == 2
        assert "--state" in server.errors()
    assert server.calls() == []


@pytest.mark.slow
def test_a_backend_that_cannot_be_opened_leaves_no_latch(tmp_path):
    (tmp_path / "trigger").touch()
    options = {"trigger": tmp_path / "trigger", "where": "open", "how": "raise"}
    with Server(tmp_path, "Faulty", options=options) as server:
        assert server.wait_end() == 2
    (tmp_path / "trigger").unlink()
    with Server(tmp_path, "Faulty", options=options) as server:
        server.wait_ready()
        assert status(server)["state"] == "idle"
