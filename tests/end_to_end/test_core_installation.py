"""Claims: `pip install ppy-rig`, without an extra, builds, checks, simulates, sweeps and runs FMUs
and systems; every other task says in one line which extra it needs.

Oracle: processes to which the distributions of other extras are hidden.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from orchestration.records import write_record
from tests.support.command import ppy, works
from tests.support.installation import installation

# a compiler, which is the machine's or that of an extra, is no package to import
COMPILER = "native"


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of processes that have the core alone."""
    return installation(tmp_path_factory.mktemp("core"), COMPILER)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a record and a system."""
    path = tmp_path_factory.mktemp("work")
    time = 0.1 * np.arange(40)
    columns = {"current": np.sin(time), "voltage": np.cos(time)}
    write_record(path / "run.csv", time, columns, {"current": "A", "voltage": "V"})
    (path / "run.parquet").write_bytes(b"PAR1 and more, PAR1")
    (path / "run.tdms").write_bytes(b"TDSm and more")
    works("system", "export", "isotonic_stand", "--out", "stand.ssp", cwd=path)
    works("build", "pid", "--out", "fmu", cwd=path)
    return path


def test_every_name_of_python_is_there(core: dict[str, str], folder: Path) -> None:
    code = (
        "import ppy_rig as ppy, sys\n"
        "print(len([getattr(ppy, name) for name in ppy.__all__]), 'matplotlib' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **core},
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert done.stderr == ""
    count, drawn = done.stdout.split()
    assert int(count) > 15
    assert drawn == "False"


@pytest.mark.parametrize(
    ("arguments", "printed"),
    [
        (["list"], "ppy_actuator"),
        (["info", "ppy_actuator"], "displacement"),
        (["new", "component", "tank"], "tank.py"),
        (["build", "galvanostat", "--out", "made"], "made/native/galvanostat.fmu"),
        (["check", "fmu/native/pid.fmu"], "no errors"),
        (["simulate", "pid", "--stop", "1s", "--out", "pid.csv"], "wrote pid.csv"),
        (
            [
                "sweep",
                "pid",
                "--over",
                "reference=1..2:3",
                "--stop",
                "1s",
                "--out",
                "pid.nc",
            ],
            "wrote pid.nc",
        ),
        (["run", "stand.ssp", "--set", "duration=1s", "--out", "stand.nc"], "wrote stand.nc"),
        (["run", "--list"], "fig_5_9"),
        (["system", "list"], "isotonic_stand"),
        (["system", "check", "stand.ssp"], ""),
        (["export", "modelica", "pid"], "wrote modelica/PpyRig"),
        (["diagnose", "--help"], "--report"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_the_core_alone_works(
    core: dict[str, str], folder: Path, arguments: list[str], printed: str
) -> None:
    assert printed in works(*arguments, cwd=folder, environment=core)


@pytest.mark.parametrize(
    ("arguments", "extra"),
    [
        (["diagnose", "run.csv"], "diagnose"),
        (["laws", "run.csv"], "diagnose"),
        (["black-box", "run.csv", "--output", "voltage"], "diagnose"),
        (["simulate", "pid", "--stop", "1s", "--plot", "pid.png"], "pictures"),
        (["system", "draw", "stand.ssp", "--out", "stand.svg"], "pictures"),
        (["linearise", "ppy_actuator"], "linear"),
        (["thesis"], "linear"),
        (
            [
                "sweep",
                "pid",
                "--over",
                "reference=1..2",
                "--design",
                "sobol-indices",
                "--samples",
                "16",
            ],
            "sweeps",
        ),
        (["sweep", "pid", "--over", "reference=1..2:3", "--out", "pid.zarr"], "zarr"),
        (
            [
                "sweep",
                "pid",
                "--over",
                "reference=1..2:3",
                "--scheduler",
                "tcp://localhost:1",
            ],
            "cluster",
        ),
        (["simulate", "pid", "--stop", "1s", "--out", "pid.parquet"], "records"),
        (["compare", "run.parquet"], "records"),
        (["run", "run.parquet"], "records"),
        (["compare", "run.tdms"], "records"),
        (["build", "pid", "--runtime", "pythonfmu"], "pythonfmu"),
        (["rig", "serve"], "rig"),
        (["rig", "stop"], "rig"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else value,
)
def test_what_needs_an_extra_says_which(
    core: dict[str, str], folder: Path, arguments: list[str], extra: str
) -> None:
    done = ppy(*arguments, cwd=folder, environment=core)
    assert done.returncode == 2
    assert done.stdout == ""
    line = done.stderr.splitlines()[-1]  # those before it say what is being done
    assert line.startswith("error: ")
    assert line.endswith(f': pip install "ppy-rig[{extra}]"')
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(("backend", "extra"), [("nidaqmx", "nidaqmx"), ("visa", "visa")])
def test_a_rig_without_the_library_of_its_devices(
    tmp_path: Path, folder: Path, backend: str, extra: str
) -> None:
    done = ppy(
        *("rig", "serve", "--backend", backend),
        cwd=folder,
        environment=installation(tmp_path, "rig"),
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].endswith(f': pip install "ppy-rig[{extra}]"')


def test_python_says_the_line_too(core: dict[str, str], folder: Path) -> None:
    code = """
import ppy_rig as ppy

def line(call):
    try:
        call()
    except ppy.UserError as error:
        print(error)

run = ppy.simulate("pid", {"reference": 1.0}, stop=1.0)
line(run.plot)
line(lambda: ppy.linearise("ppy_actuator"))
line(lambda: ppy.black_box("run.csv", "voltage"))
line(lambda: ppy.read_record("run.parquet"))
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **core},
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert done.stderr == ""
    extras = re.findall(r'pip install "ppy-rig\[(\w+)\]"$', done.stdout, re.M)
    assert extras == ["pictures", "linear", "diagnose", "records"]
