"""Execution of sweeps of FMUs, interrupted or not.

Oracles: traces in closed form; the same sweep without an interrupt, bit by bit.
"""

from __future__ import annotations

import os
import signal
import tempfile
from dataclasses import replace

import numpy as np
import pytest
import xarray

import orchestration as ppy
from fmus.kit import UserError
from orchestration.fmu.simulation import RepeatedFmu
from orchestration.sweeps import execution as run
from tests.support.processes import of_fmus

TIME = 0.1 * np.arange(51)


def test_numbers_and_courses_are_those_of_the_closed_form(lag):
    taus, levels = np.array([0.5, 1.0, 4.0]), np.array([1.0, -2.0])
    found = ppy.sweep(
        lag, {"tau": taus, "u": levels}, time=TIME, keep=["last", "mean", "largest", "trace"]
    )
    exact = levels[None, :, None] * (1.0 - np.exp(-TIME / taus[:, None, None]))
    assert found["x"].dims == ("tau", "u", "time")
    assert found["x"].values == pytest.approx(exact, abs=1e-12)
    assert found["x_last"].values == pytest.approx(exact[..., -1], abs=1e-12)
    assert found["x_mean"].values == pytest.approx(exact.mean(axis=2), abs=1e-12)
    assert found["x_largest"].values == pytest.approx(exact.max(axis=2), abs=1e-12)
    assert found["tau"].values.tolist() == taus.tolist()


def test_a_case_is_as_if_it_were_alone(lag):
    """An instance that is reset remembers nothing, in any order of cases."""
    several = ppy.sweep(lag, {"tau": [4.0, 0.5, 1.0]}, {"u": 1.0}, time=TIME, keep=["trace"])
    for tau in (0.5, 1.0, 4.0):
        alone = ppy.simulate(lag, {"u": 1.0}, time=TIME, settings={"tau": tau})["x"]
        assert several["x"].sel(tau=tau).values.tolist() == alone.tolist()


def test_units_and_words_go_with_the_numbers():
    found = ppy.sweep(
        "ppy_actuator", {"R1": "300mohm..0.7:2"}, {"current": 0.5}, stop=1.0, step=0.1
    )
    assert (found["voltage_last"].units, found["R1"].units) == ("V", "ohm")
    assert found["R1"].long_name
    assert found.attrs["design"] == "grid"


def test_a_sampled_design_has_its_cases_beside_it(lag):
    found = ppy.sweep(
        lag, {"tau": "0.5..4", "u": "-1..1"}, time=TIME, kind="sobol", samples=16, seed=2
    )
    exact = found["u"].values * (1.0 - np.exp(-TIME[-1] / found["tau"].values))
    assert found["x_last"].dims == ("case",)
    assert found["x_last"].values == pytest.approx(exact, abs=1e-12)


def test_what_was_done_is_not_done_again(lag, tmp_path):
    """After an interrupt the same call goes on, and comes to the result of an uninterrupted one."""
    seen: list[int] = []

    def interrupt(done, whole):
        seen.append(done)
        if done >= 7:
            raise KeyboardInterrupt

    call = {
        "over": {"tau": "0.5..4:20"},
        "inputs": {"u": 1.0},
        "time": TIME,
        "keep": ["last", "trace"],
    }
    with pytest.raises(KeyboardInterrupt):
        ppy.sweep(lag, **call, folder=tmp_path / "part", progress=interrupt)
    done = seen[-1]
    seen.clear()
    again = ppy.sweep(
        lag, **call, folder=tmp_path / "part", progress=lambda done, whole: seen.append(done)
    )
    assert (seen[0], seen[-1]) == (done, 20), "from there on"
    assert again.identical(ppy.sweep(lag, **call))
    seen.clear()
    ppy.sweep(lag, **call, folder=tmp_path / "part", progress=lambda done, whole: seen.append(done))
    assert seen == [20], "all of it stands there"


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ({"over": {"tau": "0.5..4:21"}}, "the cases"),
        ({"inputs": {"u": 2.0}}, "settings and inputs"),
        ({"keep": ["mean"]}, "what is kept"),
    ],
)
def test_a_folder_of_another_sweep_is_refused(lag, tmp_path, other, told):
    def interrupt(done, whole):
        if done >= 3:
            raise KeyboardInterrupt

    call = {"over": {"tau": "0.5..4:20"}, "inputs": {"u": 1.0}, "time": TIME}
    with pytest.raises(KeyboardInterrupt):
        ppy.sweep(lag, **call, folder=tmp_path / "part", progress=interrupt)
    with pytest.raises(UserError, match=told):
        ppy.sweep(lag, **(call | other), folder=tmp_path / "part")


