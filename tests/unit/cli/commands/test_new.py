"""Claims: what ``ppy new`` writes loads, fits its units, simulates, passes its own tests, and costs
no file that is there.
"""

from __future__ import annotations

import re
import runpy
import shlex
import subprocess
import sys

import pytest

from orchestration.cli.commands import new
from orchestration.fmu.model import catalogue, find_class
from orchestration.fmu.model.loading import remarks_on
from orchestration.records import read_record
from orchestration.rig.backends.registry import open_backend
from tests.support.command import here, refused, works
from tests.support.source import ROOT


def run_tests_of(path):
    """Call the test functions that a file has, which take nothing."""
    tests = {n: f for n, f in runpy.run_path(str(path)).items() if n.startswith("test_")}
    assert len(tests) >= 2
    for test in tests.values():
        test()


def rows(path):
    """Return what stands in the first cells of the tables of a page."""
    return re.findall(r"(?m)^\| ([^|]+?) \|", path.read_text(encoding="utf-8"))


def test_a_component_is_a_model_that_passes_its_test(tmp_path):
    printed = works("new", "component", "water_tank", cwd=tmp_path).split()
    assert {"water_tank.py", "test_water_tank.py", "water_tank.md"} < set(printed)
    place = f"{tmp_path / 'water_tank.py'}:WaterTank"
    assert find_class(place).name == "water_tank"
    assert remarks_on(place) == ()
    run_tests_of(tmp_path / "test_water_tank.py")
    assert "`driven`" in rows(tmp_path / "water_tank.md")


@pytest.mark.parametrize("runtime", ["python", pytest.param("native", marks=pytest.mark.slow)])
def test_an_effect_beside_its_model_is_simulated(tmp_path, runtime):
    works("new", "component", "tank", cwd=tmp_path)
    works("new", "effect", "leak", "--model", "tank.py:Tank", "--law", "driven", cwd=tmp_path)
    run_tests_of(tmp_path / "test_leak.py")
    command = ("simulate", "tank.py:Tank", "--with", "leak.py:Leak", "--runtime", runtime)
    printed = works(
        *(*command, "--set", "leak_share=0.5", "--set", "drive=2", "--out", "out.csv"), cwd=tmp_path
    )
    assert "tank" in printed
    last = read_record(tmp_path / "out.csv", {"measured": "1"}).signals["measured"][-1]
    assert last == pytest.approx(3.0, abs=1e-3)


@pytest.mark.parametrize("found", [None, "pytest"])
def test_how_its_test_runs_is_said_where_pytest_is_not_installed_too(found, tmp_path, monkeypatch):
    monkeypatch.setattr(new, "find_spec", lambda name: found)
    monkeypatch.setattr(new, "which", lambda name: None)
    lines = here("new", "component", "tank", cwd=tmp_path).stdout.splitlines()
    run = [shlex.split(line.partition(": ")[2]) for line in lines if "pytest" in line]
    test = [sys.executable, "-m", "pytest", "test_tank.py"]
    install = [sys.executable, "-m", "pip", "install", "pytest"]
    assert run == ([test] if found else [install, test])


def test_an_effect_stands_in_another_folder_than_its_model(tmp_path):
    folder = 'the tank\'s {1} "models"'
    works("new", "component", "tank", "--out", folder, cwd=tmp_path)
    model = f"{folder}/tank.py:Tank"
    works("new", "effect", "leak", "--model", model, "--law", "driven", cwd=tmp_path)
    run_tests_of(tmp_path / "test_leak.py")
    simulation = re.search("`ppy (simulate .*--with) leak.py", (tmp_path / "leak.md").read_text())
    assert shlex.split(simulation[1]) == ["simulate", model, "--with"]


def test_an_effect_goes_into_the_catalogue_of_its_model_as_its_rows_say(tmp_path):
    works("new", "component", "tank", cwd=tmp_path)
    (tmp_path / "more").mkdir()
    model = ("--model", "tank.py:Tank", "--law", "driven", "--out", "more")
    works("new", "effect", "leak", *model, cwd=tmp_path)
    run_tests_of(tmp_path / "more" / "test_leak.py")
    assert "`../tank.py`, `EFFECTS`" in rows(tmp_path / "more" / "leak.md")
    body = (tmp_path / "more" / "leak.py").read_text().split("\n\n\n")[1]
    text = (tmp_path / "tank.py").read_text()
    text = text.replace("import Component,", "import Component, Effect, Size, Term,")
    text = text.replace("EFFECTS = {}", f"{body}\n\n\nEFFECTS = {{Leak.id: Leak}}")
    (tmp_path / "tank.py").write_text(text)
    assert list(catalogue(find_class(f"{tmp_path / 'tank.py'}:Tank"))) == ["leak"]


@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("ppy_actuator", "charge_elongation"),
        ("voice_coil_dma", "slide_friction"),
        ("foot_dynamic", "arch_torque"),
    ],
)
def test_an_effect_of_a_shipped_component_passes_its_test_and_says_where_it_belongs(
    tmp_path, name, law
):
    asked = ("new", "effect", "more_of_it", "--model", name, "--law")
    refused(tmp_path, *asked, "nothing", parts=["no such law"])
    works(*asked, law, cwd=tmp_path)
    run_tests_of(tmp_path / "test_more_of_it.py")
    page = (tmp_path / "more_of_it.md").read_text()
    places = re.findall(r"`((?:fmus|tests|demonstrations)/[\w/.]+)`", page)
    assert len(places) == (4 if name == "ppy_actuator" else 3)
    assert all((ROOT / place).exists() for place in places)


def test_a_backend_opens_and_passes_its_test(tmp_path):
    printed = works("new", "backend", "my_rig", cwd=tmp_path)
    assert "serve it: ppy rig serve --backend my_rig.py:MyRig" in printed
    backend = open_backend(f"{tmp_path / 'my_rig.py'}:MyRig", {"gain": "1"})
    assert backend.read() == {"displacement": 0.0}
    run_tests_of(tmp_path / "test_my_rig.py")
    assert {"`port`", "`current`"} < set(rows(tmp_path / "my_rig.md"))


def test_what_is_written_is_formatted_and_clean(tmp_path):
    works("new", "component", "tank", cwd=tmp_path)
    works("new", "backend", "my_rig", cwd=tmp_path)
    works(
        *("new", "effect", "leak", "--model", "tank.py:Tank", "--law", "response_rate"),
        cwd=tmp_path,
    )
    model = ("--model", "ppy_actuator", "--law", "series_resistance")
    works("new", "effect", "current_dependent_resistance", *model, cwd=tmp_path)
    settings = ("--config", str(ROOT / "pyproject.toml"), "--extend-ignore", "D,I")
    for command in (("check", *settings), ("format", "--check", *settings[:2])):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "."],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("component", "Water Tank"), ["'Water Tank'", "such as water_tank"]),
        (("component", "Kühlung"), ["such as kuehlung"]),
        (("component", "class"), ["'class'"]),
        (("effect", "leak", "--model", "foot", "--law", "nothing"), ["no such law"]),
        (("effect", "leak", "--model", "gone.py:Tank"), ["gone.py"]),
        (("thing", "leak"), ["thing"]),
        (("component", "tank"), ["tank.md is there already"]),
    ],
)
def test_nothing_is_written_where_it_cannot_be_right(tmp_path, arguments, parts):
    (tmp_path / "tank.md").write_text("mine")
    refused(tmp_path, "new", *arguments, parts=parts)
    assert [path.name for path in tmp_path.iterdir()] == ["tank.md"]
