"""Claims: `pip install ppy-rig`, without an extra, builds, checks, simulates, sweeps and runs FMUs
and systems; every other task says in one line which extra it needs.

Oracle: processes to which the distributions of other extras are hidden.
"""

from __future__ import annotations

import os
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
    """A folder with records, of which two are of formats that the core does not read."""
    path = tmp_path_factory.mktemp("work")
    time = 0.1 * np.arange(40)
    columns = {"current": np.sin(time), "voltage": np.cos(time)}
    write_record(path / "run.csv", time, columns, {"current": "A", "voltage": "V"})
    (path / "run.parquet").write_bytes(b"PAR1 and more, PAR1")
    (path / "run.tdms").write_bytes(b"TDSm and more")
    return path


@pytest.fixture(scope="module")
def stand(folder: Path) -> Path:
    """A system with its FMUs."""
    works("system", "export", "isotonic_stand", "--out", "stand.ssp", cwd=folder)
    return folder / "stand.ssp"


@pytest.fixture(scope="module")
def pid(folder: Path) -> Path:
    """An FMU."""
    works("build", "pid", "--out", "fmu", cwd=folder)
    return folder / "fmu" / "native" / "pid.fmu"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "printed"),
    [
        (["list"], "ppy_actuator"),
        (["info", "ppy_actuator"], "displacement"),
        (["new", "component", "tank"], "tank.py"),
        (["build", "galvanostat", "--out", "made"], "made/native/galvanostat.fmu"),
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
        (["run", "--list"], "fig_5_9"),
        (["system", "list"], "isotonic_stand"),
        (["export", "modelica", "pid"], "wrote modelica/PpyRig"),
        (["diagnose", "--help"], "--report"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_the_core_alone_works(
    core: dict[str, str], folder: Path, arguments: list[str], printed: str
) -> None:
    assert printed in works(*arguments, cwd=folder, environment=core)


@pytest.mark.slow
def test_an_fmu_is_checked(core: dict[str, str], folder: Path, pid: Path) -> None:
    assert "no errors" in works("check", pid, cwd=folder, environment=core)


@pytest.mark.slow
def test_a_system_is_checked(core: dict[str, str], folder: Path, stand: Path) -> None:
    works("system", "check", stand, cwd=folder, environment=core)


@pytest.mark.slow
def test_a_system_is_run(core: dict[str, str], folder: Path, stand: Path) -> None:
    arguments = ("run", stand, "--set", "duration=1s", "--out", "run.nc", "--no-isolate")
    assert "wrote run.nc" in works(*arguments, cwd=folder, environment=core)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "extra"),
    [
        pytest.param(["diagnose", "run.csv"], "diagnose", marks=pytest.mark.slow),
        pytest.param(["laws", "run.csv"], "diagnose", marks=pytest.mark.slow),
        (["black-box", "run.csv", "--output", "voltage"], "diagnose"),
        (["simulate", "pid", "--stop", "1s", "--plot", "pid.png"], "pictures"),
        (["system", "draw", "isotonic_stand", "--out", "stand.svg"], "pictures"),
        (["linearise", "ppy_actuator"], "linear"),
        (["design", "ppy_actuator"], "linear"),
        (["thesis"], "linear,pictures"),
        (["demo"], "diagnose,linear,pictures"),
        (["rig", "demo"], "diagnose,pictures,rig"),
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
        (["rig", "opcua"], "opcua,rig"),
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


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["nidaqmx", "visa", "serial", "modbus"])
def test_a_rig_without_the_library_of_its_devices(
    tmp_path: Path, folder: Path, backend: str
) -> None:
    done = ppy(
        *("rig", "serve", "--backend", backend),
        cwd=folder,
        environment=installation(tmp_path, "rig"),
    )
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].endswith(f': pip install "ppy-rig[{backend}]"')


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "extra"),
    [
        ('ppy.read_record("run.csv").plot()', "pictures"),
        ('ppy.read_record("run.parquet")', "records"),
        ('ppy.linearise("pid")', "linear"),
        ('ppy.black_box("run.csv", "voltage")', "diagnose"),
    ],
)
def test_python_says_the_line_too(
    core: dict[str, str], folder: Path, call: str, extra: str
) -> None:
    done = python(f"import ppy_rig as ppy\n{call}", core, folder)
    last = done.stderr.splitlines()[-1]
    assert last.startswith("fmus.kit.errors.UserError: ")
    assert last.endswith(f': pip install "ppy-rig[{extra}]"')


@pytest.mark.slow
def test_every_name_of_python_is_there(core: dict[str, str], folder: Path) -> None:
    done = python("import ppy_rig\nfor name in dir(ppy_rig): getattr(ppy_rig, name)", core, folder)
    assert (done.returncode, done.stderr) == (0, "")


def python(
    code: str, environment: dict[str, str], folder: Path
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        cwd=folder,
        capture_output=True,
        text=True,
    )
