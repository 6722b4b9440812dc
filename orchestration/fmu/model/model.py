"""Models by name: a component of ours, a class in a user's file, or any FMU file.

An FMU that was built here tells which component, effects and values it was made from. Its class,
that is its equations, is restored from that; no code of the FMU is run for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from fmus.kit.build import Provenance, read_provenance
from fmus.kit.errors import UserError, suggestion
from fmus.kit.files import is_file, is_folder
from fmus.kit.units import format_range, format_value
from orchestration.fmu.archive import Archive, read_description
from orchestration.fmu.model.effects import check_catalogue, find_effects
from orchestration.fmu.model.left_out import left_out
from orchestration.fmu.model.loading import load_class, names_class, remarks_on
from orchestration.fmu.signal import Signal, Value, declared_signal, read_setting, read_signal
from orchestration.fmu.source import Source
from orchestration.reporting import Displayable, one_line, option

if TYPE_CHECKING:
    from rich.console import RenderableType

    from fmus.kit import Component

_NOT_BUILT = Path()


@dataclass(frozen=True)
class Model(Displayable):
    """An FMU to run, with its class if its equations are known.

    Attributes
    ----------
    name : str
        The name that the user gave; of an FMU the file's name.
    path : Path
        The FMU file; of a model that `declared_model` returned none yet, see `built`.
    cls : type[Component] or None
    inputs, outputs, parameters : dict of str to Signal
    effects : tuple of str
        Names of the added effects, innermost first.
    notes : tuple of str
        Remarks for the user, such as why its equations are not known.
    system : Source, optional
        The system that it is, in place of one FMU; `path` is nothing then.
    kept : tuple of str
        Outputs that are kept unless others are named; all unless given.
    of_others : bool
        Whether a system has an FMU that is none of ours.
    left_out : dict of str to str
        Why other variables can be neither set nor read, by name.
    """

    name: str
    path: Path
    cls: type[Component] | None
    inputs: Mapping[str, Signal]
    outputs: Mapping[str, Signal]
    parameters: Mapping[str, Signal]
    effects: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    system: Source | None = None
    kept: tuple[str, ...] = ()
    of_others: bool = False
    left_out: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        inputs = ", ".join(self.inputs) or "no inputs"
        return one_line(f"Model {self.title}: {inputs} -> {', '.join(self.outputs)}")

    def overview(self) -> Iterator[RenderableType]:
        """Yield its name, and a table of its variables in the units that people read."""
        from orchestration.reporting import plain_table

        yield self.title
        columns = ("start", "allowed", "meaning")
        table = plain_table(None, "name", "is", *columns, right=columns[:2])
        groups = {"input": self.inputs, "output": self.outputs, "parameter": self.parameters}
        for kind, signals in groups.items():
            for signal in signals.values():
                table.add_row(signal.name, kind, *_described(signal), signal.doc)
        yield table
        yield from self.notes

    @property
    def title(self) -> str:
        """Its name, with the added effects."""
        return self.name + (f" with {', '.join(self.effects)}" if self.effects else "")

    @property
    def foreign(self) -> bool:
        """True if code of the user runs, false for FMUs that were built here for this run."""
        return self.of_others if self.system else self.name == self.path.name

    @property
    def without_equations(self) -> str:
        """The clause for messages that no equations of it are known, with the reason if any."""
        reasons = () if self.system else self.notes
        return next(iter(reasons), f"{self.name} is an FMU without equations")

    def settings(self, texts: Sequence[str], preset: str | None = None) -> dict[str, Value]:
        """Read ``name=value[unit]`` settings, after those of a preset.

        Parameters
        ----------
        texts : sequence of str
            Each like ``R1=0.61``, ``R1=610mohm``, ``k1=6.3[N/mm]`` or
            ``endpoint=tcp://127.0.0.1:5570``.
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
                    f"{self.name}: no preset named {preset!r}; there are:"
                    f" {', '.join(presets) or 'none'}"
                )
            values |= dict(presets[preset].values)
        settable = {**self.parameters, **self.inputs}
        return values | read_settings(self.name, texts, settable, self.left_out)


def _described(signal: Signal) -> tuple[str, str]:
    """Return start value and range as people read them; a text has no range."""
    if signal.type == "string":
        return signal.text, ""
    return format_value(signal.start, signal), format_range(signal)


