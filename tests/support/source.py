"""The names that the source defines, read without importing it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]


@cache
def modules() -> dict[str, Path]:
    """Every module and package of the source and the tests by its dotted name."""
    found = {}
    for folder in (
        "fmus",
        "orchestration",
        "ppy_rig",
        "demonstrations",
        "studies",
        "tests",
        "benchmarks",
    ):
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            stub = path.with_suffix(".pyi")  # what a package whose names are loaded on use offers
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = stub if stub.exists() else path
    return found


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


FOLDERS = (
    "fmus",
    "orchestration",
    "ppy_rig",
    "demonstrations",
    "studies",
    "tests",
    "benchmarks",
)


def _bound(body: list[ast.stmt]) -> Iterator[tuple[str, ast.stmt]]:
    """Names that a class or a module binds, not inside its functions, and the statement that
    does.
    """
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node
        elif isinstance(node, ast.Import | ast.ImportFrom):
            yield from ((alias.asname or alias.name, node) for alias in node.names)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (
                (n.id, node) for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)
            )
        elif isinstance(node, ast.If | ast.Try | ast.With):
            inner = [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.stmt)]
            yield from _bound(inner)


def members(module: str) -> dict[str, ast.stmt]:
    """Return the members of a module, by name."""
    return dict(_bound(_tree(modules()[module]).body))


def attributes(cls: ast.ClassDef) -> set[str]:
    """Fields, methods and what methods assign to ``self``."""
    own = {
        node.attr
        for node in ast.walk(cls)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
        and isinstance(node.ctx, ast.Store)
    }
    return own | {name for name, _ in _bound(cls.body)}


def exists(dotted: str) -> bool:
    """Return True if a full name such as ``orchestration.fmu.model.Model.inputs`` exists."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        module = ".".join(parts[:count])
        if module in modules():
            return _within(module, parts[count:])
    return False


def _within(module: str, names: list[str]) -> bool:
    if not names:
        return True
    node = members(module).get(names[0])
    if node is None or len(names) == 1:
        return node is not None
    if isinstance(node, ast.ImportFrom):  # passed on from elsewhere, where it is looked for
        package = (
            module.split(".") if modules()[module].stem == "__init__" else module.split(".")[:-1]
        )
        above = package[: len(package) + 1 - node.level] if node.level else []
        return exists(".".join([*above, *filter(None, [node.module]), *names]))
    return isinstance(node, ast.ClassDef) and names[1] in attributes(node)


@cache
def defines(name: str) -> bool:
    """Return True if the product defines a name: a class, function, method, field, parameter or
    constant, or ``Class.field``.
    """
    cls, _, field = name.rpartition(".")
    if not cls:
        return any(name in names or name in path.parts for path, names in _definitions().items())
    paths = [path for path, names in _definitions().items() if cls in names]
    return any(
        field in attributes(node)
        for path in paths
        for node in ast.walk(_tree(path))
        if isinstance(node, ast.ClassDef) and node.name == cls
    )


@cache
def _definitions() -> dict[Path, set[str]]:
    """Names before a colon, comma, bracket or ``=``, by file; to walk all trees takes seconds."""
    pattern = re.compile(r"(?:\b(?:def|class) |self\.|[(,] *|^ *)(\w+)(?= *[:=,()])", re.M)
    return {
        path: set(pattern.findall(path.read_text(encoding="utf-8")))
        for module, path in modules().items()
        if module.split(".")[0] in ("fmus", "orchestration", "demonstrations")
    }
