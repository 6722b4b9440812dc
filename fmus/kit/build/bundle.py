"""Python modules that travel inside a Python FMU: a component's own, and what they import beside the kit.

The package in an FMU is imported under a name that is unique to it, so everything in it must be imported relatively.
Our components are written that way. A user's model says ``from fmus.kit import ...``; that is rewritten on the way in.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fmus.kit.component import Component
from fmus.kit.errors import UserError

# Light modules of the kit: they need nothing beyond the standard library.
RUNTIME_MODULES = (
    "__init__",
    "arms",
    "component",
    "corrections",
    "curves",
    "declare",
    "engine",
    "errors",
    "functions",
    "generic",
    "inputs",
    "integrate",
    "layout",
    "memory",
    "sensors",
    "slave",
)
_KIT = "fmus.kit"
_OURS = _KIT.partition(".")[0]
_FILES, _PACKAGES = (
    "models",
    "packages",
)  # folders of modules that are not ours: single files, and parts of packages
_PLACEHOLDER = b'"""Part of a Python FMU."""\n'


@dataclass
class Bundle:
    """Modules collected so far.

    Attributes
    ----------
    files : dict of str to bytes
        Path below the root of the package to contents.
    places : dict of str to str
        Module name outside to dotted name below the root of the package.
    needs : collection of str
        Packages that are not brought along, and may be imported all the same.
    """

    files: dict[str, bytes] = field(default_factory=dict)
    places: dict[str, str] = field(default_factory=dict)
    needs: Collection[str] = ()

    def add(self, module: str) -> str:
        """Take in a module and all it imports of ours and of the user's.

        Parameters
        ----------
        module : str
            Name in ``sys.modules``, or one that can be imported.

        Returns
        -------
        str
            Dotted name below the root of the package.

        Raises
        ------
        UserError
            If its source cannot be found, or it imports what an FMU cannot bring along.
        """
        if module in self.places:
            return self.places[module]
        source = _source(module)
        place = self.places[module] = self._place(module, source)
        is_package = source.name == "__init__.py"
        folders = place.split(".") if is_package else place.split(".")[:-1]
        for depth in range(len(folders)):
            self.files.setdefault("/".join([*folders[: depth + 1], "__init__.py"]), _PLACEHOLDER)
        text = self._rewritten(module, source, len(folders))
        self.files[place.replace(".", "/") + ("/__init__.py" if is_package else ".py")] = text
        return place

    def _place(self, module: str, source: Path) -> str:
        if "." in module:
            return place_of(module)
        stem = re.sub(r"\W", "_", source.stem)
        taken = set(self.places.values())
        names = (f"{_FILES}.{stem}" + (f"_{n}" if n > 1 else "") for n in range(1, len(taken) + 2))
        return next(name for name in names if name not in taken)

    def _rewritten(self, module: str, source: Path, depth: int) -> bytes:
        """Text of the module with every absolute import of ours or the user's made relative."""
        text = source.read_text(encoding="utf-8")
        lines = text.split("\n")
        for node in _imports(ast.parse(text, str(source))):
            if isinstance(node, ast.Import):
                _check_plain_import(node, source, self.needs)
                continue
            wanted = self._target(module, source, node)
            if wanted is not None and node.level == 0:
                # columns of ast count bytes
                line = lines[node.lineno - 1].encode()
                before, statement = (
                    line[: node.col_offset].decode(),
                    line[node.col_offset :].decode(),
                )
                relative = "." * (depth + 1) + wanted
                lines[node.lineno - 1] = before + re.sub(
                    r"^from\s+[\w.]+", f"from {relative}", statement, count=1
                )
        return "\n".join(lines).encode()

    def _target(self, module: str, source: Path, node: ast.ImportFrom) -> str | None:
        """Where a module that is imported from is in the package; None if it is in the standard library."""
        where = f"{source}, line {node.lineno}"
        package = module if source.name == "__init__.py" else module.rpartition(".")[0]
        name = "." * node.level + (node.module or "")
        if node.level and not package:
            raise UserError(
                f"{where}: 'from {name} import' needs a package, but {source.name} was loaded by itself"
            )
        name = importlib.util.resolve_name(name, package) if node.level else name
        if name.split(".")[0] in (*sys.stdlib_module_names, *self.needs):
            return None
        modules = {
            f"{name}.{alias.name}" for alias in node.names if _is_module(f"{name}.{alias.name}")
        }
        if len(modules) < len(node.names):
            modules.add(name)  # some of the names are defined in it
        if name == _KIT or name.startswith(f"{_KIT}."):
            absent = sorted(
                m for m in modules - {_KIT} if m.removeprefix(f"{_KIT}.") not in RUNTIME_MODULES
            )
            if absent:
                raise UserError(
                    f"{where}: {absent[0]} is not part of a Python FMU; it needs more than Python itself"
                )
            return name.removeprefix(f"{_OURS}.")
        if not name.startswith(f"{_OURS}.") and name.split(".")[0] != package.split(".")[0]:
            raise UserError(
                f"{where}: {name} cannot go into a Python FMU, which brings the standard library, {_KIT} and modules "
                "of the model's own package only"
            )
        for wanted in sorted(modules):
            self.add(wanted)
        return place_of(name)


