"""Stamp of the code that drew a page: a digest without comments, docstrings and empty lines.

It is of the text, since a syntax tree is printed another way by every version of Python.
"""

from __future__ import annotations

import ast
import hashlib
import io
import re
import tokenize
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from docs.draw_architecture import imports

ROOT = Path(__file__).resolve().parents[2]
_LINE = (
    "Drawn with the code `{}`;"
    " `tests/studies/judging/test_stamp.py` fails where the code has become another."
)
# beside a stamp, on a page that was not drawn anew when the code changed
OUTDATED = (
    "**Of former code:** the search was made another one since, and these figures are those of the"
    " code stamped here."
)
_DOCUMENTED = ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef
_OURS = "fmus", "orchestration"
# FMUs carry numbers, and their own tests hold them to the same bits whatever the way; reports show
# what was decided
_CARRIES = "orchestration/fmu/", "orchestration/reporting/"
# what decides a diagnosis, with all that this imports, and C; not its reports
DIAGNOSIS = (
    "orchestration/diagnosis/engine.py",
    "orchestration/diagnosis/free_run.c",
    "orchestration/diagnosis/responses.c",
    "fmus/kit/fmi",
)


def digest(paths: Iterable[str]) -> str:
    """Return a digest of modules and folders, with all of this project that they import.

    Parameters
    ----------
    paths : iterable of str

    Returns
    -------
    str
        Twelve hexadecimal digits.
    """
    files = sorted(sources(paths))
    text = "\n".join(f"{file.relative_to(ROOT).as_posix()} {_meaning(file)}" for file in files)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def sources(paths: Iterable[str]) -> set[Path]:
    """Return files of modules and folders, and all of this project that they import."""
    return _with_imported({file for path in paths for file in _modules(ROOT / path)})


def stamp(paths: Iterable[str]) -> str:
    """Return the line for a page."""
    return _LINE.format(digest(paths))


def stamped(page: str) -> str:
    """Return the digest on a page; empty if there is none."""
    found = re.search(re.escape(_LINE).replace(r"\{\}", "([0-9a-f]{12})"), page)
    return found.group(1) if found else ""


def is_outdated(page: str) -> bool:
    """Return whether a page says that its figures are of former code."""
    return OUTDATED in page


def _modules(path: Path) -> list[Path]:
    return (
        [path]
        if path.is_file()
        else [file for kind in ("py", "c", "h") for file in path.rglob(f"*.{kind}")]
    )


def _with_imported(files: set[Path]) -> set[Path]:
    """Return files, and what of this project they import, and what that imports."""
    known = set(files)
    new = set(files)
    while new:
        # what a study itself imports only hands records over
        ours = [
            file
            for file in new
            if file.suffix == ".py" and file.relative_to(ROOT).parts[0] in _OURS
        ]
        new = {other for file in ours for other in _imported(file) if not _carries(other)} - known
        known |= new
    return known


def _carries(file: Path) -> bool:
    return file.relative_to(ROOT).as_posix().startswith(_CARRIES)


def _imported(file: Path) -> Iterator[Path]:
    """Yield modules that a file imports anywhere, through the doors of their packages too."""
    for dotted in imports(file, ROOT):
        name = _behind_door(dotted).split(".")
        if name[0] in _OURS:
            # the name is of a module, or else of something in it; a package on the way to a module
            # adds nothing
            places = ROOT.joinpath(*name), ROOT.joinpath(*name[:-1])
            files = [
                each
                for place in places
                for each in (place / "__init__.py", place.with_suffix(".py"))
            ]
            yield from [each for each in files if each.is_file()][:1]


def _behind_door(dotted: str) -> str:
    """Return the dotted name under which what a package's stub offers is defined.

    Any other name is returned as it is.
    """
    package, _, name = dotted.rpartition(".")
    stub = ROOT.joinpath(*package.split("."), "__init__.pyi")
    if not stub.is_file():
        return dotted
    homes = [home for home in imports(stub, ROOT) if home.rpartition(".")[2] == name]
    return homes[0] if homes else dotted


def _meaning(file: Path) -> str:
    text = file.read_text(encoding="utf-8")
    return (
        _without_remarks(text) if file.suffix == ".py" else _without_empty_lines(text.splitlines())
    )


@cache
def _without_remarks(text: str) -> str:
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            lines[token.start[0] - 1] = lines[token.start[0] - 1][: token.start[1]]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            first, last = node.body[0].lineno, node.body[0].end_lineno or node.body[0].lineno
            lines[first - 1 : last] = [""] * (last - first + 1)
    return _without_empty_lines(lines)


def _without_empty_lines(lines: Iterable[str]) -> str:
    return "\n".join(line.rstrip() for line in lines if line.strip())
