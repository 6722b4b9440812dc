"""Imports between modules of the product, at once or when a function is called."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from docs.draw_architecture import import_statements

ROOT = Path(__file__).parents[2]
PACKAGES = ("fmus", "orchestration")
_FOR_TYPES = re.compile(r"^( *)if TYPE_CHECKING:\n(?:\1 +.*\n?|\n)*", re.M)


def module_graph(root: Path = ROOT) -> dict[str, set[str]]:
    """Return the modules that each module imports.

    An import by the door of a package is one of the module where the name is defined. Those for
    types alone are left out, as they are never made.
    """
    files = {_dotted(path, root): path for top in PACKAGES for path in (root / top).rglob("*.py")}
    graph = {}
    for module, path in files.items():
        text = path.read_text(encoding="utf-8")
        package = module if path.name == "__init__.py" else module.rpartition(".")[0]
        named = {_defining(*pair, files) for pair in _named(text, package)}
        graph[module] = named & files.keys() - {module}
    return graph


def _dotted(path: Path, root: Path) -> str:
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def _named(text: str, package: str) -> Iterator[tuple[str, str]]:
    """Yield module and name of every import in a source."""
    for node in import_statements(_FOR_TYPES.sub("", text)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")
            above = parts[: len(parts) + 1 - node.level] if node.level else []
            module = ".".join(filter(None, (*above, node.module)))
            yield from ((module, alias.name) for alias in node.names)


def _defining(module: str, name: str, files: dict[str, Path]) -> str:
    """Return the module that defines what is imported from another by a name."""
    if f"{module}.{name}" in files:
        return f"{module}.{name}"
    offered = _offered(module, files[module]) if module in files else {}
    return _defining(*offered[name], files) if name in offered else module


@cache
def _offered(package: str, path: Path) -> dict[str, tuple[str, str]]:
    """Return module and name of everything that the stub of a package offers."""
    stub = path.with_suffix(".pyi")
    if path.name != "__init__.py" or not stub.exists():
        return {}
    text = stub.read_text(encoding="utf-8")
    return {name: (module, name) for module, name in _named(text, package)}
