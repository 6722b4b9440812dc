"""Claims: ``ppy sweep`` writes what is wanted, goes on after an interrupt, refuses in a line."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
import xarray

import orchestration as ppy_rig
from fmus.kit.errors import UserError
from orchestration.cli.app import main
from orchestration.experiment import results
from orchestration.sweeps import execution as run
from tests.support.command import here, on_terminal, refused, works
from tests.support.hosts import build_one_state_fmu
from tests.support.misbehaving import build


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    build_one_state_fmu(folder)
    return folder


CALL = ("sweep", "one_state.fmu", "--set", "u=2", "--stop", "5s", "--step", "0.1s")


def test_numbers_with_units_and_a_picture(folder):
    said = works(*CALL, "--over", "tau=0.5..2:4", "--out", "a.nc", "--plot", "a.png", cwd=folder)
    assert "4 cases" in said
    found = xarray.load_dataset(folder / "a.nc", engine="scipy")
    assert found["x_last"].values == pytest.approx(
        2.0 * (1.0 - np.exp(-5.0 / np.array([0.5, 1.0, 1.5, 2.0])))
    )
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    assert not (folder / "a.nc.part").exists()


def test_a_page_is_written_beside_the_rest(folder):
    said = works(*CALL, "--over", "tau=0.5..2:4", "--report", "a.html", cwd=folder)
    assert "wrote a.html" in said
    text = (folder / "a.html").read_text(encoding="utf-8")
    assert re.search("<h1>.* goes from .* to .* over 4 cases.</h1>", text)
    assert "--report a.txt" in refused(folder, *CALL, "--over", "tau=1..2:2", "--report", "a.txt")


@pytest.mark.slow
def test_interrupted_it_goes_on(folder):
    call = [*CALL, "--over", "tau=0.5..2:4000", "--step", "0.01s", "--out", "b.nc"]
    (folder / "scratch").mkdir(exist_ok=True)
    code, _, _ = on_terminal(*call, cwd=folder, interrupt_at=re.compile(r"\d of 4,000"))
    assert code == 130
    assert (folder / "b.nc.part").is_dir()
    assert not (folder / "b.nc").exists()
    works(*call, cwd=folder)
    found = xarray.load_dataset(folder / "b.nc", engine="scipy")
    assert found["x_last"].values == pytest.approx(2.0 * (1.0 - np.exp(-5.0 / found["tau"].values)))


@pytest.mark.slow
def test_workers_are_silent_where_a_sweep_is_interrupted(folder):
    call = [
        *CALL,
        "--over",
        "tau=0.5..2:4000",
        "--step",
        "0.01s",
        "--workers",
        "2",
        "--out",
        "d.nc",
    ]
    (folder / "scratch").mkdir(exist_ok=True)
    code, _, told = on_terminal(*call, cwd=folder, interrupt_at=re.compile(r"[1-9]\d* of 4,000"))
    assert code == 130
    assert "Traceback" not in told


def test_a_file_that_cannot_be_written_loses_nothing(folder, monkeypatch):
    def full(data, path):
        raise UserError(f"{path}: no space left on device")

    monkeypatch.chdir(folder)
    monkeypatch.setattr(results, "write", full)
    monkeypatch.setattr(sys, "argv", ["ppy", *CALL, "--over", "tau=0.5..2:4", "--out", "e.nc"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert (folder / "e.nc.part").is_dir()
    monkeypatch.undo()
    works(*CALL, "--over", "tau=0.5..2:4", "--out", "e.nc", cwd=folder)
    assert (folder / "e.nc").exists()


def test_what_a_preset_sets_can_be_swept(tmp_path):
    call = ("sweep", "ppy_actuator", "--preset", "five_layer", "--stop", "1s", "--step", "0.1s")
    works(
        *call,
        "--over",
        "R1=1,2",
        "--set",
        "current=0.5",
        "--outputs",
        "voltage",
        "--out",
        "f.nc",
        cwd=tmp_path,
    )
    found = xarray.load_dataset(tmp_path / "f.nc", engine="scipy")["voltage_last"].values
    for resistance, last in zip((1.0, 2.0), found, strict=True):
        alone = (
            "simulate",
            *call[1:],
            "--set",
            f"R1={resistance}",
            "--set",
            "current=0.5",
            "--out",
            "g.nc",
        )
        works(*alone, cwd=tmp_path)
        assert float(xarray.load_dataset(tmp_path / "g.nc", engine="scipy")["voltage"][-1]) == last


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--over", "tau=2..1:4"], "a range goes up"),
        (["--over", "tao=1..2:4"], "did you mean tau"),
        (["--over", "tau"], "write name=from..to:count"),
        (["--over", "tau=1..2:3", "--over", "tau=1..2:3"], "names tau twice"),
        (["--over", "tau=1..2:3", "--out", "c.csv"], ".nc"),
        (["--over", "tau=1..2:3", "--outputs", "y"], "no output named 'y'"),
        (["--over", "u=1..2:3"], "swept, and set"),
        (
            ["--over", "tau=1..2:3", "--keep", "trace", "--plot", "c.png"],
            "numbers are drawn over parameters",
        ),
        (
            ["--over", "tau=1..2:3", "--keep", "last,last"],
            "--keep 'last,last': last is named twice",
        ),
        (
            ["--over", "tau=1..2:3", "--outputs", "x,,x"],
            "--outputs 'x,,x': there is nothing before or after a comma",
        ),
        ([], "--over"),
    ],
)
def test_it_refuses_in_a_line(folder, arguments, told):
    done = here(*CALL, *arguments, cwd=folder)
    assert done.returncode == 2
    assert told in done.stderr.replace("\n", " ")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--keep", "trace", "--plot", "c.png"], "numbers are drawn over parameters"),
        (["--design", "draws", "--keep", "last", "--plot", "c.png"], "bands are drawn over time"),
        (["--keep", "trace", "--out", "c.nc", "--step", "0.000005s"], "8 GB of traces"),
        (["--keep", "trace", "--step", "0.000005s"], "8 GB of traces"),
    ],
)
def test_it_refuses_before_any_work(folder, arguments, told, monkeypatch):
    """Pictures that cannot be drawn and parameters that do not fit are known beforehand."""
    monkeypatch.setattr(run, "run_cases", lambda *given: pytest.fail("a case was run"))
    refused(folder, *CALL, "--over", "tau=1..2:1000", *arguments, parts=[told])
    assert not (folder / "c.nc.part").exists()


def test_in_python_what_does_not_fit_into_memory_is_refused_too(folder, monkeypatch):
    monkeypatch.setattr(run, "run_cases", lambda *given: pytest.fail("a case was run"))
    call = {"time": np.linspace(0.0, 5.0, 1_000_001), "keep": ["trace"]}
    with pytest.raises(
        UserError, match=r"8 GB of traces, too large .*4 GB.*such as folder='traces"
    ):
        ppy_rig.sweep(str(folder / "one_state.fmu"), {"tau": "1..2:1000"}, **call)


def test_a_sweep_of_which_nothing_could_be_run_is_no_success(tmp_path):
    build("writes_to_nothing", tmp_path)
    call = [
        "sweep",
        "writes_to_nothing.fmu",
        "--set",
        "u=1",
        "--stop",
        "3s",
        "--step",
        "0.1s",
        "--over",
        "tau=0.5,1,2",
    ]
    said = here(*call, "--out", "x.nc", cwd=tmp_path)
    assert said.returncode == 2
    assert said.stderr.splitlines()[-1] == "error: not one of the 3 cases could be run"
    found = xarray.load_dataset(tmp_path / "x.nc", engine="scipy")
    assert all("SIGSEGV" in str(why) for why in found["failure"].values)
