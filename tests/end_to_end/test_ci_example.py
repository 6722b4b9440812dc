"""Claims: the workflow that users copy runs as it is written, and fails where a result is
another.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import xarray
import yaml

from tests.support.command import works

WORKFLOW = Path(__file__).parents[2] / "examples" / "ci" / "cosimulation.yml"
STEPS = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))["jobs"]["cosimulate"]["steps"]
COMMANDS = [
    step["run"]
    for step in STEPS
    if "run" in step and "if" not in step and step["name"] != "install"
]


def run(script, folder):
    """As a CI does: bash that ends at the first failure."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return subprocess.run(
        ["bash", "-e", "-c", script],
        cwd=folder,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        timeout=240,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the first lines of the workflow tell to do first."""
    folder = tmp_path_factory.mktemp("ci")
    (command,) = [
        line[1:].strip()
        for line in WORKFLOW.read_text(encoding="utf-8").splitlines()
        if "--out ref" in line
    ]
    works(*command.split()[1:], cwd=folder)
    return folder


def test_every_step_works(folder):
    assert len(COMMANDS) == 2
    for script in COMMANDS:
        done = run(script, folder)
        assert done.returncode == 0, done.stdout + done.stderr


def test_another_result_fails(folder):
    reference = xarray.load_dataset(folder / "reference.nc", engine="scipy")
    name = next(
        n for n in reference.data_vars if reference[n].dtype.kind == "f" and reference[n].ndim == 1
    )
    reference[name][-1] += 1e-12
    reference.to_netcdf(folder / "changed.nc", engine="scipy")
    done = run(COMMANDS[-1].replace("reference.nc", "changed.nc"), folder)
    assert done.returncode == 1
    assert str(name) in done.stdout + done.stderr


def test_what_is_kept_of_a_failure_can_be_looked_at(folder):
    (script,) = [step["run"] for step in STEPS if "if" in step]
    assert run(script, folder).returncode in (0, 1)
    assert (folder / "now.html").exists()