def place_of(module: str) -> str:
    """Dotted name of a module below the root of the package, for one that is in a package outside."""
    return (
        module.removeprefix(f"{_OURS}.")
        if module.startswith(f"{_OURS}.")
        else f"{_PACKAGES}.{module}"
    )


def _check_plain_import(node: ast.Import, source: Path, needs: Collection[str]) -> None:
    for alias in node.names:
        if alias.name.split(".")[0] not in (*sys.stdlib_module_names, *needs):
            raise UserError(
                f"{source}, line {node.lineno}: 'import {alias.name}' cannot go into a Python FMU, which brings the "
                f"standard library and {_KIT} only; write 'from {_KIT} import ...', or 'from .module import ...' for "
                "a module of the model's own package"
            )


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ImportError:  # what should contain it is no package
        return False


def _source(module: str) -> Path:
    loaded = sys.modules.get(module)
    path = getattr(loaded, "__file__", None)
    if loaded is None:
        spec = importlib.util.find_spec(module)
        path = spec.origin if spec else None
    if path is None or not Path(path).is_file():
        raise UserError(
            f"the source of module {module!r} is not in a file, so it cannot go into a Python FMU"
        )
    return Path(path)


def _imports(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Every import that is carried out at run time, in functions too."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node
        elif isinstance(node, ast.If) and ast.unparse(node.test) in (
            "TYPE_CHECKING",
            "typing.TYPE_CHECKING",
        ):
            for branch in node.orelse:
                yield from _imports(ast.Module([branch], []))
        else:
            yield from _imports(node)


def bundle(
    classes: Iterable[type[Component]], modules: Iterable[str] = (), needs: Collection[str] = ()
) -> tuple[dict[str, bytes], dict[type[Component], tuple[str, str]]]:
    """Collect the modules of some classes.

    Parameters
    ----------
    classes : iterable of type
        Components and effects.
    modules : iterable of str
        What has to go with them.
    needs : collection of str
        Packages that are not brought along, and may be imported all the same.

    Returns
    -------
    files : dict of str to bytes
        Path below the root of the package to contents; the kit's own modules are not among them.
    places : dict of type to tuple of str
        For each class the dotted name, below that root, of the module to import from, and what to import: the class,
        or the function that makes it.

    Raises
    ------
    UserError
        If a class is not at the top of a file, or its module imports what an FMU cannot bring along.
    """
    collected, places = Bundle(needs=needs), {}
    for wanted_module in modules:
        collected.add(wanted_module)
    for cls in classes:
        wanted: Any = vars(cls).get("made_by", cls)
        module, name = wanted.__module__, wanted.__name__
        if (
            wanted.__qualname__ != name
            or getattr(sys.modules.get(module), name, None) is not wanted
        ):
            raise UserError(
                f"{cls.__qualname__} is not defined at the top of a module: a Python FMU cannot import it"
            )
        of_kit = module.startswith(f"{_KIT}.")  # it is there already
        places[cls] = place_of(module) if of_kit else collected.add(module), name
    return collected.files, places
