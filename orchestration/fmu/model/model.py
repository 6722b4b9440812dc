"""Models by name: a component of ours, a class in a user's file, or any FMU file.

The description of an FMU built here contains its provenance: component, effects and values. Its
class, which has the equations, is restored from it without running code of the FMU.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from fmus.kit.build import Provenance, read_provenance
from fmus.kit.errors import UserError, find, suggestion
from fmus.kit.files import is_file, is_folder
from fmus.kit.law_terms import LawTerm, check_term, law_term_effect
from fmus.kit.units import check as check_unit
from orchestration.fmu.archive import Archive, for_model_exchange, read_description
from orchestration.fmu.model.effects import check_catalogue, find_effects
from orchestration.fmu.model.left_out import left_out
from orchestration.fmu.model.loading import load_class, names_class, remarks_on
from orchestration.fmu.signal import (
    Signal,
    Value,
    allowed,
    declared_signal,
    join_names,
    read_setting,
    read_signal,
    split_assignment,
    start_of,
)
from orchestration.fmu.source import Source
from orchestration.reporting import Displayable, one_line, option

if TYPE_CHECKING:
    from rich.console import RenderableType

    from fmus.kit import Component, Effect
    from fmus.kit.declare import Declaration

_NOT_BUILT = Path()
# groups of a model's signals by causality: of numbers, and of texts
_GROUPS = {
    "input": ("inputs", "text_inputs"),
    "output": ("outputs", "text_outputs"),
    "parameter": ("parameters", "parameters"),
    "local": ("others", "text_outputs"),
}


@dataclass(frozen=True)
class Model(Displayable):
    """An FMU or a system to run, with its class if its equations are known.

    Attributes
    ----------
    name : str
        The name given by the user; for an FMU the file's name.
    path : Path
        The FMU file; undefined for a system, and for a model of `declared_model` before `built`.
    cls : type[Component] or None
        The class with the equations, if they are known.
    inputs, outputs, parameters : dict of str to Signal
        Variables by name.
    effects : tuple of str
        Names of the added effects, innermost first.
    notes : tuple of str
        Remarks for the user, such as the reason why the equations are unknown.
    system : Source, optional
        The system, for a model that is one.
    kept : tuple of str
        Outputs to keep if the user names none; all if empty.
    of_others : bool
        Whether a system contains a foreign FMU.
    left_out : dict of str to str
        Reasons why other variables can be neither set nor read, by name.
    tolerance : float, optional
        Relative tolerance of the FMU's integration; default the one that it declares.
    others : dict of str to Signal
        Other variables that can be recorded, such as states and locals.
    starts : dict of str to Signal
        Outputs and others whose start values can be set (``initial`` of FMI is exact or approx).
    text_inputs, text_outputs : dict of str to Signal
        Inputs and outputs that are texts, which only simulations exchange; see `with_texts`.
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
    tolerance: float | None = None
    others: Mapping[str, Signal] = field(default_factory=dict)
    starts: Mapping[str, Signal] = field(default_factory=dict)
    text_inputs: Mapping[str, Signal] = field(default_factory=dict)
    text_outputs: Mapping[str, Signal] = field(default_factory=dict)

    def __repr__(self) -> str:
        inputs = ", ".join(self.inputs) or "no inputs"
        return one_line(f"Model {self.title}: {inputs} -> {', '.join(self.outputs)}")

    def overview(self) -> Iterator[RenderableType]:
        """Yield the name, a table of the variables in display units, and the notes."""
        from orchestration.reporting import plain_table

        yield self.title
        columns = ("start", "allowed", "meaning")
        table = plain_table(None, "name", "is", *columns, right=columns[:2])
        groups = {"input": self.inputs, "output": self.outputs, "parameter": self.parameters}
        for kind, signals in groups.items():
            for signal in signals.values():
                table.add_row(signal.name, kind, start_of(signal), allowed(signal), signal.doc)
        yield table
        yield from self.notes

    @property
    def driven(self) -> dict[str, Signal]:
        """Variables that can change in a run: inputs and tunable parameters."""
        tunable = {name: one for name, one in self.parameters.items() if one.is_tunable}
        return {**self.inputs, **tunable}

    @property
    def constants(self) -> dict[str, Signal]:
        """Variables with a value for a whole run: parameters, and start values of others."""
        return {**self.parameters, **self.starts}

    @property
    def settable(self) -> dict[str, Signal]:
        """Variables that can be set to a value: `constants` and inputs."""
        return {**self.constants, **self.inputs, **self.text_inputs}

    @property
    def title(self) -> str:
        """The name, with the added effects."""
        return self.name + (f" with {', '.join(self.effects)}" if self.effects else "")

    @property
    def foreign(self) -> bool:
        """True if it runs code of the user; False for FMUs built here for this run."""
        return self.of_others if self.system else self.name == self.path.name

    @property
    def without_equations(self) -> str:
        """The part of a message that its equations are unknown, with the reason if there is one."""
        if self.notes and not self.system:
            return self.notes[0]
        return f"{self.name} is an FMU without equations"

    def with_tolerance(self, tolerance: float | None) -> Model:
        """Return the model with a relative tolerance that is passed to its FMU, if one is given.

        Raises
        ------
        UserError
            If it is not between 0 and 1, or the model is a system.
        """
        if tolerance is None:
            return self
        given = option("tolerance", tolerance)
        if not 0.0 < tolerance < 1.0:
            raise UserError(f"{given}: a relative tolerance is between 0 and 1")
        if self.system is not None:
            raise UserError(f"{given}: {self.name} is a system; its FMUs have those they declare")
        return replace(self, tolerance=tolerance)

    def by_model_exchange(self) -> Model:
        """Return the model with its FMU's interface for model exchange, which CVode integrates.

        Raises
        ------
        UserError
            If it is no FMU file, or has no such interface.
        """
        if self.system is not None or self.path == _NOT_BUILT:
            raise UserError(f"{option('model_exchange', True)}: {self.name} is no FMU file")
        return replace(self, path=for_model_exchange(self.path), cls=None)

    def settings(self, texts: Sequence[str], preset: str | None = None) -> dict[str, Value]:
        """Read ``name=value[unit]`` settings, which override those of a preset.

        Parameters
        ----------
        texts : sequence of str
            Texts such as ``R1=0.61``, ``R1=610mohm``, ``k1=6.3[N/mm]`` or
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
            For an unknown parameter or preset, a wrong unit or a value out of range.
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
        return values | read_settings(self.name, texts, self.settable, self.left_out)

    def recording(self, names: Sequence[str]) -> Model:
        """Return the model with some of its variables as its outputs.

        Parameters
        ----------
        names : sequence of str
            Outputs, states, parameters or any others, or ``all``; the outputs as they are if empty.

        Raises
        ------
        UserError
            If there is no such variable.
        """
        if not names:
            return self
        numbers = {name: s for name, s in self.parameters.items() if s.type != "string"}
        known = {**self.outputs, **self.others, **numbers, **self.inputs, **self.text_outputs}
        chosen = join_names(names, known)
        if chosen == ["all"] and "all" not in known:
            chosen = [*known]
        outputs = {name: find(name, known, f"{self.name}: no output") for name in chosen}
        return replace(self, outputs=outputs, kept=())

    def with_options(self, options: Mapping[str, Any]) -> Model:
        """Return the model with what options state of units, solver, tolerance and outputs."""
        known = self.with_units(options.get("units") or {})
        if options.get("model_exchange"):
            known = known.by_model_exchange()
        stated = known.with_tolerance(options.get("tolerance"))
        return stated.recording(options.get("outputs") or ())

    def with_texts(self, chosen: Sequence[str]) -> Model:
        """Return the model with inputs that are texts, and outputs unless some were chosen."""
        outputs = self.outputs if chosen else {**self.outputs, **self.text_outputs}
        return replace(self, inputs={**self.inputs, **self.text_inputs}, outputs=outputs)

    def with_units(self, units: Mapping[str, str]) -> Model:
        """Return the model with units of variables of which its FMU declares none.

        Raises
        ------
        UserError
            If there is no such variable, it declares a unit, or nobody knows this one.
        """
        changed = {}
        known = {**self.outputs, **self.others, **self.settable}
        for name, unit in units.items():
            given = option("units", {name: unit})
            signal = find(name, known, f"{given}: {self.name} has no variable")
            if signal.declares_unit or signal.type != "real":
                stated = f"declared in {signal.unit}" if signal.declares_unit else signal.type
                raise UserError(f"{given}: {name} is {stated}")
            check_unit(unit)
            changed[name] = replace(signal, unit=unit, display=unit, declares_unit=True)
        groups: dict[str, Any] = {
            group: {
                name: changed.get(name, signal) for name, signal in getattr(self, group).items()
            }
            for group in ("inputs", "outputs", "parameters", "others", "starts")
        }
        return replace(self, **groups) if changed else self


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
        Reasons why other variables cannot be set, by name.

    Returns
    -------
    dict of str to float or str
        Values in the units of the variables.

    Raises
    ------
    UserError
        For an unknown variable, a wrong unit or a value out of range.
    """
    values: dict[str, Value] = {}
    for text in texts:
        split = split_assignment(text, known)
        if split is None:
            raise UserError(f"{option('settings', text)}: write name=value or name=value[unit]")
        name, value = split
        if name in values:
            raise UserError(f"{option('settings', text)}: {name} has a value already")
        if name in left_out:
            raise UserError(f"{model_name}: {name} {left_out[name]}")
        if name not in known:
            raise UserError(f"{model_name}: no parameter named {name!r}{suggestion(name, known)}")
        values[name] = read_setting(value, known[name], option("settings", {name: value}))
    return values


