"""Claims: a run in real time tells how it is doing, and nothing that goes wrong costs its record.

Real processes, real signals, a real limit of the system on the size of files. How long steps take
is told to the FMU (`c/sleeper.c`); a busy machine may make everything later, so times are held from
one side only.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fmus import component
from orchestration.cli.real_time import _admit, _StatusLine, status
from orchestration.experiment import results
from orchestration.experiment.live import Moment, RigEnd
from orchestration.master import RealTime
from orchestration.records import read_record
from orchestration.rig.response_times import ResponseTimes
from orchestration.system import Member, Port, System, ssp
from tests.support.command import here, on_terminal, posix, ppy, refused
from tests.support.master.sleeper import build_sleeper

pytestmark = pytest.mark.real_time

UNITS = {"characters": "1", "voltage_age": "1", "link_state": "1"}
FAILING = ["--set", "fails_at=0.5"]


@pytest.fixture
def folder(tmp_path):
    """Make a folder with an experiment of two seconds in steps of 10 ms."""
    build_sleeper(tmp_path)
    (tmp_path / "scratch").mkdir()
    (tmp_path / "one.toml").write_text('component = "sleeper.fmu"\nduration = 2\nstep = 0.01\n')
    return tmp_path


def in_real_time(folder, *arguments) -> subprocess.CompletedProcess[str]:
    return ppy(
        "run",
        "one.toml",
        "--real-time",
        *arguments,
        cwd=folder,
        environment={"TMPDIR": str(folder / "scratch")},
    )


def started(folder, *arguments, before: str = "") -> subprocess.Popen[str]:
    """Run in a process of its own, in which some Python comes first."""
    code = f"{before}\nfrom orchestration.cli.app import main\nmain()"
    return subprocess.Popen(
        [sys.executable, "-c", code, "run", "one.toml", "--real-time", *map(str, arguments)],
        cwd=folder,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        # where files must stay small, compiled modules would be cut off for all that come later
        env=os.environ | {"TMPDIR": str(folder / "scratch"), "PYTHONDONTWRITEBYTECODE": "1"},
    )


def appears(path: Path, content: bytes = b"", timeout: float = 60.0) -> None:
    end = time.monotonic() + timeout
    while not path.is_file() or content not in path.read_bytes():
        assert time.monotonic() < end, f"{path} has not come"
        time.sleep(0.02)


@pytest.mark.slow
def test_the_result_tells_how_well_the_run_kept_pace(folder):
    done = in_real_time(folder, "--out", "run.nc", "--set", "duration=0.5")
    assert done.returncode == 0, done.stderr
    data = results.read(folder / "run.nc")
    about = data.attrs
    assert (about["complete"], about["deadlines"], data.time.size) == (1, 50, 51)
    lateness = json.loads(about["lateness"])
    assert sum(lateness["counts"]) == 50
    assert len(lateness["counts"]) == len(lateness["upper_bounds"]) + 1
    assert (
        f"real time: {about['missed_deadlines']} of 50 deadlines missed, the latest by "
        in done.stdout
    )
    assert about["wall_time"] >= 0.5
    assert "until run.nc is written, what is recorded goes to run.nc.part.csv" in done.stderr
    assert sorted(path.name for path in folder.glob("run*")) == ["run.nc"]
    again = here("run", "run.nc", cwd=folder)
    assert (
        "every value is the same to the last bit" in again.stdout
    )  # a model does not care for the clock


@pytest.mark.slow
def test_what_tells_of_a_link_is_recorded_whatever_the_experiment_names(folder):
    (folder / "one.toml").write_text(
        'component = "sleeper.fmu"\nstep = 0.01\nrecord = ["characters"]\n'
    )
    assert in_real_time(folder, "--out", "run.csv", "--set", "duration=0.05").returncode == 0
    header = (folder / "run.csv").read_text().splitlines()[0]
    assert header == "time [s],characters [1],voltage_age [1],link_state [1]"


@pytest.mark.parametrize(("given", "lag"), [(None, 0.1), (0.5, 0.5)])
def test_a_run_with_several_rigs_pauses_no_longer_than_the_shortest_watchdog_allows(
    given, lag, monkeypatch
):
    """By half of each, unless a pause is given."""
    watchdogs = {"tcp://one": 0.6, "tcp://two": 0.2, "tcp://three": 0.4}

    def linked(endpoint, *_):
        return SimpleNamespace(endpoint=endpoint, close=lambda: None)

    def measured(link, step):
        return ResponseTimes(step, np.full(9, 1e-4), watchdogs[link.endpoint])

    monkeypatch.setattr("fmus.rig_proxy.Link", linked)
    monkeypatch.setattr("orchestration.rig.measure_response_times", measured)
    rigs = [RigEnd(endpoint, "") for endpoint in watchdogs]
    pace = _admit(RealTime(), rigs, 0.01, given)
    assert pace.lag == pytest.approx(lag)
    assert not pace.makes_up


def test_status():
    assert status(Moment(12.34, 30.0, 0.00012, 3, {}, "")) == "12.3 s of 30 s, lag 0.1 ms, missed 3"
    link = {
        "proxy.link_state": 2.0,
        "proxy.voltage_age": 0.5,
        "proxy.tension_age": 0.512,
        "proxy.round_trip_time": 2e-3,
    }
    told = "link stale, age 512 ms, round trip 2.0 ms"
    assert (
        status(Moment(0.0, 1.0, -0.5, 0, link, "")) == f"0.0 s of 1 s, lag 0.0 ms, missed 0, {told}"
    )
    others = link | {
        "second.link_state": 3.0,
        "second.voltage_age": 0.1,
        "second.round_trip_time": 4e-3,
    }
    assert status(Moment(0.0, 1.0, 0.0, 0, others, "")).endswith(
        "link lost, age 512 ms, round trip 4.0 ms"
    )
    assert "link 7" in status(Moment(0.0, 1.0, 0.0, 0, {"link_state": 7.0}, ""))


@pytest.mark.parametrize(("in_place", "end"), [(True, "\x1b[K\n"), (False, "\n")])
def test_every_silence_of_a_rig_is_an_alarm_once_in_quiet_mode_as_well(in_place, end):
    written = []
    writer = SimpleNamespace(put=written.append, is_behind=False)
    line = _StatusLine(writer, in_place, np.inf)
    for silence in (0.1, 0.41, 0.6, 0.01, 0.5):
        line.look(Moment(0.0, 1.0, 0.0, 0, {"proxy.round_trip_time": silence}, ""))
    texts = [text.decode() for text in written]
    assert [re.search(r"ALARM: no answer from a rig for (.+) s:", text)[1] for text in texts] == [
        "0.4",
        "0.5",
    ]
    assert all(text.endswith(f"see that it does{end}") for text in texts)


@pytest.mark.slow
@posix
def test_a_terminal_shows_it_in_place_and_an_interrupt_leaves_a_valid_file(folder):
    code, printed, shown = on_terminal(
        "run",
        "one.toml",
        "--real-time",
        "--set",
        "duration=600",
        "--out",
        "run.nc",
        cwd=folder,
        interrupt_at=re.compile(r"1\.\d s of 600 s"),
    )
    assert code == 130, shown
    lines = [line for line in shown.replace("\r\n", "\n").split("\n") if " s of 600 s" in line]
    assert len(lines) == 1
    assert lines[0].count("\r") >= 4  # each goes over the one before
    assert re.search(
        r"\d\.\d s of 600 s, lag \d+\.\d ms, missed \d+, link stale, age \d+ ms", lines[0]
    )
    assert "wrote run.nc (incomplete)" in printed
    data = results.read(folder / "run.nc")
    assert data.attrs["complete"] == 0
    assert 1.0 <= float(data.time[-1]) < 60.0
    assert "failure" not in data.attrs
    assert not (folder / "run.nc.part.csv").exists()


@pytest.mark.slow
@posix
def test_an_interrupt_leaves_a_valid_csv(folder):
    running = started(folder, "--set", "duration=600", "--out", "run.csv")
    appears(folder / "run.csv.part.csv", b"\n0.5")
    running.send_signal(signal.SIGINT)
    printed, told = running.communicate(timeout=60)
    assert running.returncode == 130, told
    assert "wrote run.csv (incomplete)" in printed
    record = read_record(folder / "run.csv", UNITS)
    assert not any(repair.changed_data for repair in record.repairs)
    assert record.time == pytest.approx(0.01 * np.arange(record.time.size))
    assert not (folder / "run.csv.part.csv").exists()


@pytest.mark.slow
@posix
def test_a_killed_run_has_lost_its_last_seconds_only_and_the_next_does_not_overwrite_the_rest(
    folder,
):
    running = started(folder, "--set", "duration=600", "--out", "run.nc")
    journal = folder / "run.nc.part.csv"
    appears(journal, b"\n0.5")  # the first piece, of two seconds
    first = read_record(journal, UNITS).time[-1]
    time.sleep(2.5)
    running.kill()
    running.communicate(timeout=60)
    record = read_record(journal, UNITS)
    assert (
        record.time[-1] >= first + 1.9
    )  # killed 2.5 s later; the second piece came 2 s after the first
    assert record.signals["voltage_age"] == pytest.approx(record.time)
    assert not (folder / "run.nc").exists()
    refused(
        folder,
        "run",
        "one.toml",
        "--real-time",
        "--out",
        "run.nc",
        parts=["run.nc.part.csv exists", "killed"],
    )


@pytest.mark.slow
@posix
def test_a_full_disk_is_told_at_once_and_what_went_to_it_stays(folder):
    """Allow no file above 32 kB: neither journal nor result, nor that among temporary ones."""
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (32768, 32768))"
    running = started(
        folder, "--set", "duration=3", "--set", "step=0.001", "--out", "run.nc", before=limit
    )
    _, told = running.communicate(timeout=120)
    assert running.returncode == 2
    assert "Traceback" not in told
    journal = folder / "run.nc.part.csv"
    assert (
        "warning: cannot write run.nc.part.csv: File too large; from then on the record was in"
        " memory only" in told
    )
    error = (
        "error: cannot write run.nc: File too large; what went to the disk before is in"
        " run.nc.part.csv"
    )
    assert told.splitlines()[-1] == error
    assert journal.stat().st_size == 32768
    assert read_record(journal, UNITS).time.size > 500


@pytest.mark.slow
@posix
def test_a_result_that_cannot_be_written_where_it_should_is_written_elsewhere(folder):
    there = folder / "there"
    there.mkdir()
    running = started(folder, "--set", "duration=4", "--out", "there/run.nc")
    appears(there / "run.nc.part.csv", b"\n0.5")
    there.rename(folder / "moved")
    there.write_text("in the way")
    _, told = running.communicate(timeout=60)
    assert running.returncode == 2
    found = re.search(r"error: cannot write there/run.nc: .*; the record is in (.*run\.nc)", told)
    assert found, told
    data = results.read(Path(found[1]))
    assert (data.attrs["complete"], data.time.size) == (1, 401)


@pytest.mark.slow
def test_a_member_that_fails_costs_no_record(folder):
    done = in_real_time(folder, "--out", "run.nc", *FAILING)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith(
        "step from 0.5 s to 0.51 s failed (error): the rig has fallen silent"
    )
    done = here("run", "one.toml", "--out", "other.nc", *FAILING, cwd=folder)
    assert done.returncode == 2
    assert "the rig has fallen silent" in done.stderr.splitlines()[-1]
    for name in ("run.nc", "other.nc"):
        data = results.read(folder / name)
        assert data.time.values == pytest.approx(0.01 * np.arange(51))
        assert data.attrs["complete"] == 0
        assert "the rig has fallen silent" in data.attrs["failure"]


@pytest.mark.slow
def test_a_missed_deadline_ends_the_run_if_asked(folder):
    late = ["--set", "delay=0.6", "--set", "from=0.1", "--set", "until=0.105"]
    done = in_real_time(folder, "--out", "run.nc", "--missed", "stop", *late)
    assert done.returncode == 1
    assert re.search(
        r"error: deadline missed: 0\.\d+ s was reached [\d.e+]+ ms late; 10 ms are allowed",
        done.stderr,
    )
    assert results.read(folder / "run.nc").attrs["missed_deadlines"] == 1
    done = in_real_time(folder, "--out", "run.nc", "--lag", "0.3 s", *late)
    assert re.search(
        r"error: not in real time: 0\.11 s was reached 0\.\d+ s late; the lag may be 0.3 s",
        done.stderr,
    )


@pytest.mark.slow
def test_quiet_is_quiet(folder):
    done = ppy("--quiet", "run", "one.toml", "--real-time", "--set", "duration=0.2", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--missed", "stop"], ["--missed is about real time; add --real-time"]),
        (["--cpu", "0"], ["--cpu is about real time"]),
        (["--lag", "1"], ["--lag is about real time"]),
        (["--priority"], ["--priority is about real time"]),
        (["--real-time", "--missed", "never"], ["'never'", "warn, stop"]),
        (["--real-time", "--lag", "0"], ["lag 0 s: must be above 0"]),
        (["--real-time", "--cpu", "-1"], ["processor -1"]),
    ],
)
def test_options_that_make_no_sense_are_refused(folder, arguments, parts):
    refused(folder, "run", "one.toml", *arguments, parts=parts)


def test_a_fused_system_is_not_run_in_real_time(folder):
    (folder / "one.toml").write_text('system = "dma_bench"\nmaster = { method = "fused" }\n')
    refused(
        folder,
        "run",
        "one.toml",
        "--real-time",
        parts=["a fused system", "cannot be run in real time"],
    )


def test_a_rig_that_is_not_there_is_told_in_a_line(folder):
    parts = ["no answer within 2 s from tcp://127.0.0.1:9", "ppy rig serve"]
    refused(
        folder,
        "run",
        "hil_bench",
        "--runtime",
        "python",
        "--real-time",
        "--out",
        "run.nc",
        "--set",
        "proxy.endpoint=tcp://127.0.0.1:9",
        parts=parts,
    )
    assert not (folder / "run.nc.part.csv").exists()


@pytest.mark.slow
def test_a_result_of_a_system_goes_into_a_comparison_as_it_stands(folder):
    inputs = {name: (Port("proxy", name),) for name in ("current", "force")}
    outputs = {name: Port("proxy", name) for name in ("voltage", "displacement")}
    rig = System("rig", (Member.of("proxy", component("ppy_actuator")),), (), inputs, outputs)
    ssp.write(rig, folder / "rig.ssp")
    (folder / "one.toml").write_text(
        'system = "rig.ssp"\nduration = 3\nstep = 0.02\n[inputs]\nforce = 1.0\n'
        'current = { kind = "square", amplitude = 0.5, frequency = 1.0 }\n'
    )
    assert in_real_time(folder, "--out", "run.nc").returncode == 0
    done = here("compare", "run.nc", "--model", "ppy_actuator", "--json", "fits.json", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (
        "column 'proxy.voltage' is read as voltage: the only one of a member of this name"
        in done.stderr
    )
    figures = json.loads((folder / "fits.json").read_text())
    assert "100" in done.stdout
    assert set(figures["outputs"] if "outputs" in figures else figures["before"]) >= {
        "voltage",
        "displacement",
    }
