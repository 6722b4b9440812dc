"""Loading of users' classes from Python files, named as ``path/to/file.py:Class``."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from fmus.kit import UserError, suggestion

if TYPE_CHECKING:
    from fmus.kit import Component


def names_class(name: str) -> bool:
    """Return True for ``path/to/file.py:Class``, and for a file of Python without its class."""
    return file_of_class(name).endswith(".py")


def file_of_class(name: str) -> str:
    """Return the file of ``path/to/file.py:Class``, with or without the class."""
    return name if name.endswith(".py") else name.rpartition(":")[0]


def load_class(place: str) -> type[Component]:
    """Load the class of a user's model.

    Parameters
    ----------
    place : str
        ``path/to/file.py:Class``.

    Returns
    -------
    type[Component]
        The same class as long as the file does not change.

    Raises
    ------
    UserError
        If the file cannot be read or run, or has no such component.
    """
    from fmus.kit import Component

    path, name, cls, models = load_subclass(place, Component)
    if not cls.name:
        raise UserError(
            f"{path}: {name} has no name, so it is a base or an effect and no"
            f" model{suggestion(name, models)}"
        )
    loaded: type[Component] = cls
    return loaded


def load_subclass(place: str, base: type) -> tuple[Path, str, Any, list[str]]:
    """Load a class derived from a base from a user's file.

    Parameters
    ----------
    place : str
        ``path/to/file.py:Class``.
    base : type
        The required base class.

    Returns
    -------
    tuple of Path, str, type and list of str
        File and name, the class, and the names of all such classes that the file defines.

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
    known = [
        n
        for n, c in vars(module).items()
        if is_subclass(c, base) and c.__module__ == module.__name__
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
    """Return which classes of a file can be named; a component without a name is an effect."""
    places = [f"{path}:{name}" for name in known if getattr(vars(module)[name], "name", name)]
    if not places:
        return f"there is no {base.__name__} in it"
    return f"name a class in it, such as {', '.join(places)}"


def is_subclass(thing: object, base: type) -> bool:
    """Return whether an object is a class derived from a base."""
    return isinstance(thing, type) and issubclass(thing, base)


def _load(path: Path) -> ModuleType:
    """Run a user's file as a module, once for each of its contents."""
    try:
        text = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    name = f"{path.stem}_{sha256(str(path.resolve()).encode() + text).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.origin is None:
        raise UserError(f"{path}: is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        # the text itself, for bytecode beside it may be of another text, or damaged
        exec(compile(text, spec.origin, "exec", dont_inherit=True), vars(module))
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, (KeyboardInterrupt, GeneratorExit)):
            raise
        raise UserError(_describe_in_one_line(path, error)) from error
    return module


def _describe_in_one_line(path: Path, error: BaseException) -> str:
    """Describe an error in a user's file, with the line of the file."""
    line = _line_number(path, error)
    place = f"{path}, line {line}" if line else str(path)
    return f"{place}: {' '.join(_description(error).split())}"


def _line_number(path: Path, error: BaseException) -> int | None:
    if isinstance(error, SyntaxError):
        return error.lineno
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename) == path]
    return lines[-1] if lines else None


def _description(error: BaseException) -> str:
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg}"
    if isinstance(error, UserError) and str(error):
        return str(error)
    return ": ".join(filter(None, (type(error).__name__, str(error))))
