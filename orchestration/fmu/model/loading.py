"""Loading of users' classes by names such as ``path/to/file.py:Class``.

A user's file may import files beside it, as a script may. The statement in the file finds them, and
nothing else does: neither their folder nor their names become known to other modules.
"""

from __future__ import annotations

import builtins
import importlib.util
import re
import sys
import traceback
from collections.abc import Mapping, Sequence
from functools import partial
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from fmus.kit import files, quoting
from fmus.kit.component import keep_call, neighbours_of
from fmus.kit.errors import UserError, suggestion
from fmus.kit.interrupt import raise_interrupt
from orchestration.fmu.model.authoring import check_names, describe, line_of, remarks

if TYPE_CHECKING:
    from fmus.kit import Component

_LOADED: set[str] = set()  # users' files that were loaded


def names_class(name: str) -> bool:
    """Return True for ``path/to/file.py:Class``, with or without the class."""
    return file_of_class(name).endswith(".py")


def file_of_class(name: str) -> str:
    """Return the file of ``path/to/file.py:Class``, with or without the class."""
    return name if name.endswith(".py") else name.rpartition(":")[0]


def load_class(place: str) -> type[Component]:
    """Return the class of a user's model.

    Parameters
    ----------
    place : str
        ``path/to/file.py:Class``.

    Returns
    -------
    type[Component]
        The same object as long as the file does not change.

    Raises
    ------
    UserError
        If the file cannot be read or run or has no such component, or a law has inconsistent units
        or does not work on signals; with the line and the correction.
    """
    from fmus.kit import Component
    from fmus.kit.symbolic import check_component

    path, name, cls, models = load_subclass(place, Component)
    if not cls.name:
        raise UserError(_nameless(path, name, cls, models))
    check_component(cls)
    loaded: type[Component] = cls
    return loaded


def _nameless(path: Path, name: str, cls: Any, models: list[str]) -> str:
    """Return the message for a class that is no model: an effect, or a component without a name."""
    from fmus.kit import Effect

    line = line_of(path.read_bytes(), name)
    place = f"{path}, line {line}" if line else str(path)
    if is_subclass(cls, Effect):
        base = "file.py:Component" if not models else f"{path}:{models[0]}"
        return (
            f"{place}: {name} is an effect and no model; name the model to which it is added, as"
            f" {base}"
        )
    others = [model for model in models if model != name]
    snake_case = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    return (
        f'{place}: {name} has no name, so it is a base and no model; write name = "{snake_case}"'
        f" into its body{suggestion(name, others, few=0) if others else ''}"
    )


def load_subclass(place: str, base: type) -> tuple[Path, str, Any, list[str]]:
    """Return a class of a user's file that is derived from a base.

    Parameters
    ----------
    place : str
        ``path/to/file.py:Class``.
    base : type
        The required base class.

    Returns
    -------
    path : Path
        The file.
    name : str
    cls : type
    names : list of str
        All classes in the file that are derived from the base.

    Raises
    ------
    UserError
        If the file cannot be read or run, or has no such class.
    """
    file = file_of_class(place)
    name = place.removeprefix(file).removeprefix(":")
    if not file or place.endswith(":"):
        raise UserError(f"{place}: write path/to/file.py:Class")
    path = Path(file)
    module = _load(path)
    # imported classes are of other modules
    known = [
        name_of_class
        for name_of_class, member in vars(module).items()
        if is_subclass(member, base) and member.__module__ == module.__name__
    ]
    if not name:
        raise UserError(f"{path}: {_classes_to_name(path, module, known, base)}")
    cls: Any = getattr(module, name, None)
    if cls is None:
        raise UserError(f"{path}: there is no class {name!r} in it{suggestion(name, known)}")
    if not is_subclass(cls, base):
        raise UserError(f"{path}: {name} is not a {base.__name__}{suggestion(name, known)}")
    return path, name, cls, known


def _classes_to_name(path: Path, module: ModuleType, known: list[str], base: type) -> str:
    """Return a message that lists the classes of a file, without components that have no name."""
    places = [f"{path}:{name}" for name in known if getattr(vars(module)[name], "name", name)]
    if not places:
        return f"there is no {base.__name__} in it"
    return f"name a class in it, such as {', '.join(places)}"