def find_class(name_or_path: str, effects: Sequence[str] = ()) -> type[Component]:
    """Return the class of a model, which has its equations; nothing is built.

    Parameters
    ----------
    name_or_path : str
        One of our components, ``path/to/file.py:Class``, or an FMU that was built from either.
    effects : sequence of str
        Names of effects to add, innermost first: those of the catalogue by id, measurement effects
        as ``sensor_lag(voltage)``, those of users as ``path/to/file.py:Effect``.

    Raises
    ------
    UserError
        If there is no such component, class, effect or file, or the FMU's equations are unknown.
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
    """Return a model by its name or path; its FMU is built if needed and not in the cache.

    Parameters
    ----------
    name_or_path : str
        One of our components, ``path/to/file.py:Class``, or an FMU file.
    runtime : {"native", "python"}, optional
        Kind of build of a component; default native.
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
    """Return a model by its name or path without building its FMU; see `built`.

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
    """Return the model of a component without building its FMU; see `built`."""
    layout = cls.layout
    return Model(
        cls.name,
        _NOT_BUILT,
        cls,
        inputs=_declared_signals(layout.inputs),
        outputs=_declared_signals(layout.shown),
        others=_declared_signals((*layout.states, *layout.discretes)),
        parameters=_declared_signals((*layout.parameters, *layout.texts)),
    )


def _declared_signals(variables: Iterable[Declaration]) -> dict[str, Signal]:
    """Return the signals of declared variables by name."""
    return {variable.name: declared_signal(variable) for variable in variables}


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
    component_model = model_of(model.cls, runtime or "native")
    return replace(
        component_model,
        name=model.name,
        effects=model.effects,
        notes=model.notes,
        tolerance=model.tolerance,
    )


def refuse_runtime(runtime: str | None, file: str) -> None:
    """Raise UserError if a kind of build is given for a file, which is not built.

    Parameters
    ----------
    runtime : str or None
    file : str
        Name or path of the file.

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

    return replace(_read_signals(build_cached(cls, runtime)), name=cls.name, cls=cls, starts={})


