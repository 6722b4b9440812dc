"""Claims: modules are in rooms, whose doors are used, and tests lean on no other test."""

from __future__ import annotations

import importlib
import re
import tomllib
from collections.abc import Iterable
from graphlib import CycleError, TopologicalSorter
from itertools import chain
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

from docs.draw_architecture import imports
from tests.support import doors
from tests.support.import_graph import module_graph

WIDEST = 17  # names that a package may offer
# may not become wider: rooms that are to be replaced, front doors, catalogues of effects and plants
WIDER = {
    "fmus.kit": 20,  # the language of components; the functions of laws count as one
    "fmus.kit.build": 27,
    "fmus.kit.symbolic": 19,
    "fmus.rig_proxy": 37,
    "orchestration": 25,
    "orchestration.api": 32,
    "orchestration.diagnosis": 20,
    "orchestration.identify.black_box": 18,
    "orchestration.records": 18,
    "orchestration.rig": 25,
    "studies.plants": 20,
}
ROOT = Path(__file__).parents[2]
TESTS = ROOT / "tests"
MODULES = [
    path for path in (ROOT / "orchestration").rglob("*.py") if not path.name.startswith("__")
]
COMPONENTS = [path for path in (ROOT / "fmus").rglob("*.py") if not path.name.startswith("__")]


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_no_test_module_is_imported() -> None:
    """Shared code of tests belongs to a helper, so that a test can be renamed, moved and skipped by
    itself.
    """
    imported = {named(path): among_tests(imports(path)) for path in TESTS.rglob("*.py")}
    assert {path: names for path, names in imported.items() if names} == {}


def among_tests(names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith("tests.") and ".test_" in name]


def test_an_import_of_a_test_module_is_seen() -> None:
    assert among_tests(["tests.unit.test_a.f", "tests.support.pace"]) == ["tests.unit.test_a.f"]


def test_every_module_is_in_a_folder() -> None:
    assert [named(path) for path in MODULES if path.parent == ROOT / "orchestration"] == []


def mirrored(path: Path) -> Path:
    """Return the place of the tests of a module."""
    *folders, file = path.relative_to(ROOT).parts
    components = folders[0] == "fmus" and folders[1] != "kit"
    return TESTS.joinpath("components" if components else "unit", *folders[1:], f"test_{file}")


def test_a_module_has_its_tests_at_the_mirrored_place() -> None:
    assert [named(path) for path in (*MODULES, *COMPONENTS) if not mirrored(path).is_file()] == []


def test_imports_are_seen_wherever_they_stand() -> None:
    """Of this very file."""
    from tests.support.system import samples  # noqa: F401

    assert {"tomllib", "pathlib.Path", "tests.support.system.samples"} <= set(
        imports(Path(__file__))
    )


def test_the_hooks_before_a_commit_are_the_checks_of_make() -> None:
    makefile, hooks = (
        (ROOT / name).read_text(encoding="utf-8")
        for name in ("Makefile", ".pre-commit-config.yaml")
    )
    checks = makefile.split("\ncheck:")[1].split("\n\n")[0].splitlines()[1:]
    entries = [
        text.replace(" --force-exclude", "")
        for text in re.findall(r"entry: \.venv/bin/(.*)", hooks)
    ]
    assert entries == [re.sub(r"^\t\$\(BIN\)/| \.$", "", line) for line in checks]
    assert set(re.findall(r"repo: (\S+)", hooks)) == {"local"}, "nothing is fetched from elsewhere"


def test_an_import_past_a_door_is_seen() -> None:
    """Of a module of another package, not of one's own, of one around it, or of one offered."""
    past = {
        ("orchestration.sweeps.task", "orchestration.fmu.instance"): False,
        ("orchestration.sweeps.task", "orchestration.fmu.model.loading"): False,
        ("orchestration.sweeps.task", "orchestration.fmu"): True,
        ("orchestration.fmu.simulation.repeated", "orchestration.fmu.instance"): True,
        ("orchestration.fmu.check.binaries", "orchestration.fmu.instance"): True,
        ("orchestration.sweeps.task", "orchestration.reporting.console"): True,
    }
    assert {imports: doors.may_import(*imports) for imports in past} == past


def test_no_module_is_imported_in_a_circle() -> None:
    """At once or when a function is called: each can be read and moved without the other."""
    graph = module_graph()
    assert "orchestration.reporting.drawing" in graph["orchestration.reporting.notebook"]
    TopologicalSorter(graph).prepare()  # CycleError names the modules of a circle


