"""Which code drew a page: a digest of what its modules do, whatever their comments, docstrings and layout are."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
_LINE = "Drawn with the code `{}`; `tests/end_to_end/test_studies.py` fails where the code has become another."
_DOCUMENTED = ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef
# what a diagnosis is made of, and what its yardstick is drawn with
DIAGNOSIS = (
    "fmus/kit", "orchestration/discrepancy/candidates", "orchestration/discrepancy/data",
    "orchestration/discrepancy/residuals", "orchestration/discrepancy/selection",
    "orchestration/discrepancy/validation", "orchestration/discrepancy/diagnosis.py", "orchestration/identify",
)  # fmt: skip


def digest(paths: Iterable[str]) -> str:
    """Digest of modules, and of all in folders, relative to the root.

    Parameters
    ----------
    paths : iterable of str

    Returns
    -------
    str
        Twelve hexadecimal digits.
    """
    files = sorted(file for path in paths for file in _modules(ROOT / path))
    text = "\n".join(f"{file.relative_to(ROOT).as_posix()} {_meaning(file)}" for file in files)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def stamp(paths: Iterable[str]) -> str:
    """Line for a page."""
    return _LINE.format(digest(paths))


def stamped(page: str) -> str:
    """Digest on a page; empty if there is none."""
    found = re.search(re.escape(_LINE).replace(r"\{\}", "([0-9a-f]{12})"), page)
    return found.group(1) if found else ""


def _modules(path: Path) -> list[Path]:
    return [path] if path.is_file() else list(path.rglob("*.py"))


def _meaning(file: Path) -> str:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.dump(tree)
