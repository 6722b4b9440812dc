"""Claims: the example repository for continuous integration is green as it stands, for a user
without home and terminal in a checkout that nobody can write; and it is red, with the place named,
for each change that a regression is.

Oracle: each change is made by hand here, so that its place is known.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray
import yaml
from junitparser import JUnitXml
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "ci"
WORKFLOW = EXAMPLE / "cosimulation.yml"
STEPS = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))["jobs"]["models"]["steps"]
COMMANDS = {step["name"]: step["run"] for step in STEPS if "run" in step}
INSTALL, BUILD, CHECK, SYSTEM, TANK, DECAY, CHAIN, NIGHT = COMMANDS
STRANGER = 54321  # whom the system does not know
# the interpreter of the tests may be in a home of root: the other user may read, but not write
AS_ANOTHER = (
    "setpriv",
    f"--reuid={STRANGER}",
    f"--regid={STRANGER}",
    "--clear-groups",
    "--inh-caps=+dac_read_search",
    "--ambient-caps=+dac_read_search",
)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the Reference FMU is for Linux"),
]


def is_root() -> bool:
    return os.geteuid() == 0 and shutil.which("setpriv") is not None


def run(step: str, checkout: Path, temporary: Path) -> subprocess.CompletedProcess[str]:
    """Run a step as GitHub does, as another user if possible, and with nothing in the environment.

    GitHub names the folder for temporary files; other variables are those of any container.
    """
    path = os.pathsep.join([str(Path(sys.executable).parent), "/usr/bin", "/bin"])
    return subprocess.run(
        [*(AS_ANOTHER if is_root() else ()), "bash", "-eo", "pipefail", "-c", COMMANDS[step]],
        cwd=checkout,
        env={
            "PATH": path,
            "GITHUB_ACTIONS": "true",
            "RUNNER_TEMP": str(temporary),
            "TMPDIR": str(temporary),
        },
        stdin=subprocess.DEVNULL,
        start_new_session=True,  # no terminal either
        capture_output=True,
        text=True,
        timeout=240,
    )


@pytest.fixture
def workplace() -> Iterator[Path]:
    """Return a folder with a checkout, and one for temporary files of the other user.

    The folders of pytest are closed to others.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        shutil.copytree(EXAMPLE, folder / "checkout")
        (folder / "temporary").mkdir()
        if is_root():
            os.chown(folder / "temporary", STRANGER, STRANGER)
        yield folder
        for place in (folder / "checkout").rglob("*"):
            place.chmod(0o755)


def lock(checkout: Path) -> None:
    for place in (*checkout.rglob("*"), checkout):
        place.chmod(0o555 if place.is_dir() else 0o444)


def until_red(folder: Path, last: str) -> subprocess.CompletedProcess[str]:
    """Run the steps in a checkout that nobody can write, until one fails or the last is done."""
    checkout = folder / "checkout"
    lock(checkout)
    for step in COMMANDS:
        if step == INSTALL:
            continue
        done = run(step, checkout, folder / "temporary")
        assert "Traceback" not in done.stderr
        if done.returncode or step == last:
            assert step == last, (step, done.stdout, done.stderr)
            return done
    raise AssertionError(last)


