"""Claims: a server archives every sample, command and act of an operator; what becomes of its
archiver or its disk does nothing to the rig, and what was lost is told.
"""

from __future__ import annotations

import math
import re
import signal
import time

import numpy as np
import psutil
import pyarrow.parquet
import pytest
import xarray

from orchestration.rig.archive import Archive
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import acknowledge, ask, stop
from tests.support.browser import chromium
from tests.support.command import posix, refused, running, works
from tests.support.rig.archived import AHEAD, filled, samples
from tests.support.rig.backends import GAIN
from tests.support.rig.driver import Driver
from tests.support.rig.process import ROOT, Server
from tests.support.small_disk import disk_of_64_kib

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]

PLACES = """(() => { const texts = list => [...document.querySelectorAll(`#${list} li`)]
    .map(item => item.textContent);
  return { span: document.getElementById("span").textContent, gaps: texts("gaps"),
    entries: texts("entries"),
    signals: [...document.querySelectorAll("canvas")].map(canvas => canvas.dataset.signal) } })()"""
# red pixels of the curve of the voltage between two shares of its width
RED = """((from, to) => { const canvas = document.querySelector("[data-signal=voltage]");
  const left = 64 + from * (canvas.width - 72), width = (to - from) * (canvas.width - 72);
  const { data } = canvas.getContext("2d").getImageData(left, 20, width, canvas.height - 42);
  let count = 0;
  for (let k = 0; k < data.length; k += 4)
    if (data[k + 3] > 40 && data[k] > 150 && data[k + 1] < 100) count++;
  return count })"""
FRAME = """(() => { const canvas = document.querySelector("canvas");
  const { left, top } = canvas.getBoundingClientRect();
  return [left + 64, top, canvas.clientWidth - 72] })()"""

CALM = ("--watchdog", 5.0)  # s: on a busy machine no watchdog is to trip here


def archiver(server, folder):
    """The process that gives way to all others, by the system's own word, once it has written."""
    until(lambda: [*folder.glob("*-samples.parquet")])

    def found():
        processes = map(psutil.Process, server.family())
        niceness, number = max((process.nice(), process.pid) for process in processes)
        own = psutil.Process(server.process.pid).nice()
        return psutil.Process(number) if niceness > own else None

    return until(found)


def until(condition, within=45.0):
    """Wait until something is so, and return it."""
    end = time.monotonic() + within
    while not (found := condition()):
        assert time.monotonic() < end, f"not within {within} s"
        time.sleep(0.05)
    return found


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
    assert {path.suffix for path in folder.iterdir()} == {".parquet"}


@posix
def test_an_archiver_that_is_killed_is_replaced_and_nothing_is_lost(tmp_path):
    folder = tmp_path / "archive"
    with Server(tmp_path, "Logged", "--rate", 200, *CALM, "--archive", folder) as server:
        remote = read_endpoint(server.wait_ready())
        driver = Driver(server.endpoint).start()
        first = archiver(server, folder)
        first.kill()
        server.wait_line("the archiver has ended (-9): another is started")
        assert archiver(server, folder).pid != first.pid
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
        process = archiver(server, folder)
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
        with Server(tmp_path, "Logged", "--rate", 20, *CALM, "--archive", disk / "a") as server:
            remote = read_endpoint(server.wait_ready())
            server.wait_line("No space left on device", 30.0)
            assert ask(remote, "status")["state"] == "idle"
            filler.unlink()
            server.wait_line("is written again", 30.0)
            assert ask(remote, "status")["state"] == "idle"
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
            assert f"the archive {folder} is served already" in second.errors()