def test_a_circle_is_seen_by_a_door_and_inside_a_function(tmp_path: Path) -> None:
    package = tmp_path / "orchestration" / "a"
    package.mkdir(parents=True)
    for name, text in {
        "__init__.py": "",
        "__init__.pyi": "from .one import f as f",
        "one.py": "if TYPE_CHECKING:\n    from orchestration.b import g\ndef f(): ...",
    }.items():
        (package / name).write_text(text, encoding="utf-8")
    other = tmp_path / "orchestration" / "b.py"
    other.write_text("def g():\n    from orchestration.a import f", encoding="utf-8")
    graph = module_graph(tmp_path)
    assert graph["orchestration.b"] == {"orchestration.a.one"}
    TopologicalSorter(graph).prepare()
    (package / "one.py").write_text("def f():\n    from ..b import g", encoding="utf-8")
    with pytest.raises(CycleError, match="cycle"):
        TopologicalSorter(module_graph(tmp_path)).prepare()


def test_every_name_that_a_package_offers_is_there() -> None:
    packages = sorted(
        path.parent for root in doors.ROOTS for path in (ROOT / root).rglob("__init__.pyi")
    )
    assert packages
    for package in packages:
        module = importlib.import_module(named(package).replace("/", "."))
        absent = [name for name in module.__all__ if not hasattr(module, name)]
        assert absent == [], module.__name__


def test_a_door_is_no_wider_than_it_may_be() -> None:
    packages = [path.parent for root in doors.ROOTS for path in (ROOT / root).rglob("__init__.py")]
    offered = {name: doors.offered(name) for name in map(dotted, packages)}
    assert {
        package: len(names)
        for package, names in offered.items()
        if len(names) > WIDER.get(package, WIDEST)
    } == {}


def dotted(package: Path) -> str:
    return named(package).replace("/", ".")


def test_one_version_is_named_everywhere() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "version"
    ]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## [{version}] - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_a_decision_has_a_date_and_a_status() -> None:
    records = sorted((ROOT / "docs" / "decisions").glob("0*.md"))
    dated = re.compile(
        r"# \d+\. .+\n\n\*(Accepted|Replaced by \[.+\]\(.+\)), \d{4}-\d\d-\d\d\.\*\n"
    )
    assert [named(path) for path in records if not dated.match(path.read_text("utf-8"))] == []


def test_constraints_pin_every_dependency_at_an_allowed_version() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = dict(line.lower().replace("_", "-").split("==") for line in lines if "==" in line)
    assert len(pins) == len(lines) - 1, (
        "a line is neither the heading nor a pin: hosts have no place here"
    )
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *chain(*project["optional-dependencies"].values())]
    for requirement in map(Requirement, wanted):
        name = requirement.name.lower().replace("_", "-")
        if name != project["name"] and not requirement.marker:
            assert requirement.specifier.contains(pins[name]), requirement


def test_the_public_workflow_tests_every_system_and_the_oldest_python() -> None:
    workflow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
    matrix = workflow["jobs"]["tests"]["strategy"]["matrix"]
    assert {name.partition("-")[0] for name in matrix["os"]} == {"ubuntu", "macos", "windows"}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == f">={matrix['python'][0]}"


@pytest.mark.parametrize("name", ["ci", "release"])
def test_a_public_workflow_calls_what_there_is(name: str) -> None:
    workflow = yaml.safe_load((ROOT / f".github/workflows/{name}.yml").read_text(encoding="utf-8"))
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    steps = [step for job in workflow["jobs"].values() for step in job["steps"]]
    called = re.findall(r"make ([\w-]+)", "\n".join(step.get("run", "") for step in steps))
    assert called
    assert set(called) <= set(targets)


def test_what_make_test_leaves_out_is_run_every_night() -> None:
    """By the targets in the table of CONTRIBUTING.md."""
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = page.split("| left out of `make test` | run by |\n|---|---|\n")[1].split("\n\n")[0]
    wanted = {t for row in rows.splitlines() for t in re.findall(r"`make ([\w-]+)` ?[|,]", row)}
    assert wanted == {"test-slow", "docs", "dist"}
    workflow = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
    assert workflow[True]["schedule"]  # YAML 1.1 reads `on` as true
    nightly = [
        job for job in workflow["jobs"].values() if job.get("if", "schedule").count("schedule")
    ]
    steps = [step.get("run", "") for job in nightly for step in job["steps"]]
    assert wanted <= set(re.findall(r"^make ([\w-]+)$", "\n".join(steps), re.M))


def test_a_release_is_made_of_a_tag_and_publishes_without_a_secret() -> None:
    text = (ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8")
    workflow = yaml.safe_load(text)
    assert workflow[True] == {"push": {"tags": ["v*"]}}  # YAML 1.1 reads `on` as true
    assert workflow["jobs"]["pypi"]["permissions"] == {"id-token": "write"}
    assert workflow["jobs"]["pypi"]["needs"] == workflow["jobs"]["page"]["needs"] == "dist"
    assert "secrets." not in text
