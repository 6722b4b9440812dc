"""Claims: a wheel is complete: unpacked anywhere, it plans the FMU of every component."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from fmus import MODELS

ROOT = Path(__file__).parents[2]
PLAN = """
import sys
from fmus import MODELS, component
from fmus.kit.build.building import RUNTIMES, plan_build
from fmus.kit import build
assert build.__file__.startswith(sys.argv[1]), build.__file__
for name in MODELS:
    for runtime in RUNTIMES:
        print(name, runtime, len(plan_build(component(name), runtime).files))
"""


@pytest.mark.slow
def test_an_installed_wheel_has_all_that_fmus_are_made_of(tmp_path: Path) -> None:
    source = tmp_path / "source"  # a copy, because building leaves files behind
    for part in ("fmus", "orchestration", "ppy_rig", "demonstrations"):
        shutil.copytree(ROOT / part, source / part, ignore=shutil.ignore_patterns("__pycache__"))
    for part in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / part, source / part)
    built = subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "--quiet",
            "--no-deps",
            "-w",
            str(tmp_path),
            str(source),
        ],
        capture_output=True,
        text=True,
    )
    if built.returncode != 0 and re.search(
        "could not find a version|connection", built.stderr, re.I
    ):
        pytest.skip("no package index to build a wheel with")
    assert built.returncode == 0, built.stderr
    (wheel,) = tmp_path.glob("*.whl")
    unpacked = tmp_path / "unpacked"
    zipfile.ZipFile(wheel).extractall(unpacked)
    done = subprocess.run(
        [sys.executable, "-c", PLAN, str(unpacked)],
        env=os.environ | {"PYTHONPATH": str(unpacked)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 2 * len(MODELS)
    assert not (unpacked / "studies").exists()
    done = subprocess.run(
        [sys.executable, "-m", "orchestration.cli", "thesis", "--out", "thesis.html"],
        env=os.environ | {"PYTHONPATH": str(unpacked)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "thesis.html").stat().st_size > 100_000


def test_the_import_rules_name_every_component() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "importlinter"
    ]["contracts"]
    components = {place.partition(":")[0] for place in MODELS.values()}
    for contract in contracts:
        for key in ("modules", "forbidden_modules"):
            named = contract.get(key, [])
            if not any(covers(one, module) for one in named for module in components):
                continue
            absent = {
                module for module in components if not any(covers(one, module) for one in named)
            }
            assert absent == set(), contract["name"]


def covers(named: str, module: str) -> bool:
    """Return whether a contract that names a module or a package is about a module."""
    return named.count(".") > 0 and (module == named or module.startswith(f"{named}."))
