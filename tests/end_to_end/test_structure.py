"""Claims: the source is made of small modules in small folders, of short functions, and tests lean on no other test."""

from __future__ import annotations

import ast
import io
import re
import statistics
import tokenize
import tomllib
from pathlib import Path

import pytest

from docs.draw_architecture import imports

ROOT = Path(__file__).parents[2]
TESTS = ROOT / "tests"
SOURCES = [
    path for folder in ("fmus", "orchestration") for path in sorted((ROOT / folder).rglob("*.py"))
]
MODULES = [
    path
    for path in SOURCES
    if path.is_relative_to(ROOT / "orchestration") and path.name != "__init__.py"
]
FOLDERS = sorted({path.parent for path in MODULES})
_NO_CODE = (
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.COMMENT,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
)


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def lines(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def lines_of_code(text: str) -> dict[str, int]:
    """Lines of each function that hold code: no docstring, no comment, nothing blank."""
    tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    spans = [(t.start[0], t.end[0]) for t in tokens if t.type not in _NO_CODE]
    code = {number for first, last in spans for number in range(first, last + 1)}
    found = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first, end = node.body[0], node.end_lineno or node.lineno
            spared = (
                range(first.lineno, (first.end_lineno or 0) + 1)
                if ast.get_docstring(node) is not None
                else ()
            )
            found[f"{node.name} (line {node.lineno})"] = len(
                code & set(range(node.lineno, end + 1)) - set(spared)
            )
    return found


@pytest.mark.parametrize("path", sorted(TESTS.rglob("*.py")), ids=named)
def test_no_test_module_is_imported(path: Path) -> None:
    """What tests share is a helper's, so that a test can be renamed, moved and skipped by itself."""
    assert [name for name in imports(path) if name.startswith("tests.") and ".test_" in name] == []


def test_every_module_is_in_a_folder() -> None:
    assert [named(path) for path in MODULES if path.parent == ROOT / "orchestration"] == []


@pytest.mark.parametrize("folder", FOLDERS, ids=named)
def test_a_folder_can_be_taken_in_at_a_glance(folder: Path) -> None:
    assert len([path for path in MODULES if path.parent == folder]) <= 15


def test_modules_are_small() -> None:
    assert {named(path): lines(path) for path in MODULES if lines(path) > 350} == {}
    assert statistics.median(map(lines, MODULES)) < 150


def test_functions_are_short() -> None:
    counted = {named(path): lines_of_code(path.read_text(encoding="utf-8")) for path in SOURCES}
    assert {
        f"{path}: {name}": n for path, of in counted.items() for name, n in of.items() if n > 60
    } == {}


SAMPLE = '''
@cache
def f(a,
      b):
    """One.

    Two.
    """
    # three

    x = """four

    five"""
    return x
'''


def test_docstrings_comments_and_blank_lines_are_no_code() -> None:
    assert lines_of_code(SAMPLE) == {"f (line 3)": 6}


def test_imports_are_seen_wherever_they_stand() -> None:
    """Of this very file."""
    from tests.support.system import samples  # noqa: F401

    assert {"ast", "pathlib.Path", "tests.support.system.samples"} <= set(imports(Path(__file__)))


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


def test_one_version_is_named_everywhere() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "version"
    ]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## [{version}] - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
