"""Claims: a case that is there twice is run once; a full disk is told in a line and costs nothing that was done."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.repeated import RepeatedFmu
from tests.support import misbehaving
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_one_state_fmu, build_pythonfmu
from tests.support.small_disk import disk_of_64_kib
from tests.support.source import ROOT

TIME = 0.1 * np.arange(51)


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    return str(build_one_state_fmu(tmp_path_factory.mktemp("lag")))


@pytest.fixture
def small_disk(tmp_path):
    with disk_of_64_kib(tmp_path / "disk") as folder:
        yield folder


def test_a_small_disk_goes_with_the_process_that_has_it(tmp_path):
    """Killed, it unmounts nothing itself."""
    program = (
        "import sys, time, pathlib; from tests.support.small_disk import disk_of_64_kib\n"
        "with disk_of_64_kib(pathlib.Path(sys.argv[1])): print('there', flush=True); time.sleep(60)"
    )
    folder = tmp_path / "disk"
    with subprocess.Popen(
        [sys.executable, "-c", program, folder], cwd=ROOT, stdout=subprocess.PIPE
    ) as running:
        if running.stdout.readline() != b"there\n":
            pytest.skip("this user may not mount a file system")
        assert os.path.ismount(folder)
        running.kill()
    until = time.monotonic() + 10.0
    while os.path.ismount(folder) and time.monotonic() < until:
        time.sleep(0.05)
    assert not os.path.ismount(folder)


def ran(monkeypatch):
    """Count runs."""
    counted, known = [], RepeatedFmu.run
    monkeypatch.setattr(RepeatedFmu, "run", lambda *given: counted.append(1) or known(*given))
    return counted


def test_a_case_that_is_there_twice_is_run_once(lag, monkeypatch):
    counted = ran(monkeypatch)
    taus, levels = [1.0, 2.0, 1.0, 1.0, 2.0], [1.0, 1.0, 1.0, 3.0, 1.0]
    told = []
    found = ppy.sweep(
        lag,
        {"tau": taus, "u": levels},
        time=TIME,
        kind="list",
        keep=["last", "trace"],
        progress=lambda done, whole: told.append((done, whole)),
    )
    assert len(counted) == 3
    assert told[-1] == (5, 5)
    exact = np.array(levels)[:, None] * (1.0 - np.exp(-TIME / np.array(taus)[:, None]))
    assert found["x"].values == pytest.approx(exact, abs=1e-12)
    assert found["x_last"].values == pytest.approx(exact[:, -1], abs=1e-12)


def test_of_a_case_that_is_there_twice_one_may_be_done(lag, tmp_path, monkeypatch):
    """An end between what is written of the two."""
    call = {
        "over": {"tau": [1.0, 1.0, 2.0, 1.0]},
        "inputs": {"u": 1.0},
        "time": TIME,
        "kind": "list",
    }
    ppy.sweep(lag, **call, folder=tmp_path / "part")
    for name, nothing in (("done", 0), ("numbers", np.nan)):
        array = np.lib.format.open_memmap(tmp_path / "part" / f"{name}.npy", "r+")
        array[1:] = nothing
        array.flush()
    counted = ran(monkeypatch)
    again = ppy.sweep(lag, **call, folder=tmp_path / "part")
    assert len(counted) == 2
    assert again.identical(ppy.sweep(lag, **call))


def test_a_sweep_that_has_no_room_is_refused_before_anything_runs(lag, small_disk, monkeypatch):
    """Its arrays are mapped: what does not fit would end the process as it is written."""
    counted = ran(monkeypatch)
    call = {"inputs": {"u": 1.0}, "time": TIME, "keep": ["trace"]}
    with pytest.raises(
        UserError, match=r"part: cannot be written \(No space left on device\)"
    ) as refused:
        ppy.sweep(lag, {"tau": "0.5..4:400"}, **call, folder=small_disk / "part")
    assert "\n" not in str(refused.value)
    assert counted == []
    found = ppy.sweep(lag, {"tau": "0.5..4:20"}, **call, folder=small_disk / "part")
    assert found["x"].shape == (20, 51)


def test_a_disk_that_fills_while_cases_fail_loses_nothing(tmp_path, small_disk):
    """Reasons of failures are all that grows; what was done before is there afterwards."""
    step = "    def do_step(self, current_time, step_size):\n"
    refuses = "        if self.u >= 5.0:\n            return False\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(step, step + refuses).replace("Minimal", "Refusing")
    fragile = str(build_pythonfmu(tmp_path, "refusing", source))

    def fill(done, whole):
        if done >= 5:
            with (
                (small_disk / "other").open("wb", buffering=0) as file,
                contextlib.suppress(OSError),
            ):
                while True:
                    file.write(bytes(512))

    # Python FMUs of one name share a module in a process, so that this one has a name of its own
    call = {"over": {"u": "1..200:200"}, "time": TIME[:3], "keep": ["last"]}
    with pytest.raises(UserError, match=r"No space left on device\); what is done stands there"):
        ppy.sweep(fragile, **call, folder=small_disk / "part", progress=fill)
    (small_disk / "other").unlink()
    seen = []
    again = ppy.sweep(
        fragile, **call, folder=small_disk / "part", progress=lambda done, whole: seen.append(done)
    )
    assert seen[0] > 5
    assert again.identical(ppy.sweep(fragile, **call))


def test_an_fmu_in_processes_of_its_own_comes_to_the_same_bits(lag):
    call = {
        "over": {"tau": "0.5..4:23"},
        "inputs": {"u": np.sin(TIME)},
        "time": TIME,
        "keep": ["last", "mean", "trace"],
    }
    here = ppy.sweep(lag, **call)
    for workers in (1, 2):
        assert ppy.sweep(lag, **call, isolate=True, workers=workers).identical(here)
    assert ppy.sweep(lag, **call, isolate=None).identical(here), "it is a file that somebody gave"


@pytest.mark.parametrize(
    ("act", "told"),
    [
        ("exits", "step from 1 s: its process ended (exit status 0)"),
        ("sleeps", "step from 1 s: no answer within 1 s"),
    ],
)
def test_a_case_of_an_fmu_that_harms_its_process_fails_in_a_line(act, told, tmp_path):
    bad = str(misbehaving.build(act, tmp_path))
    found = ppy.sweep(
        bad,
        {"tau": [1.0, 2.0]},
        {"u": 1.0},
        time=TIME,
        isolate=True,
        limits=Limits(step_timeout=1.0),
    )
    assert found["failure"].values.tolist() == 2 * [f"{act}.fmu: {told}"]
    short = ppy.sweep(bad, {"tau": [1.0, 2.0]}, {"u": 1.0}, time=TIME[:9], isolate=True)
    assert short["x_last"].values == pytest.approx(
        1.0 - np.exp(-TIME[8] / np.array([1.0, 2.0])), abs=1e-12
    )
    assert "failure" not in short


def test_an_fmu_that_cannot_be_opened_in_a_process_of_its_own_is_told_in_a_line(tmp_path):
    bad = str(misbehaving.build("crashes_as_it_begins", tmp_path))
    with pytest.raises(
        UserError, match=r"^crashes_as_it_begins\.fmu: loading: its process was ended by SIGSEGV$"
    ):
        ppy.sweep(bad, {"tau": [1.0, 2.0]}, {"u": 1.0}, time=TIME, isolate=True)