def read_settings(
    model_name: str,
    texts: Sequence[str],
    known: Mapping[str, Signal],
    left_out: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Value]:
    """Read ``name=value[unit]`` settings of a model's variables.

    Parameters
    ----------
    model_name : str
        Name of the model in messages.
    texts : sequence of str
    known : Mapping of str to Signal
        Variables that can be set.
    left_out : Mapping of str to str
        Why others cannot.

    Returns
    -------
    dict of str to float or str
        Values in the units of the variables.

    Raises
    ------
    UserError
        For an unknown variable, a wrong unit, a value out of range.
    """
    values = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise UserError(f"{option('settings', text)}: write name=value or name=value[unit]")
        if name in left_out:
            raise UserError(f"{model_name}: {name} {left_out[name]}")
        if name not in known:
            raise UserError(f"{model_name}: no parameter named {name!r}{suggestion(name, known)}")
        values[name] = read_setting(value, known[name], option("settings", {name: value}))
    return values


def find_class(name_or_path: str, effects: Sequence[str] = ()) -> type[Component]:
    """Find the class of a model, that is its equations; nothing is built.

    Parameters
    ----------
    name_or_path : str
        One of our components, ``path/to/file.py:Class``, or an FMU that was built from either.
    effects : sequence of str
        Names of effects to add, innermost first: its own by id, measurements as
        ``sensor_lag(voltage)``, others as ``path/to/file.py:Effect``.

    Raises
    ------
    UserError
        If there is no such component, class, effect or file, or the FMU's equations are not known.
    """
    from fmus.kit import registry, stack
    from fmus.kit.symbolic import check_component

    if name_or_path in registry.models():
        cls = registry.component(name_or_path)
    elif names_class(name_or_path):
        cls = load_class(name_or_path)
        check_catalogue(cls)
    else:
        model = _read_model(name_or_path)
        if model.cls is None:
            raise UserError(
                f"{model.without_equations}; name a component (see ppy list) or file.py:Class"
            )
        cls = model.cls
    if not effects:
        return cls
    stacked = stack(cls, *find_effects(cls, effects, name_or_path))
    if any(map(names_class, (name_or_path, *effects))):
        check_component(stacked)
    return stacked


def find_model(name_or_path: str, runtime: str | None = None, effects: Sequence[str] = ()) -> Model:
    """Find a model by component name or path; its FMU is built if needed and not in the cache.

    Parameters
    ----------
    name_or_path : str
        One of our components, ``path/to/file.py:Class``, or an FMU file.
    runtime : {"native", "python"}, optional
        Kind of build of a component; native unless given.
    effects : sequence of str
        Names of effects to add, innermost first; see :func:`find_class`.

    Raises
    ------
    UserError
        If there is no such component, class, effect or file, the FMU cannot be read, or a kind of
        build is given for a file.

    Examples
    --------
    >>> import ppy_rig as ppy
    >>> model = ppy.find_model("ppy_actuator", effects=["strain_saturation"])
    >>> sorted(model.inputs)
    ['current', 'force']
    >>> model.parameters["R1"].unit
    'ohm'
    """
    return built(declared_model(name_or_path, effects), runtime)


def declared_model(name_or_path: str, effects: Sequence[str] = ()) -> Model:
    """Find a model without building its FMU: enough to read a record of it, and to refuse one.

    Parameters
    ----------
    name_or_path, effects
        See :func:`find_model`.

    Raises
    ------
    UserError
        If there is no such component, class, effect or file.
    """
    from fmus.kit import registry

    if not effects and name_or_path not in registry.models() and not names_class(name_or_path):
        return _read_model(name_or_path)
    model = declared_model_of(find_class(name_or_path, effects))
    notes = remarks_on(name_or_path) if names_class(name_or_path) else ()
    return replace(model, name=name_or_path, effects=tuple(effects), notes=notes)


def declared_model_of(cls: type[Component]) -> Model:
    """Return the model of a component, whose FMU is not built yet."""
    layout = cls.layout
    inputs, outputs, parameters = (
        {v.name: declared_signal(v) for v in variables}
        for variables in (
            layout.inputs,
            layout.shown,
            (*layout.parameters, *layout.texts),
        )
    )
    return Model(cls.name, _NOT_BUILT, cls, inputs, outputs, parameters)


def built(model: Model, runtime: str | None = None) -> Model:
    """Return a model with its FMU, which is built if it is not in the cache.

    Raises
    ------
    UserError
        See `find_model`.
    """
    if model.system is not None:
        return model
    if model.path != _NOT_BUILT or model.cls is None:
        refuse_runtime(runtime, model.name)
        return model
    made = model_of(model.cls, runtime or "native")
    return replace(made, name=model.name, effects=model.effects, notes=model.notes)


def refuse_runtime(runtime: str | None, file: str) -> None:
    """Refuse a kind of build that is chosen for FMUs from a file, which are taken as they are.

    Raises
    ------
    UserError
    """
    if runtime is not None:
        given = option("runtime", runtime)
        raise UserError(f"{given}: {Path(file).name} is taken as it is; only components are built")