def is_subclass(thing: object, base: type) -> bool:
    """Return whether an object is a class derived from a base."""
    return isinstance(thing, type) and issubclass(thing, base)


def _load(path: Path) -> ModuleType:
    """Return a user's file as a module, which is run again only if its contents have changed.

    Raises
    ------
    UserError
        If it cannot be read or run.
    """
    try:
        text = files.contents(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    return _run(path, text)


def _run(path: Path, text: bytes) -> ModuleType:
    """Return the text of a file as a module, which is run once; UserError if that fails."""
    check_names(path, text)
    name = _module_name(path, text)
    if name in sys.modules and _is_current(sys.modules[name], set()):
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.origin is None:
        raise UserError(f"{path}: is not a Python file")
    module = importlib.util.module_from_spec(spec)
    vars(module)["__builtins__"] = vars(builtins) | {"__import__": partial(_import, module)}
    sys.modules[name] = module
    try:
        # not by the import system, whose cached bytecode may be outdated or damaged
        exec(compile(text, spec.origin, "exec", dont_inherit=True), vars(module))
    except BaseException as error:
        del sys.modules[name]
        raise_interrupt(error)
        if isinstance(error, GeneratorExit):
            raise
        raise UserError(describe(path, text, error)) from error
    _LOADED.add(spec.origin)
    keep_call(module, partial(_run, path, text))
    return module


def _module_name(path: Path, text: bytes) -> str:
    """Return the name of a user's file in ``sys.modules``, another one for other contents."""
    digest = sha256(str(path.resolve()).encode(errors="surrogateescape") + text).hexdigest()
    return f"{quoting.identifier(path.stem, 'model')}_{digest[:12]}"


def _is_current(module: ModuleType, known: set[str]) -> bool:
    """Return whether the files that a user's file imported have not changed since.

    Parameters
    ----------
    module : ModuleType
    known : set of str
        Modules that are not looked at again, since files may import each other.
    """
    known.add(module.__name__)
    for neighbour in neighbours_of(module).values():
        path = Path(str(neighbour.__file__))
        if not path.is_file() or _module_name(path, files.contents(path)) != neighbour.__name__:
            return False
        if neighbour.__name__ not in known and not _is_current(neighbour, known):
            return False
    return True


def _import(
    module: ModuleType,
    name: str,
    context: Mapping[str, Any] | None = None,
    local: Mapping[str, Any] | None = None,
    fromlist: Sequence[str] = (),
    level: int = 0,
) -> ModuleType:
    """Import for a user's file: as Python does, but first from its folder."""
    beside = Path(str(module.__file__)).with_name(f"{name}.py")
    if level or name in sys.stdlib_module_names or not beside.is_file() or _finds(name, beside):
        return builtins.__import__(name, context, local, fromlist, level)
    return neighbours_of(module).setdefault(name, _load(beside))


def _finds(name: str, file: Path) -> bool:
    """Return whether Python finds this very file by a name, which it then has everywhere."""
    if name in sys.modules:
        origin = getattr(sys.modules[name], "__file__", None)
    else:
        origin = getattr(importlib.util.find_spec(name), "origin", None)
    return origin is not None and Path(origin).resolve() == file.resolve()


def remarks_on(place: str) -> tuple[str, ...]:
    """Return remarks on the class of a user's model; see `authoring.remarks`.

    Parameters
    ----------
    place : str
        ``path/to/file.py:Class`` of a class that can be loaded.

    Returns
    -------
    tuple of str
    """
    file, _, name = place.rpartition(":")
    return remarks(Path(file), Path(file).read_bytes(), name)


def faulty_place(error: BaseException) -> str:
    """Return the place in a user's file where an error was raised.

    Parameters
    ----------
    error : BaseException

    Returns
    -------
    str
        File, line and function; empty if no user's file was involved.
    """
    place = ""
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename in _LOADED:
            place = f"{frame.filename}, line {frame.lineno}, in {frame.name}"
    return place