def test_another_fmu_is_refused(lag, tmp_path):
    def interrupt(done, whole):
        if done >= 3:
            raise KeyboardInterrupt

    call = {
        "over": {"tau": "0.5..4:20"},
        "inputs": {"u": 1.0},
        "time": TIME,
        "folder": tmp_path / "part",
    }
    model = ppy.find_model(lag)
    with pytest.raises(KeyboardInterrupt):
        ppy.sweep(model, **call, progress=interrupt)
    (tmp_path / "part" / "work.json").write_text(
        (tmp_path / "part" / "work.json").read_text().replace('"the FMU": "', '"the FMU": "another')
    )
    with pytest.raises(UserError, match="not the same: the FMU"):
        ppy.sweep(replace(model), **call)


@pytest.fixture
def interrupted(lag, tmp_path):
    """Interrupt a sweep after a few cases, and return the call that goes on with it."""

    def interrupt(done, whole):
        if done >= 3:
            raise KeyboardInterrupt

    call = {
        "over": {"tau": "0.5..4:20"},
        "inputs": {"u": 1.0},
        "time": TIME,
        "folder": tmp_path / "part",
    }
    with pytest.raises(KeyboardInterrupt):
        ppy.sweep(lag, **call, progress=interrupt)
    return call


@pytest.mark.parametrize(
    ("name", "contents"),
    [("work.json", b"{"), ("numbers.npy", b"none"), ("failures.jsonl", b"none\n")],
)
def test_a_damaged_folder_is_refused_in_a_line(lag, interrupted, name, contents):
    (interrupted["folder"] / name).write_bytes(contents)
    with pytest.raises(UserError, match=r"part: is damaged .*remove it") as refused:
        ppy.sweep(lag, **interrupted)
    assert "\n" not in str(refused.value)


def test_a_line_that_was_not_written_to_its_end_does_no_harm(lag, interrupted):
    path = interrupted["folder"] / "failures.jsonl"
    path.write_text('[0, "refused"]\n[7, "ref', encoding="utf-8")
    told = ppy.sweep(lag, **interrupted)["failure"].values.tolist()
    assert told == ["refused"] + 19 * [""]
    assert path.read_text(encoding="utf-8") == '[0, "refused"]\n'


@pytest.mark.parametrize("kills", [False, True])
def test_nothing_that_was_unpacked_stays(lag, tmp_path, monkeypatch, kills):
    """Not of workers that end by themselves either."""

    def kill(done, whole):
        if kills and done == 1:
            os.kill(of_fmus()[0].pid, signal.SIGKILL)

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # for the processes
    over = {"tau": "0.5..4:40"}
    ppy.sweep(lag, over, {"u": 1.0}, time=TIME, workers=2, engine="fmu", progress=kill)
    assert list(tmp_path.iterdir()) == []


def test_there_are_no_more_workers_than_cases(lag, monkeypatch):
    asked, known = [], run.run_cases
    monkeypatch.setattr(
        run,
        "run_cases",
        lambda task, cases, which, count: asked.append(count) or known(task, cases, which, count),
    )
    call = {"over": {"tau": [1.0, 2.0]}, "inputs": {"u": 1.0}, "time": TIME}
    assert ppy.sweep(lag, **call, workers=1000).identical(ppy.sweep(lag, **call))
    assert asked == [2, 1]
    for count in (0, 1001):
        with pytest.raises(UserError, match=rf"workers {count}: from 1 to 1,000"):
            ppy.sweep(lag, **call, workers=count)


@pytest.mark.parametrize(
    ("call", "told"),
    [
        ({"over": {"tau": "1..2:3"}, "settings": {"tau": 1.0}}, "swept, and set"),
        ({"over": {"u": "1..2:3"}, "inputs": {"u": 1.0}}, "swept, and set"),
        ({"over": {"tau": "1..2:3"}, "outputs": ["y"]}, "no output named 'y'"),
        ({"over": {"tau": "1..2:3"}, "keep": ["nothing"]}, "no such reduction; there are"),
        ({"over": {"tau": "1..2:3"}, "keep": []}, "names nothing"),
        ({"over": {"tau": "1..2:3"}, "workers": 0}, "workers 0: from 1"),
    ],
)
def test_what_does_not_fit_is_told_before_anything_runs(lag, call, told):
    with pytest.raises(UserError, match=told):
        ppy.sweep(lag, **call)


def test_the_dataset_can_be_written_and_read(lag, tmp_path):
    found = ppy.sweep(lag, {"tau": "0.5..4:5"}, {"u": 1.0}, time=TIME, keep=["last", "trace"])
    found.to_netcdf(tmp_path / "sweep.nc", engine="scipy")
    read = xarray.load_dataset(tmp_path / "sweep.nc", engine="scipy")
    assert read["x"].values.tolist() == found["x"].values.tolist()
    assert read["tau"].values.tolist() == found["tau"].values.tolist()


def ran(monkeypatch):
    """Count runs of the FMU."""
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
    """The process may end between the two of them being written."""
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
