"""Cluster: two real Dask workers, each a process, come to the bits of this process."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.sweeps import cluster
from tests.support.command import ppy as command
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_pythonfmu
from tests.support.pace import slow_but

distributed = pytest.importorskip("distributed", reason="no Dask cluster without distributed")
dask = pytest.importorskip("dask")
pytestmark = pytest.mark.filterwarnings("ignore")  # what Dask thinks of its own parts
TIME = 0.1 * np.arange(51)


@pytest.fixture(scope="module")
def workers():
    with (
        dask.config.set(
            {"distributed.scheduler.allowed-failures": 1}
        ),  # of workers at a case, until it has failed
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as made,
    ):
        yield made


@pytest.mark.slow
def test_any_fmu_comes_to_the_same_bits_and_the_closed_form(lag, workers):
    call = {
        "over": {"tau": "0.1..10:37 log", "u": [1.0, -2.0]},
        "time": TIME,
        "keep": ["last", "mean", "trace"],
    }
    here, there = (
        ppy.sweep(lag, **call),
        ppy.sweep(lag, **call, scheduler=workers.scheduler_address),
    )
    assert there.identical(here)
    exact = there["u"].values * (1.0 - np.exp(-TIME[-1] / there["tau"].values[:, None]))
    assert there["x_last"].values == pytest.approx(exact, abs=1e-12)


@pytest.mark.slow
def test_compiled_code_travels_to_the_workers(workers):
    over, driven = {"R1": "0.3..0.7:37"}, {"current": np.sin(TIME)}
    here, there = (
        ppy.sweep("ppy_actuator", over, driven, time=TIME, engine="compiled", scheduler=address)
        for address in (None, workers.scheduler_address)
    )
    assert there.identical(here)


@pytest.mark.slow
def test_what_was_done_on_a_cluster_is_gone_on_with_here(lag, workers, tmp_path):
    reached = []

    def interrupt(done, whole):
        reached.append(done)
        if done >= 7:
            raise KeyboardInterrupt

    call = {"over": {"tau": "0.5..4:200"}, "inputs": {"u": 1.0}, "time": TIME}
    with pytest.raises(KeyboardInterrupt):
        ppy.sweep(
            lag,
            **call,
            folder=tmp_path / "part",
            progress=interrupt,
            scheduler=workers.scheduler_address,
        )
    seen = []
    again = ppy.sweep(
        lag, **call, folder=tmp_path / "part", progress=lambda done, whole: seen.append(done)
    )
    assert seen[0] == reached[-1] < 200
    assert again.identical(ppy.sweep(lag, **call))


@pytest.mark.slow
def test_a_case_that_ends_its_worker_fails_alone(tmp_path, workers):
    step = "    def do_step(self, current_time, step_size):\n"
    ends = "        if self.u == 3.0:\n            import os\n\n            os._exit(7)\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(step, step + ends).replace("Minimal", "Ending")
    fragile = str(build_pythonfmu(tmp_path, "ending", source))
    found = ppy.sweep(
        fragile, {"u": [1.0, 2.0, 3.0, 4.0]}, time=TIME, scheduler=workers.scheduler_address
    )
    bad = found["u"].values == 3.0
    assert "process that ran it ended" in str(found["failure"].values[bad][0])
    assert (found["failure"].values[~bad] == "").all()
    assert np.isfinite(found["x_last"].values[~bad]).all()


def unpacked(folder):
    """Return the files of FMUs anywhere in a folder."""
    return [
        path
        for path in folder.rglob("*")
        if path.suffix in (".fmu", ".so", ".xml") or "ppy-" in path.name
    ]


@pytest.mark.slow
@pytest.mark.parametrize("ends", slow_but(["by itself", "killed", "interrupted"], "killed"))
def test_nothing_that_was_unpacked_stays(lag, tmp_path, monkeypatch, ends):
    """Neither on workers that go on, nor on one that is killed, nor on one that was still busy."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))  # for the workers
    seen = []

    def watch(done, whole):
        seen.extend(unpacked(tmp_path))
        if done >= 20 and ends == "interrupted":
            raise KeyboardInterrupt
        if done >= 20 and ends == "killed" and killed:
            os.kill(killed.pop(), signal.SIGKILL)

    call = {
        "over": {"tau": "0.5..4:200"},
        "inputs": {"u": 1.0},
        "time": np.linspace(0.0, 5.0, 5001),
        "progress": watch,
    }
    with (
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            local_directory=str(tmp_path),
        ) as made,
        distributed.Client(made, set_as_default=False) as client,
    ):
        killed = [next(iter(client.run(os.getpid).values()))]
        if ends == "interrupted":
            with pytest.raises(KeyboardInterrupt):
                ppy.sweep(lag, **call, scheduler=made.scheduler_address)
        else:
            assert "failure" not in ppy.sweep(lag, **call, scheduler=made.scheduler_address)
            assert unpacked(tmp_path) == []
    assert seen, "it was there"
    assert unpacked(tmp_path) == []


@pytest.mark.slow
def test_where_there_is_no_cluster_it_is_told_in_a_line(lag):
    call = {"over": {"tau": "0.5..4:5"}, "time": TIME}
    with pytest.raises(
        UserError, match=r"scheduler='tcp://127.0.0.1:9': no scheduler answers there"
    ):
        ppy.sweep(lag, **call, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(UserError, match="of this machine"):
        ppy.sweep(lag, **call, scheduler="tcp://127.0.0.1:9", workers=2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("foo", "no address of a scheduler"),
        pytest.param("nonsense://x:1", "no address of a scheduler", marks=pytest.mark.slow),
        pytest.param("tcp://localhost", "no address of a scheduler", marks=pytest.mark.slow),
        pytest.param("tcp://localhost:99999", "no address of a scheduler", marks=pytest.mark.slow),
        pytest.param("inproc://1.2.3.4/5/6", "no address of a scheduler", marks=pytest.mark.slow),
        ("tls://127.0.0.1:9", "no certificates"),
    ],
)
def test_what_is_no_address_is_refused_before_anything_is_asked(tmp_path, address, told):
    """In a process of its own, as a half-made client complains only when it is removed.

    Had a scheduler been asked, the line would be that none answers.
    """
    call = (
        "sweep",
        "ppy_actuator",
        "--over",
        "R1=0.3,0.5",
        "--set",
        "current=0.5",
        "--stop",
        "1s",
        "--step",
        "0.1s",
    )
    done = command(*call, "--scheduler", address, cwd=tmp_path)
    assert done.returncode == 2
    (line,) = (line for line in done.stderr.splitlines() if line.startswith("error: "))
    assert f"--scheduler {address}: " in line
    assert told in line
    assert "Traceback" not in done.stderr
    assert "ignored" not in done.stderr


@pytest.mark.slow
def test_a_cluster_without_workers_is_told_in_a_line(lag, monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE", 0.5)
    with (
        distributed.LocalCluster(n_workers=0, processes=True, dashboard_address=None) as empty,
        pytest.raises(UserError, match="it has no workers"),
    ):
        ppy.sweep(lag, {"tau": "0.5..4:5"}, time=TIME, scheduler=empty.scheduler_address)