def test_it_is_green(workplace):
    before = {path: path.read_bytes() for path in (workplace / "checkout").rglob("*.*")}
    done = until_red(workplace, NIGHT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert {path: path.read_bytes() for path in (workplace / "checkout").rglob("*.*")} == before
    results = workplace / "temporary" / "results"
    assert {path.suffix for path in results.iterdir()} == {".xml", ".html", ".csv", ".png"}
    for path in results.glob("*.xml"):
        suite = JUnitXml.fromfile(str(path))
        assert suite.tests > 0
        assert suite.failures == 0
    assert "::error" not in done.stderr


# --- changes -------------------------------------------------------------------------------------


def replaced(path: str, old: str, new: str) -> Callable[[Path], None]:
    def change(checkout: Path) -> None:
        text = (checkout / path).read_text(encoding="utf-8")
        assert old in text
        (checkout / path).write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


def repacked(path: str, member: str, old: str, new: str) -> Callable[[Path], None]:
    """Change a text in a file of an archive, or leave the file out if there is no new text."""

    def change(checkout: Path) -> None:
        with zipfile.ZipFile(checkout / path) as archive:
            contents = {name: archive.read(name) for name in archive.namelist()}
        assert old.encode() in contents[member]
        contents[member] = contents[member].replace(old.encode(), new.encode(), 1)
        with zipfile.ZipFile(checkout / path, "w") as archive:
            for name, data in contents.items():
                archive.writestr(name, data)

    return change


def sample_moved(checkout: Path) -> None:
    path = checkout / "systems" / "chain.nc"
    data = xarray.load_dataset(path, engine="scipy")
    name = "wire.Float64_continuous_output"
    assert data.time.values[37] == pytest.approx(3.7)
    data[name][37] += 0.01
    data.to_netcdf(path, engine="scipy")


def valve_late(checkout: Path) -> None:
    path = checkout / "records" / "tank.csv"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    rows[:, 2] = np.roll(rows[:, 2], 5)
    np.savetxt(path, rows, delimiter=",", header="time [s],valve [1],level [1]", comments="")


INITIAL = '        self.register_variable(Real("level"'
CHANGES = {
    "another gain of our model": (
        replaced("models/tank.py", "self.gain = 0.8", "self.gain = 0.9"),
        TANK,
        1,
        r"::error file=Tank\.fmu,title=ppy compare%3A level::--require 95%25: level fits \d\d",
    ),
    "a new output with the known fault": (
        replaced(
            "models/tank.py",
            INITIAL,
            '        self.spill = 0.0\n        self.register_variable(Real("spill",'
            f" causality=Fmi2Causality.output))\n{INITIAL}",
        ),
        CHECK,
        1,
        r"::error file=\S*Tank\.fmu,title=ppy check%3A model-description::.*spill.*"
        r"not accepted for spill",
    ),
    "the acceptance has run out": (
        replaced("findings.toml", "[[accept]]", "[[accept]]\nuntil = 2020-02-29"),
        CHECK,
        1,
        r"model-description::.*Expected {level}.*accepted until 2020-02-29 only",
    ),
    "a start value out of its range": (
        repacked(
            "models/Dahlquist.fmu",
            "modelDescription.xml",
            '<Real start="1"/>',
            '<Real start="1" min="2"/>',
        ),
        CHECK,
        1,
        r"::error file=models/Dahlquist\.fmu,title=ppy check%3A start-value::x: start = 1 is out",
    ),
    "the other FMU ends earlier": (
        repacked("models/Dahlquist.fmu", "modelDescription.xml", 'stopTime="10"', 'stopTime="8"'),
        DECAY,
        1,
        r"decay\.csv,title=ppy compare%3A x::covers 0 s to 8 s, the reference 0 s to 10 s",
    ),
    "a sample of the other tool": (
        replaced("references/decay.csv", "\n0.5,0.59", "\n0.5,0.69"),
        DECAY,
        1,
        r"compare%3A x::differs by 0\.1 at 0\.5 s: 0\.59049, allowed 0\.\d+ to 0\.\d+",
    ),
    "a signal is lost in the reference's unit": (
        replaced("references/decay.csv", "time,x", "time [s],x [V]"),
        DECAY,
        1,
        r"title=ppy compare%3A x::cannot be compared: .*'1'.*'V'",
    ),
    "a sample of the co-simulation": (
        sample_moved,
        CHAIN,
        1,
        r"title=ppy run%3A wire\.Float64_continuous_output::differs by 0\.01 at 3\.7 s: 0\.0",
    ),
    "a record of another clock": (
        valve_late,
        TANK,
        1,
        r"title=ppy compare%3A level::--require 95%25: level fits \d\d",
    ),
    "a connection to nothing": (
        repacked(
            "systems/chain.ssp",
            "SystemStructure.ssd",
            'startConnector="x"',
            'startConnector="gone"',
        ),
        SYSTEM,
        2,
        r"::error title=ppy::.*gone",
    ),
    "no reference at all": (
        lambda checkout: (checkout / "references" / "decay.csv").unlink(),
        DECAY,
        2,
        r"::error title=ppy::references/decay\.csv: cannot be read",
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_it_is_red_for_a_change_with_its_place(workplace, name):
    change, step, status, place = CHANGES[name]
    change(workplace / "checkout")
    done = until_red(workplace, step)
    assert done.returncode == status, done.stdout + done.stderr
    assert re.search(place, done.stderr), done.stderr


def test_what_is_installed_is_this_project():
    (requirement,) = [
        Requirement(word.strip('"'))
        for word in COMMANDS[INSTALL].split()
        if word not in ("pip", "install")
    ]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert requirement.name == project["name"]
    assert requirement.extras <= set(project["optional-dependencies"])