@posix
def test_the_page_draws_the_history_and_zooms_by_dragging(browser, tmp_path):
    grown = filled(tmp_path / "archive", samples([*range(1, 501), *range(1001, 2001)]))
    grown.add("events", [(1, 7.0, "state", "safe"), (2, 7.1, "log", "<b>a spark")], AHEAD)
    page = ("rig", "watch", "--no-browser", "--port", "0", "--endpoint", "tcp://127.0.0.1:1")
    watch = running(*page, "--archive", str(tmp_path / "archive"), cwd=ROOT)
    try:
        address = re.search(r"at (http://\S+/)", watch.stdout.readline())[1]
        with chromium(browser, tmp_path / "profile") as tab:
            tab.open(f"{address}history", 1280)
            until(lambda: tab.run(PLACES)["signals"])
            shown = tab.run(PLACES)
            assert shown["signals"] == ["current", "voltage"]
            assert len(shown["gaps"]) == 1
            assert shown["gaps"][0].endswith("500 samples lost")
            assert shown["entries"][0].endswith("<b>a spark"), "the newest is first"
            # of 20 s those from 5 s to 10 s are hatched: red there, and none beside it
            assert tab.run(f"{RED}(0.3, 0.45)") > 50
            assert tab.run(f"{RED}(0.55, 0.95)") == 0
            before = shown["span"]
            left, top, width = tab.run(FRAME)
            for kind, share in (
                ("Pressed", 0.6),
                ("Moved", 0.7),
                ("Moved", 0.8),
                ("Released", 0.8),
            ):
                place = {"x": left + share * width, "y": top + 60}
                mouse = {"button": "left", "buttons": 1, "clickCount": 1}
                tab.call("Input.dispatchMouseEvent", type=f"mouse{kind}", **place, **mouse)
            until(lambda: tab.run(PLACES)["span"] != before)
            asked = re.search(r"from=([\d.]+)&to=([\d.]+)", tab.requests[-1]).groups()
            # to two pixels of some 1100
            expected = [AHEAD + 0.01 + share * 19.99 for share in (0.6, 0.8)]
            assert [float(text) for text in asked] == pytest.approx(expected, rel=0.0, abs=0.04)
            # the browser notes that this test reads pixels
            assert [said for said in tab.complaints if "readback" not in said] == []
    finally:
        watch.kill()
        watch.communicate()


@posix
def test_a_rig_is_recorded_by_listening_alone_while_another_commands_it(tmp_path):
    out = tmp_path / "heard.nc"
    with Server(tmp_path, "Logged", "--rate", 200, *CALM) as server:
        server.wait_ready()
        before = time.monotonic()
        driver = Driver(server.endpoint).start()
        listen = ("rig", "record", "--endpoint", server.endpoint, "--out", out)
        assert "the rig samples 200 times a second" in works(*listen, "--for", "2s", cwd=tmp_path)
        driver.stop()
        after = time.monotonic()
    assert "--rate: is about an experiment" in refused(tmp_path, *listen, "--rate", "10")
    data = xarray.load_dataset(out, engine="scipy", decode_times=False)
    assert (data.attrs["complete"], data.attrs["gaps"]) == (1, 0)
    assert before < data.attrs["start"] < after - 1.5
    assert 1.5 < data.time[-1] <= 2.1
    assert 10.0 < data.attrs["rate"] <= 31.0, "telemetry has 30 samples a second at most"
    written = {float(call.what.split()[1]) for call in server.calls() if call.what[0] == "w"}
    # where the server of a busy machine knows what is applied; by the backend's own log
    known = data.isel(time=np.isfinite(data.current.values))
    assert set(known.current.values) <= {0.0, *written}
    np.testing.assert_allclose(known.voltage, GAIN["voltage"] * known.current, atol=1e-12)
    assert (data.voltage_age >= 0.0).all()
    assert float(data.voltage_age.max()) < 1.0


@posix
def test_listening_ends_in_order_at_ctrl_c_and_a_rig_that_is_away_is_a_gap(tmp_path):
    out = tmp_path / "heard.parquet"
    with Server(tmp_path, "Logged", *CALM) as server:
        server.wait_ready()
        listener = running(
            "rig", "record", "--endpoint", server.endpoint, "--out", out, cwd=tmp_path
        )
        journal = out.with_name(f"{out.name}.part.csv")
        until(lambda: journal.exists() and journal.stat().st_size > 200)
        server.process.send_signal(signal.SIGSTOP)
        time.sleep(1.0)
        server.process.send_signal(signal.SIGCONT)
        time.sleep(1.0)
        listener.send_signal(signal.SIGINT)
        _, errors = listener.communicate(timeout=30)
    assert listener.returncode == 1, "it is incomplete"
    assert "ALARM: nothing was heard of the rig for 0." in errors
    assert "the rig was not heard 1 times" in errors
    table = pyarrow.parquet.read_table(out)
    assert max(np.diff(table["time [s]"].to_numpy())) > 0.9
    assert not journal.exists()
