"""Claims: wheel and source distribution install into an empty environment, in which `ppy demo` and
the install step of the workflow in `examples/ci` work.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
WORKFLOW = ROOT / "examples" / "ci" / "cosimulation.yml"
pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def run(command, folder, **environment):
    """Run a command that sees nothing of this repository."""
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        command, cwd=folder, env=clean | environment, capture_output=True, text=True, timeout=1500
    )
    if re.search("could not find a version|connection", done.stderr, re.I):
        pytest.skip("no package index")
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def copied(folder):
    """Copy what a distribution is made of, because building leaves files behind."""
    for part in ("fmus", "orchestration", "ppy_rig", "demonstrations"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / part, folder / part, ignore=ignored)
    for part in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / part, folder / part)
    return folder


@pytest.fixture(scope="module")
def dist(tmp_path_factory):
    """The packages of `make dist`: a source distribution, and a wheel of it."""
    folder = tmp_path_factory.mktemp("dist")
    source = copied(tmp_path_factory.mktemp("source"))
    run([sys.executable, "-m", "build", "--outdir", str(folder), str(source)], folder)
    return folder


@pytest.fixture(scope="module")
def elsewhere(dist, tmp_path_factory):
    """An environment with nothing but what the workflow installs, and a folder with nothing."""
    folder = tmp_path_factory.mktemp("elsewhere")
    venv.create(folder / "env", with_pip=True)
    (step,) = [
        step
        for step in yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))["jobs"]["models"]["steps"]
        if step.get("name") == "install"
    ]
    path = os.pathsep.join([str(folder / "env" / "bin"), os.environ["PATH"]])
    wanted = {"PIP_FIND_LINKS": str(dist), "PIP_CONSTRAINT": str(ROOT / "constraints.txt")}
    run(["bash", "-e", "-c", step["run"]], folder, PATH=path, **wanted)
    return folder


def test_the_demonstration_runs_where_only_the_wheel_is(elsewhere):
    ppy = str(elsewhere / "env" / "bin" / "ppy")
    assert run([ppy, "list"], elsewhere).startswith("ppy_actuator")
    printed = run([ppy, "demo"], elsewhere)
    assert "report: demo-output/report.html" in printed
    for name in ("report.html", "diagnosis.html", "hidden.csv"):
        assert (elsewhere / "demo-output" / name).stat().st_size > 10_000


def test_the_source_distribution_makes_the_same_wheel(dist, tmp_path):
    (source,) = dist.glob("*.tar.gz")
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", str(tmp_path), str(source)]
    run(command, tmp_path)
    wheels = [next(folder.glob("*.whl")) for folder in (dist, tmp_path)]
    first, second = (
        {name: archive.read(name) for name in archive.namelist()}
        for archive in map(zipfile.ZipFile, wheels)
    )
    assert first == second
    assert not [name for name in first if name.startswith("tests/")]
