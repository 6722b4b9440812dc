"""Local workers: the same bits in any number of processes, whatever becomes of a worker."""

from __future__ import annotations

import os
import signal
from concurrent.futures import Future
from types import SimpleNamespace

import numpy as np
import pytest

import orchestration as ppy
from fmus.kit import UserError
from orchestration.fmu.isolation.limits import Limits
from orchestration.fmu.isolation.process import Ended
from orchestration.fmu.isolation.shared_progress import ProgressState
from orchestration.sweeps.chunking import Chunks
from orchestration.sweeps.local_workers import _run_in_parallel
from orchestration.sweeps.task import Outcomes
from tests.support import misbehaving
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_pythonfmu
from tests.support.processes import children, of_fmus

TIME = 0.1 * np.arange(51)


@pytest.fixture(scope="module")
def fragile(tmp_path_factory):
    """Return an FMU whose process ends at an input of 3, and that refuses a step at 5."""
    step = "    def do_step(self, current_time, step_size):\n"
    ends = "        if self.u == 3.0:\n            import os\n\n            os._exit(7)\n"
    refuses = "        if self.u == 5.0:\n            return False\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(step, step + ends + refuses).replace(
        "Minimal", "Fragile"
    )
    return str(build_pythonfmu(tmp_path_factory.mktemp("fragile"), "fragile", source))


def test_several_workers_come_to_the_same_bits(lag):
    over, driven = {"tau": "0.1..10:37 log"}, {"u": np.sin(TIME)}
    one, two = (ppy.sweep(lag, over, driven, time=TIME, workers=n) for n in (1, 2))
    assert one.identical(two)


def test_workers_end_with_an_interrupt(lag):
    before = children()

    def interrupt(done, whole):
        if done >= 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ppy.sweep(
            lag,
            {"tau": "0.5..4:4000"},
            {"u": 1.0},
            time=np.linspace(0.0, 5.0, 5001),
            workers=2,
            progress=interrupt,
        )
    assert children() <= before


def test_a_chunk_whose_worker_ends_is_halved_until_the_case_is_alone():
    """Of workers that end at a case of 3; every other case has an outcome, and has it once."""
    source = SimpleNamespace(points=lambda time: time, name="fragile.fmu")
    task = SimpleNamespace(time=TIME, outputs=("x",), keep=("last",), source=source)
    cases = np.arange(8.0)[:, np.newaxis]

    def submit(values):
        future = Future()
        if 3.0 in values:
            future.set_exception(Ended("it ended", ProgressState("step", 0, 0, (0, 0, 0))))
        else:
            numbers = values[:, :, np.newaxis]
            future.set_result(Outcomes(numbers, np.empty((len(values), 0, 1)), {}))
        return future

    chunks = Chunks(task, range(8))
    for _ in range(2):  # until one has four of the cases
        chunks.adapt(4, 1e-9)
    found = list(_run_in_parallel(submit, task, cases, chunks, 1))
    assert max(len(rows) for rows, _ in found) > 1
    numbers = {
        row: number
        for rows, outcomes in found
        for row, number in zip(rows, outcomes.numbers[:, 0, 0].tolist(), strict=True)
    }
    assert sorted(row for rows, _ in found for row in rows) == list(range(8))
    assert np.isnan(numbers.pop(3))
    assert numbers == {row: float(row) for row in range(8) if row != 3}


@pytest.mark.slow
def test_a_killed_worker_costs_nothing(lag):
    """Another worker does what it was doing."""
    killed = []

    def kill(done, whole):
        if done >= 40 and not killed:
            child = of_fmus()[0]
            killed.append(child.pid)
            os.kill(child.pid, signal.SIGKILL)

    over = {"tau": "0.1..10:400 log"}
    found = ppy.sweep(lag, over, {"u": 1.0}, time=TIME, workers=2, progress=kill)
    assert killed
    assert "failure" not in found
    assert found.identical(ppy.sweep(lag, over, {"u": 1.0}, time=TIME))


@pytest.mark.slow
def test_a_case_that_ends_its_process_fails_alone(fragile):
    found = ppy.sweep(fragile, {"u": [1.0, 2.0, 3.0, 4.0, 6.0, 7.0]}, time=TIME, workers=2)
    bad = found["u"].values == 3.0
    assert "step from 0 s: its process ended (exit status 7)" in str(
        found["failure"].values[bad][0]
    )
    assert (found["failure"].values[~bad] == "").all()
    assert np.isnan(found["x_last"].values[bad]).all()
    growth = 1.0 - 0.9 ** (len(TIME) - 1)  # Euler's method with a tenth of the time constant
    assert found["x_last"].values[~bad] == pytest.approx(found["u"].values[~bad] * growth)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_case_that_is_refused_says_why_and_the_others_go_on(fragile, workers):
    found = ppy.sweep(fragile, {"u": [1.0, 5.0, 2.0]}, time=TIME, workers=workers)
    told = found["failure"].values
    assert told[0] == told[2] == ""
    assert "Fragile.fmu: asks to end the simulation in place of a step from 0 s" in told[1]
    assert np.isfinite(found["x_last"].values).tolist() == [True, False, True]


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_an_fmu_that_cannot_be_opened_in_a_process_of_its_own_is_told_in_a_line(tmp_path):
    bad = str(misbehaving.build("crashes_as_it_begins", tmp_path))
    with pytest.raises(
        UserError, match=r"^crashes_as_it_begins\.fmu: loading: its process was ended by SIGSEGV$"
    ):
        ppy.sweep(bad, {"tau": [1.0, 2.0]}, {"u": 1.0}, time=TIME, isolate=True)
