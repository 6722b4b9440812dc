"""Sweeps of FMUs. Oracle: courses in closed form; what is interrupted or killed comes to the same, bit by bit."""

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
from orchestration.sweeps import run
from tests.support.hosts import MINIMAL_PYTHONFMU_SOURCE, build_one_state_fmu, build_pythonfmu
from tests.support.processes import children, of_fmus

TIME = 0.1 * np.arange(51)


@pytest.fixture(scope="module")
def lag(tmp_path_factory):
    """A foreign FMU: ``tau dx/dt = u - x`` from nothing, exact for inputs that are held."""
    return str(build_one_state_fmu(tmp_path_factory.mktemp("lag")))


@pytest.fixture(scope="module")
def fragile(tmp_path_factory):
    """An FMU whose process ends where its input is 3, and that refuses a step where it is 5."""
    step = "    def do_step(self, current_time, step_size):\n"
    ends = "        if self.u == 3.0:\n            import os\n\n            os._exit(7)\n"
    refuses = "        if self.u == 5.0:\n            return False\n"
    source = MINIMAL_PYTHONFMU_SOURCE.replace(step, step + ends + refuses).replace(
        "Minimal", "Fragile"
    )
    return str(build_pythonfmu(tmp_path_factory.mktemp("fragile"), "fragile", source))


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
    """An instance that is reset has forgotten what was before, in whatever order."""
    several = ppy.sweep(lag, {"tau": [4.0, 0.5, 1.0]}, {"u": 1.0}, time=TIME, keep=["trace"])
    for tau in (0.5, 1.0, 4.0):
        alone = ppy.simulate(lag, {"u": 1.0}, time=TIME, settings={"tau": tau})["x"]
        assert several["x"].sel(tau=tau).values.tolist() == alone.tolist()


def test_several_workers_come_to_the_same_bits(lag):
    over, driven = {"tau": "0.1..10:37 log"}, {"u": np.sin(TIME)}
    one, two = (ppy.sweep(lag, over, driven, time=TIME, workers=n) for n in (1, 2))
    assert one.identical(two)


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
    """After an interrupt the same call goes on, and comes to the same as one that was not interrupted."""
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
    (tmp_path / "part" / "sweep.json").write_text(
        (tmp_path / "part" / "sweep.json")
        .read_text()
        .replace('"the FMU": "', '"the FMU": "another')
    )
    with pytest.raises(UserError, match="the FMU differ"):
        ppy.sweep(replace(model), **call)


@pytest.fixture
def interrupted(lag, tmp_path):
    """A sweep that was interrupted after a few cases, and what goes on with it."""

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
    [("sweep.json", b"{"), ("numbers.npy", b"none"), ("failures.jsonl", b"none\n")],
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
    asked, known = [], run.outcomes
    monkeypatch.setattr(
        run,
        "outcomes",
        lambda task, cases, which, count: asked.append(count) or known(task, cases, which, count),
    )
    call = {"over": {"tau": [1.0, 2.0]}, "inputs": {"u": 1.0}, "time": TIME}
    assert ppy.sweep(lag, **call, workers=1000).identical(ppy.sweep(lag, **call))
    assert asked == [2, 1]
    for count in (0, 1001):
        with pytest.raises(UserError, match=rf"workers {count}: from 1 to 1,000"):
            ppy.sweep(lag, **call, workers=count)


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


def test_a_killed_worker_costs_nothing(lag):
    """Whatever it was doing is done by another one."""
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
    assert "Fragile.fmu: step from 0 s failed (discard)" in told[1]
    assert np.isfinite(found["x_last"].values).tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("call", "told"),
    [
        ({"over": {"tau": "1..2:3"}, "settings": {"tau": 1.0}}, "swept, and set"),
        ({"over": {"u": "1..2:3"}, "inputs": {"u": 1.0}}, "swept, and set"),
        ({"over": {"tau": "1..2:3"}, "outputs": ["y"]}, "no output named 'y'"),
        ({"over": {"tau": "1..2:3"}, "keep": ["median"]}, "no such reduction"),
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
