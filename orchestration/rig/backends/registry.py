"""Registry of backends: those of installed packages by name, those of a user by file and class."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar

from fmus.kit.errors import UserError, suggestion
from fmus.kit.extras import optional
from orchestration.fmu.model import load_subclass, names_class
from orchestration.rig.backends.backend import Backend

_ENTRY_POINTS = "ppy_rig.backends"  # group of the entry points, by which a package brings its own
Result = TypeVar("Result")


def open_backend(spec: str, options: Mapping[str, str]) -> Backend:
    """Open a backend.

    Parameters
    ----------
    spec : str
        Name of an entry point, such as ``emulator`` or ``replay``, or ``path/to/file.py:Class``.
    options : Mapping of str to str
        Options of the backend by name; the error for an unknown one lists those that exist.

    Returns
    -------
    Backend
        Open, and ready for any call.

    Raises
    ------
    UserError
        If there is no such backend, an option is unknown, missing or wrong, a library is not
        installed, or the device cannot be opened.
    """
    cls = _checked_class(spec, options)
    backend = _call(spec, "cannot be opened", cls, options)
    try:
        _check(spec, backend)
    except BaseException:
        backend.close()
        raise
    return backend


def device_names(spec: str, options: Mapping[str, str]) -> tuple[str, ...]:
    """Return names of the devices that a backend would open.

    Parameters
    ----------
    spec, options
        See :func:`open_backend`.

    Returns
    -------
    tuple of str
        Empty for a backend that commands nothing real.

    Raises
    ------
    UserError
        See :func:`open_backend`; and if its names are no texts.
    """
    cls = _checked_class(spec, options)
    names = tuple(_call(spec, "does not say its devices", cls.devices, options))
    if not all(isinstance(name, str) for name in names):
        raise UserError(f"backend {spec}: names of devices must be texts; it says {names!r}")
    return names


def _checked_class(spec: str, options: Mapping[str, str]) -> type[Backend]:
    """Return the class of a backend; UserError if it lacks an option, or needs another one."""
    cls = backend_class(spec)
    known = _options(cls)
    for name in options:
        if name not in known:
            hint = suggestion(name, list(known)) or " (it has none)"
            raise UserError(f"backend {spec}: no option {name!r}{hint}")
    for name, parameter in known.items():
        if parameter.default is parameter.empty and name not in options:
            raise UserError(f"backend {spec}: option {name} is missing; write {name}=...")
    return cls


def _call(
    spec: str, failure: str, function: Callable[..., Result], options: Mapping[str, str]
) -> Result:
    """Call a function of a backend with options; any exception becomes a UserError of one line."""
    try:
        return function(**options)
    except UserError as error:
        raise UserError(f"backend {spec}: {error}") from error
    except Exception as error:  # a backend of somebody else, or a driver, may raise anything
        raise UserError(
            f"backend {spec}: {failure}: {type(error).__name__}: {_one_line(error)}"
        ) from error


@cache
def backends() -> Mapping[str, EntryPoint]:
    """Return the backends that installed packages bring by name; none is loaded for it.

    If two packages have a backend of the same name, ours is returned.
    """
    found = sorted(entry_points(group=_ENTRY_POINTS), key=_is_ours)
    return {entry.name: entry for entry in found}


def _is_ours(entry: EntryPoint) -> bool:
    return entry.dist is not None and entry.dist.name == "ppy-rig"


def backend_class(spec: str) -> type[Backend]:
    """Load the class of a backend, with the libraries that it needs, without opening it.

    Parameters
    ----------
    spec : str
        See :func:`open_backend`.

    Raises
    ------
    UserError
        If there is none, its file cannot be loaded, or a library is not installed.
    """
    if names_class(spec):
        path, name, cls, _ = load_subclass(spec, Backend)
        if inspect.isabstract(cls):
            missing = ", ".join(sorted(cls.__abstractmethods__))
            raise UserError(f"{path}: {name} is no backend yet: it lacks {missing}")
        return cls
    known = backends()
    if spec not in known:
        raise UserError(f"no backend {spec!r}{suggestion(spec, [*known, 'path/to/file.py:Class'])}")
    try:
        with optional():
            return _load(known[spec])
    except UserError:
        raise
    except Exception as error:  # of a package of somebody else
        raise UserError(
            f"backend {spec}: {known[spec].value} cannot be loaded: {type(error).__name__}:"
            f" {_one_line(error)}"
        ) from error


def _load(entry: EntryPoint) -> type[Backend]:
    """Load the class of an entry point; TypeError if it is no backend."""
    loaded = entry.load()
    if not (isinstance(loaded, type) and issubclass(loaded, Backend)):
        raise TypeError("it is no subclass of orchestration.rig.backends.Backend")
    return loaded


def _options(cls: type[Backend]) -> dict[str, inspect.Parameter]:
    """Return the keyword arguments of a class by name."""
    if cls.__init__ is object.__init__:
        return {}
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = list(inspect.signature(cls.__init__).parameters.values())[1:]
    return {parameter.name: parameter for parameter in parameters if parameter.kind in named}


def _check(spec: str, backend: Backend) -> None:
    """Refuse a backend without inputs, outputs or limits, or with limits of an unknown signal."""
    for attribute in ("inputs", "outputs", "limits"):
        if not isinstance(getattr(backend, attribute, None), Mapping):
            raise UserError(
                f"backend {spec}: has no {attribute}; a mapping by name of the signal is wanted"
            )
    for name in backend.limits:
        if name not in backend.inputs and name not in backend.outputs:
            raise UserError(
                f"backend {spec}: limits of {name}, which is neither an input nor an output"
            )


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
