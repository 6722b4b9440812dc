"""Claims: the workflow that users copy runs as it is written in a folder that has nothing but FMUs,
a system, a record and a result of their own; and it fails where one of them is another.

Oracle: a first-order lag whose step response is written down here.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray
import yaml
from packaging.requirements import Requirement

from orchestration.system import Member, Port, System, connect, ssp
from tests.support.command import works

ROOT = Path(__file__).parents[2]
WORKFLOW = ROOT / "examples" / "ci" / "cosimulation.yml"
STEPS = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))["jobs"]["models"]["steps"]
RUN = {step["name"]: step for step in STEPS if "run" in step}
LAG = '''
from fmus.kit import Component, Input, Output, Parameter, State


class Plant(Component):
    """A lag of first order."""

    name = "plant"
    gain = Parameter(2.0, "1", min=0.0, max=10.0, doc="static gain")
    T = Parameter(0.5, "s", min=0.01, max=10.0, doc="time constant")
    u = Input("V", doc="what drives it")
    x = State("V", rate="rate", doc="its state")

    def rate(self):
        """First order."""
        return (self.gain * self.u - self.x) / self.T

    @Output("V")
    def y(self):
        """Its state."""
        return self.x
'''


def run(step, folder):
    """As a CI does: bash that ends at the first failure, which finds `ppy` and no source of it."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return subprocess.run(
        ["bash", "-e", "-c", RUN[step]["run"]],
        cwd=folder,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        timeout=240,
    )


def write_record(path, gain):
    """Write the response to a step of 1 V after a second, which is known in closed form."""
    time = np.arange(0.0, 5.0, 0.01)
    u = np.where(time >= 1.0, 1.0, 0.0)
    y = np.where(time >= 1.0, gain * -np.expm1(-(time - 1.0) / 0.5), 0.0)
    rows = np.column_stack([time, u, y])
    np.savetxt(path, rows, delimiter=",", header="time [s],u [V],y [V]", comments="", fmt="%.9g")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the first lines of the workflow expect, and not a file of this repository."""
    folder = tmp_path_factory.mktemp("own")
    for name in ("models", "systems", "records"):
        (folder / name).mkdir()
    source = tmp_path_factory.mktemp("elsewhere") / "own.py"
    source.write_text(LAG, encoding="utf-8")
    works("build", f"{source}:Plant", "--runtime", "native", cwd=source.parent)
    plant = folder / "models" / "plant.fmu"
    shutil.move(source.parent / "fmu" / "native" / "plant.fmu", plant)
    shutil.rmtree(source.parent)
    write_record(folder / "records" / "step.csv", 2.0)
    loop = System(
        "loop",
        (Member("a", plant), Member("b", plant)),
        connect("a.y -> b.u", "b.y -> a.u"),
        outputs={"y": Port("b", "y")},
        step=0.01,
        stop=1.0,
    )
    ssp.write(loop.given({"a.x_start": 1.0}), folder / "systems" / "loop.ssp")
    (command,) = [
        line[1:].strip()
        for line in WORKFLOW.read_text(encoding="utf-8").splitlines()
        if "--out reference" in line
    ]
    works(*command.split()[1:], cwd=folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("step", [name for name in RUN if "if" not in RUN[name]][1:])
def test_every_step_works(folder, step):
    done = run(step, folder)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_a_model_that_does_not_follow_its_record_fails(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "other")
    write_record(tmp_path / "other" / "records" / "step.csv", 2.3)
    done = run("a model follows what was measured", tmp_path / "other")
    assert done.returncode == 1
    assert "--require 95%: y fits" in done.stderr


@pytest.mark.slow
def test_another_result_fails_and_can_be_looked_at(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "other")
    path = tmp_path / "other" / "reference.nc"
    reference = xarray.load_dataset(path, engine="scipy")
    reference["b.y"][-1] += 1e-12
    reference.to_netcdf(path, engine="scipy")
    done = run("co-simulation gives the reference, bit for bit", path.parent)
    assert done.returncode == 1
    assert "not as in reference.nc: b.y differs" in done.stdout
    run("what the co-simulation gives now", path.parent)
    assert (path.parent / "now.html").exists()


@pytest.mark.slow
def test_the_diagnosis_of_the_night_finds_nothing(folder):
    (name,) = [name for name in RUN if "once a night" in name]
    done = run(name, folder)
    assert done.returncode == 0, done.stdout + done.stderr


def test_what_is_installed_is_this_project():
    (requirement,) = [
        Requirement(word.strip('"'))
        for word in RUN["install"]["run"].split()
        if word not in ("pip", "install")
    ]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert requirement.name == project["name"]
    assert requirement.extras <= set(project["optional-dependencies"])
