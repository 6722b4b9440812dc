"""Claims: what the product imports is brought by the installation, or by the extra that a line
names where it is not there.

Oracle: pyproject.toml, and what installed distributions say of themselves.
"""

from __future__ import annotations

import importlib.metadata
import re

import pytest
from packaging.utils import canonicalize_name

from fmus.kit import UserError
from fmus.kit.extras import PACKAGES, install_command, optional, require
from tests.support import installation

TASKS = set(installation.PROJECT["optional-dependencies"]) - {"standard", "docs", "dev"}
IMPORTED = re.compile(r"^ *(?:import|from) (\w+)\b", re.M)
OURS = ("demonstrations", "fmus", "orchestration", "ppy_rig")
UNIMPORTED = {"pyvisa-py"}  # PyVISA loads it


def names(extras: set[str]) -> set[str]:
    return {canonicalize_name(r.name) for r in installation.requirements(extras)}


def test_every_package_is_in_the_extra_that_its_line_names() -> None:
    for package in PACKAGES.values():
        assert canonicalize_name(package.distribution) in names({package.extra})
        assert canonicalize_name(package.distribution) not in names(set())


def test_every_package_of_an_extra_has_its_line() -> None:
    known = {canonicalize_name(package.distribution) for package in PACKAGES.values()}
    assert names(TASKS) - names(set()) - UNIMPORTED == known


def test_every_extra_is_on_the_page_of_the_installation() -> None:
    page = (installation.ROOT / "docs/reference/index.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.*`) \|", page, re.M)
    described = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert described == set(installation.PROJECT["optional-dependencies"])


@pytest.mark.slow
def test_a_package_is_imported_from_its_distribution() -> None:
    owners = importlib.metadata.packages_distributions()
    for name, package in PACKAGES.items():
        assert package.distribution in owners[name]


@pytest.mark.slow
def test_what_is_imported_comes_with_the_core_or_has_its_line() -> None:
    core = installation.distributions(installation.requirements(()))
    owners = importlib.metadata.packages_distributions()
    others = {
        name
        for name, brought_by in owners.items()
        if not core & set(map(canonicalize_name, brought_by))
    }
    in_its_kernel = {"IPython"}  # which runs already where it is imported
    unknown = others - set(PACKAGES) - set(OURS) - in_its_kernel
    for folder in OURS:
        for path in (installation.ROOT / folder).rglob("*.py"):
            assert not unknown & set(IMPORTED.findall(path.read_text(encoding="utf-8"))), path


def test_the_installation_of_the_readme_has_the_packages_that_the_project_builds_on() -> None:
    assert {"fmpy", "pythonfmu", "numpy", "scipy", "control"} <= names({"standard"})


LINE = 'drawing a picture or a page needs matplotlib: pip install "ppy-rig[pictures]"'


def test_a_package_that_is_not_there_is_a_line_of_what_needs_it_and_what_to_install() -> None:
    with pytest.raises(UserError) as caught, optional():
        raise ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib")
    assert str(caught.value) == LINE
    assert install_command("matplotlib") in LINE


@pytest.mark.parametrize("name", ["of_the_user", "matplotlib.no_such_module", None])
def test_any_other_module_that_is_not_there_is_its_own_error(name: str | None) -> None:
    with pytest.raises(ModuleNotFoundError), optional():
        raise ModuleNotFoundError("No module", name=name)


def test_a_task_is_refused_before_it_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    require("matplotlib", "control")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(UserError) as caught:
        require("matplotlib")
    assert str(caught.value) == LINE


def test_a_line_has_all_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name in PACKAGES else name)
    with pytest.raises(UserError) as caught:
        require("zmq", "psutil", "SALib")
    assert str(caught.value) == (
        "talking to a rig needs pyzmq, serving a rig needs psutil, computing Sobol indices needs"
        ' SALib: pip install "ppy-rig[rig,sweeps]"'
    )
