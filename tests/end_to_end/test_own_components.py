"""Claims: a distribution of components written outside is used like ours, by every command; one
that is broken is a line, and takes nothing with it.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from fmus import COMPONENTS
from tests.support import source
from tests.support.command import ppy
from tests.support.installed import OTHER_COMPONENTS, install
from tests.support.rig.process import Server

INSTRUMENTS = source.ROOT / "tests" / "support" / "rig" / "instruments.yaml"


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    return install(OTHER_COMPONENTS, tmp_path_factory.mktemp("site"))


@pytest.fixture
def works(environment, tmp_path):
    def works(*arguments):
        done = ppy(*arguments, cwd=tmp_path, environment=environment)
        assert (done.returncode, done.stderr.count("left out")) == (0, 0), done.stderr
        return done.stdout

    return works


@pytest.mark.slow
def test_it_is_listed_after_ours(works):
    listed = dict(line.split(maxsplit=1) for line in works("list").splitlines())
    assert list(listed)[len(COMPONENTS)] == "tank"
    assert listed["tank"] == "A tank that empties through a pipe"
    assert "\ntank_cascade" in works("system", "list")


def test_its_experiment_is_listed(works):
    listed = dict(line.split(maxsplit=1) for line in works("run", "--list").splitlines())
    assert listed["tank_filling"] == "A tank that fills"


@pytest.mark.slow
def test_its_component_is_built_and_simulated(works, tmp_path):
    """Filled by the flow that keeps 2 m; the level is 2 - exp(-t / 250 s)."""
    works("run", "tank_filling", "--out", "run.csv")
    time, _, level = np.loadtxt(tmp_path / "run.csv", delimiter=",", comments="#", skiprows=1).T
    assert time[-1] == 600.0
    assert level == pytest.approx(2.0 - np.exp(-time / 250.0), rel=1e-6)


@pytest.mark.slow
def test_an_fmu_of_it_knows_what_it_was_made_from(works, tmp_path):
    works("build", "tank", "--with", "turbulence", "--runtime", "native", "--out", "fmus")
    (fmu,) = (tmp_path / "fmus").rglob("*.fmu")
    with zipfile.ZipFile(fmu) as archive:
        described = archive.read("modelDescription.xml").decode()
    assert '<MadeFrom component="tank"' in described
    known = json.loads(works("info", fmu, "--json", "-"))
    assert "turbulence" in json.dumps(known)


@pytest.mark.slow
def test_its_system_runs(works, tmp_path):
    works("system", "check", "tank_cascade")
    works("simulate", "tank_cascade", "--stop", "100s", "--out", "run.csv")
    rows = np.loadtxt(tmp_path / "run.csv", delimiter=",", comments="#", skiprows=1)
    upper, alone = math.exp(-0.8), math.exp(-0.4)  # m, of tanks that nothing flows into
    assert rows[-1, -1] == pytest.approx(alone + 2.0 * (alone - upper), rel=5e-3)


@pytest.mark.slow
def test_its_rig_is_served(environment, tmp_path):
    options = {"calibration": "tank_rig", "library": f"{INSTRUMENTS}@sim"}
    with Server(tmp_path, "visa", options=options, environment=environment) as server:
        ready = server.wait_line("ready: ")
    assert "inflow" in ready
    assert "level" in ready


@pytest.mark.slow
def test_a_record_of_its_rig_is_played_back(environment, tmp_path):
    (tmp_path / "record.csv").write_text("time,inflow[m^3/s],level[m]\n0,0,1\n1,0,0.9\n")
    options = {"file": "record.csv", "signals": "tank"}
    with Server(tmp_path, "replay", options=options, environment=environment) as server:
        ready = server.wait_line("ready: ")
    assert "inflow" in ready
    assert "level" in ready


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("from pathlib", "import no_such_package\nfrom pathlib", "No module named 'no_such"),
        ('{"tank": ', '{"foot": ', "fmus.foot:PACKAGE has a component 'foot' already"),
        ("PACKAGE = ", "OTHER = ", "has no attribute 'PACKAGE'"),
        ("step=1.0", "step=", "SyntaxError"),
    ],
    ids=["import", "name of ours", "no such object", "no Python"],
)
def test_a_broken_one_is_a_line(tmp_path, old, new, reason):
    environment = install(OTHER_COMPONENTS, tmp_path / "site")
    file = tmp_path / "site" / "tank_models" / "__init__.py"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    done = ppy("list", cwd=tmp_path, environment=environment)
    assert done.returncode == 0
    assert done.stdout.splitlines()[0].startswith("ppy_actuator ")
    assert "tank" not in done.stdout
    (line,) = done.stderr.splitlines()
    assert line.startswith("warning: components tank_models:PACKAGE of tank-models are left out: ")
    assert reason in line


@pytest.mark.slow
def test_a_component_that_cannot_be_imported_is_left_out_of_the_list(tmp_path):
    environment = install(OTHER_COMPONENTS, tmp_path / "site")
    (tmp_path / "site" / "tank_models" / "model.py").write_text("1 / 0\n", encoding="utf-8")
    done = ppy("list", cwd=tmp_path, environment=environment)
    assert (done.returncode, "tank" in done.stdout) == (0, False)
    message = "tank_models.model:Tank cannot be imported: ZeroDivisionError: division by zero"
    assert done.stderr == f"warning: tank is left out: {message}\n"
    used = ppy("simulate", "tank", cwd=tmp_path, environment=environment)
    assert (used.returncode, used.stderr) == (2, f"error: {message}\n")


@pytest.mark.parametrize("name", ["pyproject.toml", "tank_models/__init__.py"])
def test_the_page_shows_what_is_tested_here(name):
    page = (source.ROOT / "docs/how-to/own-components.md").read_text(encoding="utf-8")
    assert (OTHER_COMPONENTS / name).read_text(encoding="utf-8") in page


@pytest.mark.slow
def test_a_wheel_of_it_brings_all(tmp_path):
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(tmp_path)]
    copied = tmp_path / "source"
    subprocess.run(["cp", "-r", str(OTHER_COMPONENTS), str(copied)], check=True)
    built = subprocess.run([*command, str(copied)], capture_output=True, text=True)
    if built.returncode != 0 and "connection" in built.stderr.lower():
        pytest.skip("no package index to build a wheel with")
    assert built.returncode == 0, built.stderr
    (wheel,) = tmp_path.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    environment = {"PYTHONPATH": str(tmp_path / "site")}
    done = ppy("run", "--list", cwd=tmp_path, environment=environment)
    assert "tank_filling" in done.stdout, done.stderr
