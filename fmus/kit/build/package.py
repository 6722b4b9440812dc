"""The Python package of a Python FMU: modules of the kit, of the component, and an entry module.

Each FMU imports its package under a unique name, so that all imports within the package must be
relative. The components of this project are written that way. The statement ``from fmus.kit import
...`` of a user's model is rewritten.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from fmus.kit import quoting
from fmus.kit.component import Component, neighbours_of
from fmus.kit.effects import made_by, made_with, stacked_with, unstack
from fmus.kit.errors import UserError
from fmus.kit.layout import law_of

# modules of the kit that every Python FMU contains; they need only the standard library
RUNTIME_MODULES = (
    "__init__",
    "arms",
    "component",
    "curves",
    "declare",
    "delay_line",
    "effects",
    "errors",
    "functions",
    "generic",
    "inputs",
    "integrate",
    "law_terms",
    "layout",
    "ports",
    "sampling",
    "sensors",
    "sharing",
    "slave",
    "titles",
)
_KIT = "fmus.kit"
_KIT_FOLDER = Path(__file__).parents[1]
_OURS = _KIT.partition(".")[0]
# folders for modules of users
_FILES = "models"  # single files
_PACKAGES = "packages"  # parts of packages
_PLACEHOLDER = b'"""Part of a Python FMU."""\n'
_PYTHON = "Python 3.11 or newer (shared library or host process)"
_ALONE = f"{_PYTHON}; no packages beyond the standard library.\n"


def python_package(cls: type[Component]) -> dict[str, bytes]:
    """Return the files that Python needs at run time.

    Parameters
    ----------
    cls : type[Component]
        A component, possibly with effects stacked on it.

    Returns
    -------
    dict of str to bytes
        Path in the archive to contents: the package in ``resources/python`` and a note on the
        packages that must be installed.

    Raises
    ------
    UserError
        See :func:`.bundle`.
    """
    base, effects = unstack(cls)
    if cls.engine is None:
        slave_import = "from .kit.slave import Slave"
        engine_modules: list[str] = []
        needs: Mapping[str, str] = {}
    else:
        module, slave = cls.engine.slave.split(":")
        slave_import = f"from .{name_in_package(module)} import {slave} as Slave"
        engine_modules = [module]
        needs = cls.engine.needs
    modules, places = bundle((base, *effects), engine_modules, needs)
    for name in RUNTIME_MODULES:
        modules[f"kit/{name}.py"] = (_KIT_FOLDER / f"{name}.py").read_bytes()
    modules["__init__.py"] = _entry(cls, places, slave_import).encode()
    packed = {f"resources/python/{name}": contents for name, contents in modules.items()}
    note = f"{_PYTHON} with {', '.join(needs.values())} installed.\n" if needs else _ALONE
    return packed | {"documentation/externalDependencies.txt": note.encode()}


def _entry(
    cls: type[Component], places: dict[type[Component], tuple[str, str]], slave_import: str
) -> str:
    """Write the module that rebuilds the component's class and defines ``create``.

    ``fmi/python.c`` calls ``create``. `places` is that of :func:`bundle`; `slave_import` is the
    statement that imports the class of an instance.
    """
    base, effects = unstack(cls)
    # classes of different modules may share a name
    parts = {used: f"Part{n}" for n, used in enumerate(places)}
    imports = ["from .kit import stack", *_argument_imports(effects), slave_import]
    for used, (place, name) in places.items():
        imports.append(f"from .{place} import {name} as {parts[used]}")
    model = parts[base] if cls is base else _stack_expression(cls, parts)
    lines = [
        '"""The component of this FMU; laws are in the folder beside."""',
        "",
        *sorted(imports),
        "",
        f"MODEL = {model}",
        "",
        "",
        "def create(memory, texts):",
        "    return Slave(MODEL, memory, texts)",
    ]
    return "\n".join(lines) + "\n"


def _stack_expression(cls: type[Component], parts: dict[type[Component], str]) -> str:
    """Return the call that stacks effects on a component; `parts` as in `_class_expression`."""
    base, effects = unstack(cls)
    stacked = ", ".join(_class_expression(used, parts) for used in (base, *effects))
    values = stacked_with(cls)
    defaults = f", defaults={values!r}" if values else ""
    return f"stack({stacked}, name={cls.name!r}{defaults})"


def _argument_imports(effects: Iterable[type[Component]]) -> set[str]:
    """Return the import statements for the dataclasses among the arguments of effects."""
    values = [value for effect in effects for value in made_with(effect).values()]
    kinds = {type(value) for value in values if is_dataclass(value)}
    return {f"from .{name_in_package(kind.__module__)} import {kind.__name__}" for kind in kinds}


def _class_expression(cls: type[Component], parts: dict[type[Component], str]) -> str:
    """Return the expression for a class in the entry module.

    For an effect that was made for an output, a law or an input it is the call that makes it. The
    first argument of the call is then a class that has this output, law or input.

    Parameters
    ----------
    cls : type[Component]
        Component or effect.
    parts : dict of type to str
        Names in the entry module, of classes or of functions that make them.
    """
    arguments = made_with(cls)
    if not arguments:
        return parts[cls]
    subject = next(iter(arguments.values()))  # the output, the law or the input
    owner = next(
        name
        for part, name in parts.items()
        if law_of(part, subject) is not None or subject in {v.name for v in part.layout.inputs}
    )
    written = [f"{name}={value!r}" for name, value in arguments.items()]
    return f"{parts[cls]}({', '.join([owner, *written])})"


def bundle(
    classes: Iterable[type[Component]], modules: Iterable[str] = (), needs: Collection[str] = ()
) -> tuple[dict[str, bytes], dict[type[Component], tuple[str, str]]]:
    """Collect the modules that define classes.

    Parameters
    ----------
    classes : iterable of type
        Components and effects.
    modules : iterable of str
        Further modules to collect.
    needs : collection of str
        Packages that must be installed, which modules may import.

    Returns
    -------
    files : dict of str to bytes
        Path below the root of the package to contents; the kit's own modules are not among them.
    places : dict of type to tuple of str
        For each class the module to import from, as a dotted name below that root, and the name to
        import: of the class, or of the function that makes it.

    Raises
    ------
    UserError
        If a class is not at the top of a file, or its module imports something that an FMU cannot
        contain.
    """
    collected = Bundle(needs=needs)
    for module in modules:
        collected.add(module)
    places = {}
    for cls in classes:
        places[cls] = _collect_class(cls, collected)
    return collected.files, places


def _collect_class(cls: type[Component], collected: Bundle) -> tuple[str, str]:
    """Collect the module of a class, or of the function that makes it; return module and name."""
    source: Any = made_by(cls) or cls
    module = source.__module__
    name = source.__name__
    is_at_top = getattr(sys.modules.get(module), name, None) is source
    if source.__qualname__ != name or not is_at_top:
        raise UserError(
            f"{cls.__qualname__} is not defined at the top of a module: a Python FMU cannot"
            " import it"
        )
    if module.startswith(f"{_KIT}."):  # every package has it
        return name_in_package(module), name
    return collected.add(module), name


@dataclass
class Bundle:
    """A collection of modules for the package of an FMU.

    Attributes
    ----------
    files : dict of str to bytes
        Path below the root of the package to contents.
    places : dict of str to str
        Original name of a module to its dotted name below the root of the package.
    needs : collection of str
        Packages that must be installed, which modules may import.
    """

    files: dict[str, bytes] = field(default_factory=dict)
    places: dict[str, str] = field(default_factory=dict)
    needs: Collection[str] = ()

    def add(self, module: str) -> str:
        """Add a module, with all modules of this project and of the user that it imports.

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
            If its source is in no file, or it imports something that an FMU cannot contain.
        """
        if module in self.places:
            return self.places[module]
        source = _source_file(module)
        place = self._new_name(module, source)
        self.places[module] = place
        is_package = source.name == "__init__.py"
        path = PurePosixPath(*place.split("."))
        file = path / "__init__.py" if is_package else path.with_suffix(".py")
        *folders, _ = file.parents  # from the innermost, without the root
        for folder in reversed(folders):
            self.files.setdefault(str(folder / "__init__.py"), _PLACEHOLDER)
        self.files[str(file)] = self._rewritten(module, source, len(folders))
        return place

    def _new_name(self, module: str, source: Path) -> str:
        """Return a dotted name below the root of the package for a module that is to be added."""
        if "." in module:
            return name_in_package(module)
        stem = quoting.identifier(source.stem, "model")
        taken = set(self.places.values())
        name = f"{_FILES}.{stem}"
        number = 1
        while name in taken:
            number += 1
            name = f"{_FILES}.{stem}_{number}"
        return name

    def _rewritten(self, module: str, source: Path, depth: int) -> bytes:
        """Return the text of a module, with absolute imports of collected modules made relative."""
        text = source.read_text(encoding="utf-8")
        lines = text.split("\n")
        for node in _imports(ast.parse(text, str(source))):
            if isinstance(node, ast.Import):
                _check_plain_import(node, source, self.needs)
                continue
            target = self._collect_target(module, source, node)
            if target is None or node.level:
                continue
            # columns of ast count bytes
            line = lines[node.lineno - 1].encode()
            before = line[: node.col_offset].decode()
            statement = line[node.col_offset :].decode()
            relative = "." * (depth + 1) + target
            lines[node.lineno - 1] = before + re.sub(
                r"^from\s+[\w.]+", f"from {relative}", statement, count=1
            )
        return "\n".join(lines).encode()

    def _collect_target(self, module: str, source: Path, node: ast.ImportFrom) -> str | None:
        """Add the modules that a statement imports from, and return the dotted name to write.

        None if they are in the standard library or in a package that must be installed.

        Raises
        ------
        UserError
            If an FMU cannot contain them.
        """
        where = f"{source}, line {node.lineno}"
        # `__package__` of the module, in which a relative import is resolved
        package = module if source.name == "__init__.py" else module.rpartition(".")[0]
        written = "." * node.level + (node.module or "")
        if node.level and not package:
            raise UserError(
                f"{where}: 'from {written} import' needs a package, but {source.name} was loaded by"
                " itself"
            )
        name = importlib.util.resolve_name(written, package) if node.level else written
        if name.split(".")[0] in (*sys.stdlib_module_names, *self.needs):
            return None
        beside = neighbours_of(sys.modules[module]).get(name) if module in sys.modules else None
        if beside is not None:
            return self.add(beside.__name__)
        modules = _imported_modules(name, node)
        if name == _KIT or name.startswith(f"{_KIT}."):
            _check_kit_modules(modules, where)
            return name.removeprefix(f"{_OURS}.")
        if not name.startswith(f"{_OURS}.") and name.split(".")[0] != package.split(".")[0]:
            raise UserError(
                f"{where}: {name} cannot go into a Python FMU, which brings the standard library,"
                f" {_KIT}, files beside the model's and modules of its own package only"
            )
        for imported in sorted(modules):
            self.add(imported)
        return name_in_package(name)


def name_in_package(module: str) -> str:
    """Return the dotted name, below the root of an FMU's package, of a module of a package."""
    if module.startswith(f"{_OURS}."):
        return module.removeprefix(f"{_OURS}.")
    return f"{_PACKAGES}.{module}"


