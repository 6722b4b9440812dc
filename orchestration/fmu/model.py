"""What a user may name where a model is wanted: a component of ours, a class in a file, or any FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from fmus.kit.errors import UserError, suggestion
from fmus.kit.files import is_file, is_folder
from orchestration.fmu.archive import read_description
from orchestration.fmu.effects import catalogue, find_effects
from orchestration.fmu.loading import load_class, names_class
from orchestration.fmu.origin import read_provenance, restore
from orchestration.fmu.signal import Signal, Value, read_setting, read_signal

if TYPE_CHECKING:
    from fmus.kit import Component

# whoever finds models by name gets the parts of a name here, too
__all__ = [
    "Model",
    "catalogue",
    "find_class",
    "find_model",
    "load_class",
    "model_of",
    "names_class",
    "read_settings",
]


@dataclass(frozen=True)
class Model:
    """An FMU to run, and the class behind it if its equations are known.

    Attributes
    ----------
    name : str
        As the user named it; of an FMU the file's name.
    path : Path
        The FMU file.
    cls : type[Component] or None
    inputs, outputs, parameters : dict of str to Signal
    effects : tuple of str
        Names of the effects that were asked for, innermost first.
    notes : tuple of str
        What the user should know of it, such as why its equations are not known.
    """

    name: str
    path: Path
    cls: type[Component] | None
    inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]
    parameters: Mapping[str, Signal]
    effects: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Its name, with the effects that were laid over it."""
        return self.name + (f" with {', '.join(self.effects)}" if self.effects else "")

    @property
    def foreign(self) -> bool:
        """Whether it is a file that somebody gave, and not one that was built here for this run."""
        return self.name == self.path.name

    def settings(self, texts: Sequence[str], preset: str | None = None) -> dict[str, Value]:
        """Read ``name=value[unit]`` settings, after those of a preset.

        Parameters
        ----------
        texts : sequence of str
            Each like ``R1=0.61``, ``R1=610mohm``, ``k1=6.3[N/mm]`` or ``endpoint=tcp://127.0.0.1:5570``.
        preset : str, optional
            Name of one of the component's presets.

        Returns
        -------
        dict of str to float or str
            Values in the FMU's units.

        Raises
        ------
        UserError
            For an unknown parameter or preset, a wrong unit, a value out of range.
        """
        values: dict[str, Value] = {}
        if preset is not None:
            presets = self.cls.presets if self.cls else {}
            if preset not in presets:
                raise UserError(
                    f"{self.name}: no preset named {preset!r}; there are: {', '.join(presets) or 'none'}"
                )
            values |= dict(presets[preset].values)
        return values | read_settings(self.name, texts, {**self.parameters, **self.inputs})


def read_settings(of: str, texts: Sequence[str], known: Mapping[str, Signal]) -> dict[str, Value]:
    """Read ``name=value[unit]`` settings of a model's variables, in their units.

    Raises
    ------
    UserError
        For a variable that is not known, a wrong unit, a value out of range.
    """
    values = {}
    for text in texts:
        name, equals, given = (part.strip() for part in text.partition("="))
        if not equals:
            raise UserError(f"--set {text!r}: write name=value or name=value[unit]")
        if name not in known:
            raise UserError(f"{of}: no parameter named {name!r}{suggestion(name, known)}")
        values[name] = read_setting(given, known[name], f"--set {name}={given}")
    return values


def find_class(name_or_path: str, effects: Sequence[str] = ()) -> type[Component]:
    """Find the equations of a model; nothing is built.

    Parameters
    ----------
    name_or_path : str
        One of our components, ``path/to/file.py:Class``, or an FMU that was built from either.
    effects : sequence of str
        Names of effects to lay over it, innermost first: its own by id, measurements as ``sensor_lag(voltage)``.

    Raises
    ------
    UserError
        If there is no such component, class, effect or file, or the FMU's equations are not known.
    """
    from fmus import MODELS, component
    from fmus.kit import stack

    if name_or_path in MODELS:
        cls = component(name_or_path)
    elif names_class(name_or_path):
        cls = load_class(name_or_path)
    else:
        model = _from_fmu(name_or_path)
        if model.cls is None:
            reason = (
                model.notes[0] if model.notes else f"{name_or_path} is an FMU without equations"
            )
            raise UserError(f"{reason}; name a component (see ppy list) or file.py:Class")
        cls = model.cls
    return stack(cls, *find_effects(cls, effects, name_or_path)) if effects else cls


def find_model(name_or_path: str, runtime: str = "native", effects: Sequence[str] = ()) -> Model:
    """Find a model by component name or path; what is no FMU is built if it is not in the cache.

    Parameters
    ----------
    name_or_path : str
        One of our components, ``path/to/file.py:Class``, or an FMU file.
    runtime : {"native", "python"}
        Which build of a component.
    effects : sequence of str
        Names of effects to lay over it, innermost first; see :func:`find_class`.

    Raises
    ------
    UserError
        If there is no such component, class, effect or file, or the FMU cannot be read.

    Examples
    --------
    >>> import orchestration as ppy
    >>> model = ppy.find_model("ppy_actuator", effects=["strain_saturation"])
    >>> sorted(model.inputs)
    ['current', 'force']
    >>> model.parameters["R1"].unit
    'ohm'
    """
    from fmus import MODELS

    if not effects and name_or_path not in MODELS and not names_class(name_or_path):
        return _from_fmu(name_or_path)
    model = model_of(find_class(name_or_path, effects), runtime)
    return replace(model, name=name_or_path, effects=tuple(effects))


def model_of(cls: type[Component], runtime: str = "native") -> Model:
    """Return a component as a model to run; its FMU is built if it is not in the cache."""
    from fmus.kit.build import build_cached

    return replace(_read(build_cached(cls, runtime)), name=cls.name, cls=cls)


def _from_fmu(name: str) -> Model:
    """Read an FMU file, with its class where it tells what it was made from and that is still there."""
    from fmus import MODELS

    path = Path(name)
    if not is_file(path) and path.suffix != ".fmu":
        hint = suggestion(name, MODELS, few=0)
        if is_folder(path):
            raise UserError(
                f"{name} is a folder; name an .fmu in it, or a component: {', '.join(MODELS)}"
            )
        raise UserError(
            f"no component named {name!r}{hint}; there are: {', '.join(MODELS)}; or name file.py:Class or an .fmu"
        )
    model = _read(path)
    identifier, made_from = read_provenance(path)
    if made_from is None:
        return model
    try:
        return replace(model, cls=restore(identifier, made_from, model.parameters))
    except UserError as error:
        note = f"{path.name} was made from {made_from.place}, but {error}; it serves as an FMU without equations"
        return replace(model, notes=(note,))


def _read(path: Path) -> Model:
    """Read the inputs, outputs and parameters of an FMU; of type String there are parameters only."""
    groups: dict[str, dict[str, Signal]] = {"input": {}, "output": {}, "parameter": {}}
    for v in read_description(path).modelVariables:
        if v.causality in groups and (v.type != "String" or v.causality == "parameter"):
            try:
                groups[v.causality][v.name] = read_signal(v)
            except UserError as error:
                raise UserError(f"{path}: {error}") from error
    return Model(path.name, path, None, groups["input"], groups["output"], groups["parameter"])