def _read_model(name: str) -> Model:
    """Return the model of an FMU file, with its class if its provenance is known and valid."""
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
    origin = f"{path.name} records how it was built"
    try:
        with Archive(path) as archive:
            model_name = archive.description.get("modelName", "")
            made_from = read_provenance(archive.as_fmi2)
        if made_from is None:
            return model
        origin = f"{path.name} was made from {made_from.place}"
        cls = restore_class(model_name, made_from, model.parameters)
        return replace(model, cls=cls, starts={})
    except UserError as error:
        note = f"{origin}, but {error}; it serves as an FMU without equations"
        return replace(model, notes=(note,))


def _read_signals(path: Path) -> Model:
    """Return the model of an FMU without its class."""
    with Archive(path) as archive:
        reasons = left_out(archive.description)
        idle = archive.idle_clocks
        wide = {name for v in archive.declared.values() if v.is_wide for name in v.elements}
    groups: dict[str, Any] = {
        name: {} for name in ("starts", *(name for pair in _GROUPS.values() for name in pair))
    }
    for variable in read_description(path).modelVariables:
        name, causality = variable.name, variable.causality
        if causality == "independent":
            continue
        role = causality if causality in _GROUPS else "local"
        try:
            signal = read_signal(variable)
        except UserError as error:
            if role == "local":
                continue
            raise UserError(f"{path}: {error}") from error
        if name in wide:
            signal = replace(signal, type="integer")
        groups[_GROUPS[role][signal.type == "string"]][name] = signal
        is_start = variable.initial in ("exact", "approx") and variable.variability != "constant"
        if is_start and role in ("output", "local"):
            groups["starts"][name] = signal
    notes = (f"{path.name}: never ticked, as nothing triggers them: {', '.join(idle)}",)
    return Model(path.name, path, None, notes=notes if idle else (), left_out=reasons, **groups)


