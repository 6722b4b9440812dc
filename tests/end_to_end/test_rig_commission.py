"""Claims: every protection of a real server is tried with its real processes; one that is broken is
found, and the exit status says so; a real device is not moved without a yes.

The oracle for the processes is the log of the backend, and for the device a file that it holds.
"""

from __future__ import annotations

import json
import struct
import time
from threading import Timer

import pytest

from orchestration.plugins.commission import ServedRig, checks_of, read_device
from orchestration.plugins.commission import commission as work
from tests.support.command import posix, ppy
from tests.support.rig.process import BACKENDS, ROOT

pytestmark = [posix, pytest.mark.timeout(240)]

# a busy machine has a long period to be punctual in
SERVED = ("--port", "0", "--rate", "10", "--watchdog", "2")
OWN = '''
from pathlib import Path

from tests.support.rig.backends import Beating, Logged, Mute


class Deaf(Logged):
    """Its safe state does nothing."""

    def safe(self):
        self._note("safe")


class Rated(Logged):
    def __init__(self, log):
        super().__init__(log, "0.5")
'''


def commission(folder, *words):
    done = ppy(
        "rig",
        "commission",
        *SERVED,
        "--state",
        "state",
        "--json",
        "protocol.json",
        *words,
        cwd=folder,
        environment={"PYTHONPATH": str(ROOT)},
    )
    path = folder / "protocol.json"
    told = json.loads(path.read_text()) if path.exists() else None
    return done, told


def own(folder, name):
    (folder / "own.py").write_text(OWN)
    return "--backend", f"own.py:{name}", "--option", f"log={folder / 'calls.log'}"


def verdicts(told):
    return {line["title"]: line["finding"][0] for line in told["lines"]}


@pytest.mark.slow
@pytest.mark.real_time
def test_the_emulator_passes_what_applies_to_it(tmp_path):
    done, told = commission(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    found = verdicts(told)
    absent = {title for title, verdict in found.items() if verdict == "not applicable"}
    assert absent == {"Rates", "Heartbeat", "Interlocks"}
    assert set(found.values()) == {"pass", "not applicable"}, done.stdout
    page = (tmp_path / "protocol.html").read_text()
    assert "no protection failed" in page
    assert page.count("<figure>") == len(found)


@pytest.mark.slow
@pytest.mark.real_time
def test_a_device_that_holds_its_values_is_left_at_rest(tmp_path):
    done, told = commission(tmp_path, *own(tmp_path, "Rated"), "--yes")
    assert done.returncode == 0, done.stdout + done.stderr
    assert verdicts(told)["Rates"] == "pass"
    assert struct.unpack("<2d", (tmp_path / "calls.log.held").read_bytes()) == (0.0, 0.0)
    calls = [line.split(" ", 2) for line in (tmp_path / "calls.log").read_text().splitlines()]
    written = [tuple(map(float, what.split()[1:])) for _, _, what in calls if "write" in what]
    assert max(current for current, _ in written) == pytest.approx(0.13)
    assert max(force for _, force in written) == pytest.approx(0.3)
    # of the server, its successor, and this program's own look at the device
    assert len({process for _, process, what in calls if what == "open"}) >= 9


@pytest.mark.slow
@pytest.mark.real_time
def test_a_safe_state_that_does_nothing_fails(tmp_path):
    done, told = commission(tmp_path, *own(tmp_path, "Deaf"), "--yes")
    assert done.returncode == 1
    assert verdicts(told)["Stop"] == "FAILED"
    assert "not reached" in told["interrupted"]
    assert "a protection FAILED" in (tmp_path / "protocol.html").read_text()
    assert "ALARM" in done.stderr


@pytest.mark.slow
@pytest.mark.real_time
def test_an_operator_opens_an_interlock_and_sees_the_relay(tmp_path):
    trigger = tmp_path / "trigger"
    device = read_device(
        f"{BACKENDS}:Beating", {"log": str(tmp_path / "calls.log"), "trigger": str(trigger)}
    )
    options = [f"--option={name}={value}" for name, value in device.options.items()]
    words = ["--backend", device.backend, *options, *SERVED, "--state", str(tmp_path / "state")]
    asked = []

    def ask(question):
        asked.append(question)
        if "open door" in question:
            Timer(0.5, trigger.touch).start()
        if "close door" in question:
            trigger.unlink()
            time.sleep(0.5)  # a sample with the door closed
        return True

    rig = ServedRig(device, words, 0.1, ask)
    checks = [one for one in checks_of(rig) if one.title in ("Heartbeat", "Interlock door")]
    protocol = work(rig, print, checks)
    assert [line.verdict for line in protocol.lines] == ["pass", "pass"], protocol.lines
    assert "not released while it was open" in protocol.lines[1].finding.measured
    assert ["relay" in asked[0], "open door" in asked[1], "close door" in asked[2]] == [True] * 3
    assert not protocol.interrupted


@pytest.mark.slow
@pytest.mark.real_time
def test_a_real_device_is_not_moved_without_a_yes(tmp_path):
    done, told = commission(tmp_path, *own(tmp_path, "Rated"))
    assert done.returncode == 2
    assert "--yes" in done.stderr
    assert told is None
    assert "write" not in (tmp_path / "calls.log").read_text()
