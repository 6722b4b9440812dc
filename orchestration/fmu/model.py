"""What a user may name where a model is wanted: one of our components, or any FMU file."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.archive import read_description
from orchestration.fmu.signal import Signal, read_setting, read_signal

if TYPE_CHECKING:
    from fmus.kit import Component, Effect


@dataclass(frozen=True)
class Model:
    """An FMU to run, and the class behind it if it is ours.

    Attributes
    ----------
    name : str
    path : Path
        The FMU file.
    cls : type[Component] or None
    inputs, outputs, parameters : dict of str to Signal
    """

    name: str
    path: Path
    cls: type[Component] | None
    inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]
    parameters: Mapping[str, Signal]

    def settings(self, texts: Sequence[str], preset: str | None = None) -> dict[str, float]:
        """Read ``name=value[unit]`` settings, after those of a preset.

        Parameters
        ----------
        texts : sequence of str
            Each like ``R1=0.61``, ``R1=610mohm`` or ``k1=6.3[N/mm]``.
        preset : str, optional
            Name of one of the component's presets.

        Returns
        -------
        dict of str to float
            Values in the FMU's units.

        Raises
        ------
        UserError
            For an unknown parameter or preset, a wrong unit, a value out of range.
        """
        values: dict[str, float] = {}
        if preset is not None:
            presets = self.cls.presets if self.cls else {}
            if preset not in presets:
                raise UserError(f"{self.name}: no preset named {preset!r}; there are: {', '.join(presets) or 'none'}")
            values |= dict(presets[preset].values)
        for text in texts:
            name, equals, given = text.partition("=")
            if not equals:
                raise UserError(f"--set {text!r}: write name=value or name=value[unit]")
            values[name.strip()] = self._setting(name.strip(), given)
        return values

    def _setting(self, name: str, given: str) -> float:
        signal = self.parameters.get(name) or self.inputs.get(name)
        if signal is None:
            raise UserError(
                f"{self.name}: no parameter named {name!r}{suggestion(name, [*self.parameters, *self.inputs])}"
            )
        return read_setting(given, signal, f"--set {name}={given}")


def find_model(name_or_path: str, runtime: str = "native", laid_over: Sequence[str] = ()) -> Model:
    """Find a model by component name or path; a component is built if it is not in the cache.

    Parameters
    ----------
    name_or_path : str
        One of our components, an FMU file, or ``path/to/file.py:Class``.
    runtime : {"native", "python"}
        Which build of a component.
    laid_over : sequence of str
        Ids of effects over a component, innermost first.

    Raises
    ------
    UserError
        If there is no such component, class, effect or file, or the FMU cannot be read.
    """
    from fmus import COMPONENTS, component

    cls = None
    if name_or_path in COMPONENTS or names_class(name_or_path):
        from fmus.kit import stack
        from fmus.kit.build import build_cached

        cls = component(name_or_path) if name_or_path in COMPONENTS else load_class(name_or_path)
        known = catalogue(cls) if laid_over else {}
        for effect in laid_over:
            if effect not in known:
                raise UserError(f"{name_or_path}: no effect named {effect!r}{suggestion(effect, known)}")
        cls = stack(cls, *(known[effect] for effect in laid_over)) if laid_over else cls
        path = build_cached(cls, runtime)
    elif laid_over:
        raise UserError(
            f"{name_or_path}: effects can be laid over a component of ours, or file.py:Class, only (see ppy list)"
        )
    else:
        path = Path(name_or_path)
        if not path.exists() and path.suffix != ".fmu":
            component(name_or_path)  # raises, naming the components there are
    groups: dict[str, dict[str, Signal]] = {"input": {}, "output": {}, "parameter": {}}
    for v in read_description(path).modelVariables:
        if v.causality in groups and v.type != "String":
            groups[v.causality][v.name] = read_signal(v)
    return Model(name_or_path if cls else path.name, path, cls, groups["input"], groups["output"], groups["parameter"])


def names_class(name: str) -> bool:
    """Whether it is ``path/to/file.py:Class``."""
    return name.rpartition(":")[0].endswith(".py")


def load_class(place: str) -> type[Component]:
    """Load a model that is not ours.

    Parameters
    ----------
    place : str
        ``path/to/file.py:Class``.

    Returns
    -------
    type[Component]
        The same one while the file stays as it is.

    Raises
    ------
    UserError
        If the file cannot be read or run, or has no such component.
    """
    from fmus.kit import Component

    file, colon, name = place.rpartition(":")
    if not (colon and file and name):
        raise UserError(f"{place}: write path/to/file.py:Class")
    path = Path(file)
    module = _load(path)
    found = getattr(module, name, None)
    models = [n for n, c in vars(module).items() if _is_subclass(c, Component) and c.__module__ == module.__name__]
    if found is None:
        raise UserError(f"{path}: there is no class {name!r} in it{suggestion(name, models)}")
    if not _is_subclass(found, Component):
        raise UserError(f"{path}: {name} is not a Component{suggestion(name, models)}")
    if not found.name:
        raise UserError(
            f"{path}: {name} has no name, so it is a base or an effect and no model{suggestion(name, models)}"
        )
    return found


def catalogue(cls: type[Component]) -> dict[str, type[Effect]]:
    """Known ways a component is wrong, by id.

    Parameters
    ----------
    cls : type[Component]
        One of ours, or one from a user's module, which lists them as ``EFFECTS``; with effects laid over or not.

    Raises
    ------
    UserError
        If the list is none.
    """
    from fmus import COMPONENTS, component, effects
    from fmus.kit import Effect

    base = vars(cls).get("stacked", (cls, ()))[0]
    if base.name in COMPONENTS and component(base.name) is base:
        return effects(base.name)
    module = sys.modules[base.__module__]
    listed = getattr(module, "EFFECTS", {})
    if not (isinstance(listed, Mapping) and all(_is_subclass(e, Effect) and e.id == n for n, e in listed.items())):
        raise UserError(f"{module.__file__}: EFFECTS must be a dictionary from id to effect class")
    return dict(listed)


def _is_subclass(found: Any, base: type) -> bool:
    return isinstance(found, type) and issubclass(found, base)


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
    if spec is None or spec.loader is None:
        raise UserError(f"{path}: is not a Python file")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, (KeyboardInterrupt, GeneratorExit)):
            raise
        raise UserError(_told(path, error)) from error
    return module


def _told(path: Path, error: BaseException) -> str:
    """Tell in one line what went wrong in a file, and in which line of it."""
    if isinstance(error, SyntaxError):
        where, what = error.lineno, f"{type(error).__name__}: {error.msg}"
    else:
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if Path(f.filename) == path]
        where, what = (lines or [None])[-1], str(error) if isinstance(error, UserError) else ""
        what = what or ": ".join(filter(None, (type(error).__name__, str(error))))
    return f"{path}{f', line {where}' if where else ''}: {' '.join(what.split())}"