def _imported_modules(name: str, node: ast.ImportFrom) -> set[str]:
    """Return the modules that ``from name import ...`` needs: submodules, and the module itself."""
    names = {f"{name}.{alias.name}" for alias in node.names}
    modules = set(filter(_is_module, names))
    if len(modules) < len(node.names):
        modules.add(name)  # some of the names are defined in it
    return modules


def _check_kit_modules(modules: set[str], where: str) -> None:
    """Raise an error unless every Python FMU contains these modules of the kit."""
    absent = sorted(
        m for m in modules - {_KIT} if m.removeprefix(f"{_KIT}.") not in RUNTIME_MODULES
    )
    if absent:
        raise UserError(
            f"{where}: {absent[0]} is not part of a Python FMU; it needs more than Python itself"
        )


def _check_plain_import(node: ast.Import, source: Path, needs: Collection[str]) -> None:
    """Raise an error unless ``import name`` is of the standard library or an allowed package."""
    for alias in node.names:
        if alias.name.split(".")[0] not in (*sys.stdlib_module_names, *needs):
            raise UserError(
                f"{source}, line {node.lineno}: 'import {alias.name}' cannot go into a Python FMU,"
                f" which brings the standard library and {_KIT} only; write 'from {_KIT} import"
                " ...', or 'from module import ...' for a file beside the model's, 'from .module"
                " import ...' for a module of its own package"
            )


def _is_module(name: str) -> bool:
    """Return whether a name is that of a module that can be imported."""
    try:
        return importlib.util.find_spec(name) is not None
    except ImportError:  # the name before the last point is no package
        return False


def _source_file(module: str) -> Path:
    """Return the source file of a module, which need not be loaded."""
    if module in sys.modules:
        path = getattr(sys.modules[module], "__file__", None)
    else:
        path = getattr(importlib.util.find_spec(module), "origin", None)
    if path is None or not Path(path).is_file():
        raise UserError(
            f"the source of module {module!r} is not in a file, so it cannot go into a Python FMU"
        )
    return Path(path)


def _imports(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield every import that is executed at run time, also within functions."""
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