def model_of(cls: type[Component], runtime: str = "native") -> Model:
    """Return the model of a component; its FMU is built if it is not in the cache."""
    from fmus.kit.build import build_cached

    return replace(_read_signals(build_cached(cls, runtime)), name=cls.name, cls=cls)


def _read_model(name: str) -> Model:
    """Read an FMU file, and restore the class that it was made from if that is known."""
    from fmus.kit import registry

    path = Path(name)
    if not is_file(path) and path.suffix != ".fmu":
        known = registry.models()
        hint = suggestion(name, known, few=0)
        if name and is_folder(path):
            raise UserError(
                f"{name} is a folder; name an .fmu in it, or a component: {', '.join(known)}"
            )
        raise UserError(
            f"no component named {name!r}{hint}; there are: {', '.join(known)}; or name"
            " file.py:Class or an .fmu"
        )
    model = _read_signals(path)
    origin = f"{path.name} tells what it was made from"
    try:
        with Archive(path) as archive:
            model_name = archive.description.get("modelName", "")
            made_from = read_provenance(archive.as_fmi2)
        if made_from is None:
            return model
        origin = f"{path.name} was made from {made_from.place}"
        return replace(model, cls=restore_class(model_name, made_from, model.parameters))
    except UserError as error:
        note = f"{origin}, but {error}; it serves as an FMU without equations"
        return replace(model, notes=(note,))


def _read_signals(path: Path) -> Model:
    """Read the inputs, outputs and parameters of an FMU; texts can be parameters only."""
    groups: dict[str, dict[str, Signal]] = {"input": {}, "output": {}, "parameter": {}}
    for variable in read_description(path).modelVariables:
        causality = variable.causality
        if causality in groups and (variable.type != "String" or causality == "parameter"):
            try:
                groups[causality][variable.name] = read_signal(variable)
            except UserError as error:
                raise UserError(f"{path}: {error}") from error
    inputs, outputs, parameters = groups.values()
    with Archive(path) as archive:
        reasons = left_out(archive.description)
    return Model(path.name, path, None, inputs, outputs, parameters, left_out=reasons)


def restore_class(
    name: str, made_from: Provenance, parameters: Mapping[str, Signal]
) -> type[Component]:
    """Make the class again from which an FMU was built.

    No code of the FMU is run: the class is one of ours, or it is in a file that has not changed
    since. It counts where its laws have the digest that the FMU tells, as laws of a component, of
    an effect or of what a user's file imports may be others by now.

    Parameters
    ----------
    name : str
        Name of the model.
    made_from : Provenance
    parameters : Mapping of str to Signal
        Parameters of the FMU; their start values become the defaults.

    Raises
    ------
    UserError
        With the reason why it cannot be made: no such component or file, another content, other
        effects, parameters or laws.
    """
    from fmus.kit import stack
    from fmus.kit.symbolic import trace

    if not made_from.laws:
        raise UserError("its description does not tell by which laws, as builds do now")
    base = _base_class(made_from)
    effects = [
        effect
        for name in made_from.effects
        for effect in find_effects(base, [name], made_from.place, made_from.samplings.get(name))
    ]
    layout = stack(base, *effects, name=name).layout
    declared = {
        parameter.name: declared_signal(parameter).default
        for parameter in (*layout.parameters, *layout.texts)
    }
    if declared.keys() != parameters.keys():
        other = sorted(declared.keys() ^ parameters.keys())[0]
        raise UserError(f"{made_from.place} has other parameters now, such as {other}")
    changed: Any = {
        n: parameters[n].default for n, start in declared.items() if parameters[n].default != start
    }
    restored = stack(base, *effects, name=name, defaults=changed)
    if trace(restored).digest != made_from.laws:
        raise UserError("the laws here are others than those it was built with")
    restored.remark = "\n".join(made_from.remarks)
    return restored


def _base_class(made_from: Provenance) -> type[Component]:
    """Return one of our components, or load a class from a file with the recorded contents."""
    from fmus.kit import registry

    if made_from.component:
        if made_from.component not in registry.models():
            raise UserError(f"there is no component {made_from.component!r} here")
        return registry.component(made_from.component)
    path = Path(made_from.file)
    if path.suffix != ".py" or not path.is_file():
        raise UserError(f"there is no file {made_from.file} here")
    if sha256(path.read_bytes()).hexdigest() != made_from.sha256:
        raise UserError(f"{made_from.file} has changed since")
    return load_class(made_from.place)
