"""Claims: a server archives every sample, command and act of an operator; what becomes of its
archiver or its disk does nothing to the rig, and what was lost is told.
"""

from __future__ import annotations

import math
import signal
import time

import numpy as np
import psutil
import pytest

from orchestration.rig.archive import Archive
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import acknowledge, ask, stop
from tests.support.command import posix
from tests.support.rig.driver import Driver
from tests.support.rig.process import Server
from tests.support.small_disk import disk_of_64_kib

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]

CALM = ("--watchdog", 5.0)  # s: on a busy machine no watchdog is to trip here


def archiver(server):
    """The process that has the file of samples open, by the system's own word."""
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        for number in server.family():
            try:
                opened = [each.path for each in psutil.Process(number).open_files()]
            except psutil.Error:
                continue
            if any(path.endswith("-samples.arrows") for path in opened):
                return psutil.Process(number)
        time.sleep(0.1)
    raise AssertionError("nobody writes samples")


def numbers(folder):
    return Archive(folder).rows("samples", -math.inf, math.inf)["number"].to_numpy()


def end(server):
    server.send(signal.SIGTERM)
    assert server.wait_end() == 0


@posix
def test_every_sample_command_and_act_of_an_operator_is_there(tmp_path):
    folder = tmp_path / "archive"
    with Server(tmp_path, "Logged", "--rate", 200, *CALM, "--archive", folder) as server:
        remote = read_endpoint(server.wait_ready())
        driver = Driver(server.endpoint, lambda number: [0.001 * number, 1.0]).start(50)
        driver.stop()
        latched = stop(remote, "a spark", 5.0)
        acknowledge(remote, latched["latch"], 5.0)
        end(server)
    archive = Archive(folder)
    calls = [call.what.split() for call in server.calls()]  # the backend's own log
    samples = archive.rows("samples", -math.inf, math.inf)
    assert samples["number"].to_pylist() == list(range(1, samples.num_rows + 1))
    assert archive.gaps() == []
    commands = archive.rows("commands", -math.inf, math.inf)
    run = [row["current"] for row in commands.to_pylist() if row["order"] == "run"]
    expected = [0.001 * k for k in range(len(run) + 2)]
    assert set(run) <= set(expected)
    assert len(run) >= 50 - driver.unanswered
    driven = [row["current"] for row in samples.to_pylist() if row["force"] == 1.0]
    assert driven == [float(words[1]) for words in calls if words[0] == "write"]
    states = [text for _, what, text in archive.events() if what == "state"]
    assert [text for text in states if text != "stopping"][-4:] == [
        "running",
        "idle",
        "safe",
        "idle",
    ]
    lines = "\n".join(text for _, what, text in archive.events() if what == "log")
    for part in (
        "client connected: driver",
        "SAFE STATE: stopped: a spark (by ",
        "acknowledged by",
        "ended",
    ):
        assert part in lines
    assert {path.suffix for path in folder.iterdir()} <= {".parquet", ".lock"}


@posix
def test_an_archiver_that_is_killed_is_replaced_and_nothing_is_lost(tmp_path):
    folder = tmp_path / "archive"
    with Server(tmp_path, "Logged", "--rate", 200, *CALM, "--archive", folder) as server:
        remote = read_endpoint(server.wait_ready())
        driver = Driver(server.endpoint).start()
        first = archiver(server)
        first.kill()
        server.wait_line("the archiver has ended (-9): another is started")
        assert archiver(server).pid != first.pid
        assert ask(remote, "status")["state"] == "running"
        driver.stop()
        end(server)
    found = numbers(folder)
    np.testing.assert_array_equal(found, np.arange(1, len(found) + 1))
    assert Archive(folder).gaps() == []


@posix
def test_what_is_lost_while_an_archiver_does_not_run_is_told_and_the_rig_runs_on(tmp_path):
    folder = tmp_path / "archive"
    with Server(tmp_path, "Logged", "--rate", 1000, *CALM, "--archive", folder) as server:
        remote = read_endpoint(server.wait_ready())
        driver = Driver(server.endpoint).start()
        process = archiver(server)
        before = len(server.calls())
        process.suspend()
        begun = time.time()
        while len(server.calls()) - before < 2 * 6000:  # a reading and a writing for each sample
            time.sleep(0.2)
        ended = time.time()
        process.resume()
        assert ask(remote, "status")["state"] == "running"
        time.sleep(3.0)
        driver.stop()
        end(server)
    found = numbers(folder).astype(int)
    lost = set(range(1, found[-1] + 1)) - set(found)
    gaps = [gap for gap in Archive(folder).gaps() if gap.lost]
    assert sum(gap.lost for gap in gaps) == len(lost) > 0
    assert gaps[0].begin > begun - 2.0
    assert gaps[-1].end < ended + 2.0


@posix
def test_a_full_disk_is_told_and_the_archive_goes_on_when_there_is_room(tmp_path):
    with disk_of_64_kib(tmp_path / "disk") as disk:
        filler = disk / "filler"
        filler.write_bytes(bytes(40_000))
        with Server(tmp_path, "Logged", "--rate", 50, *CALM, "--archive", disk / "a") as server:
            remote = read_endpoint(server.wait_ready())
            driver = Driver(server.endpoint).start()
            server.wait_line("No space left on device", 30.0)
            assert ask(remote, "status")["state"] == "running"
            filler.unlink()
            server.wait_line("is written again", 30.0)
            assert ask(remote, "status")["state"] == "running"
            driver.stop()
            server.process.kill()
            server.process.wait()
            time.sleep(4.0)
        archive = Archive(disk / "a")
        found = archive.rows("samples", -math.inf, math.inf)["number"].to_numpy().astype(int)
        missing = found[-1] - len(found)
        assert sum(gap.lost for gap in archive.gaps()) == missing


def test_what_cannot_be_archived_is_refused_in_a_line(tmp_path):
    folder = tmp_path / "archive"
    place = tmp_path / "file"
    place.touch()
    for arguments, part in (
        (("--lockstep", "--archive", folder), "without --lockstep"),
        (("--archive", place), "file"),
        (("--archive", folder, "--archive-size", "10kB"), "at least 1MB"),
        (("--archive", folder, "--archive-size", "much"), "such as 1GB"),
    ):
        with Server(tmp_path, "Stepped", *arguments) as server:
            assert server.wait_end() == 2
            assert part in server.errors()
    with Server(tmp_path, "Logged", "--archive", folder) as first:
        first.wait_ready()
        other = tmp_path / "other"
        other.mkdir()
        with Server(other, "Logged", "--archive", folder) as second:
            assert second.wait_end() == 2
            assert "another server writes to it" in second.errors()