def restore_class(
    name: str, made_from: Provenance, parameters: Mapping[str, Signal]
) -> type[Component]:
    """Restore the class from which an FMU was built.

    No code of the FMU is run: the class is a component of ours, or is loaded from its file if that
    has not changed. The digest of its laws must be that in the FMU, because laws of components,
    effects or imported modules may have changed since the build.

    Parameters
    ----------
    name : str
        Name of the model.
    made_from : Provenance
    parameters : Mapping of str to Signal
        Parameters of the FMU, whose start values become the defaults.

    Returns
    -------
    type[Component]

    Raises
    ------
    UserError
        If the component or file does not exist, or its contents, effects, parameters or laws have
        changed.
    """
    from fmus.kit import stack
    from fmus.kit.symbolic import trace

    if not made_from.laws:
        raise UserError("its description has no digest of its laws")
    base = _base_class(made_from)
    effects: list[type[Effect]] = []
    for effect in made_from.effects:
        term = made_from.terms.get(effect)
        if term is None:
            sampling = made_from.samplings.get(effect)
            effects += find_effects(base, [effect], made_from.place, sampling)
        else:
            effects.append(_term_of(stack(base, *effects), term))
    declared = declared_model_of(stack(base, *effects, name=name)).parameters
    if declared.keys() != parameters.keys():
        difference = sorted(declared.keys() ^ parameters.keys())[0]
        raise UserError(f"{made_from.place} has other parameters now, such as {difference}")
    defaults: Any = {
        parameter: parameters[parameter].default
        for parameter, signal in declared.items()
        if parameters[parameter].default != signal.default
    }
    restored = stack(base, *effects, name=name, defaults=defaults)
    if trace(restored).digest != made_from.laws:
        raise UserError("its laws have changed since the FMU was built")
    restored.remark = "\n".join(made_from.remarks)
    return restored


def _term_of(cls: type[Component], term: LawTerm) -> type[Effect]:
    """Return the effect of a term, which comes from a file.

    Raises
    ------
    UserError
        If the model cannot have it.
    """
    from fmus.kit.symbolic import list_laws

    laws = {law.name for law in list_laws(cls)}
    check_term(term, laws, laws | {v.name for v in (*cls.layout.inputs, *cls.layout.states)})
    return law_term_effect(cls, term.law, term)


def _base_class(made_from: Provenance) -> type[Component]:
    """Return the component, or the class from a file whose digest is that of the provenance."""
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
