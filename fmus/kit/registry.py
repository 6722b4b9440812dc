"""Registry of packages of components, which installed distributions declare as entry points.

A distribution names each of its packages in ``pyproject.toml``::

    [project.entry-points."ppy_rig.components"]
    tank = "tank_models:PACKAGE"

The object is a `ComponentPackage`, which names classes and functions as ``module:name``; they are
imported when they are used. Packages are loaded once in a process. A package that cannot be used is
omitted with a warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from .errors import UserError, find
from .interrupt import raise_interrupt

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from .component import Component
    from .effects import Effect

GROUP = "ppy_rig.components"
_OURS = "fmus"


class RegistryWarning(UserWarning):
    """Warning that a package of components is omitted."""


@dataclass(frozen=True)
class MemberDeclaration:
    """A member of a system: a component with its values and effects.

    Attributes
    ----------
    component : str
        Name of a component of any package.
    values : Mapping of str to float or str
        Values of parameters and of constant inputs, in the units of the component.
    effects : tuple of str
        Ids of effects that are stacked on the component, innermost first.
    model_name : str
        Name of the component with these effects; required if there are any.
    """

    component: str
    values: Mapping[str, float | str] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    model_name: str = ""


@dataclass(frozen=True)
class SystemDeclaration:
    """A system of components.

    Attributes
    ----------
    name : str
    summary : str
        One sentence, the description in its SSP file.
    members : Mapping of str to MemberDeclaration
        Members by their names in the system, in the order of stepping.
    connections : tuple of str
        Connections as ``"member.output -> member.input"``.
    inputs : Mapping of str to tuple of str
        Inputs of members as ``"member.input"``, by name of the input of the system.
    outputs : tuple of str
        Outputs of members as ``"member.output"``; outputs of the system have the names of these
        variables.
    step, stop : float
        Communication step and duration, s.
    """

    name: str
    summary: str
    members: Mapping[str, MemberDeclaration]
    connections: tuple[str, ...]
    inputs: Mapping[str, tuple[str, ...]]
    outputs: tuple[str, ...]
    step: float
    stop: float


@dataclass(frozen=True)
class Example:
    """A system with constant inputs, as an example in other languages.

    Attributes
    ----------
    system : SystemDeclaration
        A system of the package, or one that is an example only.
    inputs : Mapping of str to float
        Value of each input of the system, SI.
    """

    system: SystemDeclaration
    inputs: Mapping[str, float]


@dataclass(frozen=True)
class Excitation:
    """Inputs that a rig can apply to a component.

    Attributes
    ----------
    ranges : Mapping of str to tuple of float
        Lowest and highest value of each input by name, SI.
    bandwidth : float
        Highest frequency, Hz.
    """

    ranges: Mapping[str, tuple[float, float]]
    bandwidth: float


@dataclass(frozen=True)
class StimulusDeclaration:
    """A kind of stimulus for experiments, which offers several signals over time.

    Attributes
    ----------
    summary : str
        One sentence.
    key : str
        Key of the stimulus table whose value chooses one of the signals.
    choices : tuple of str
        Names of the signals.
    unit : str
        Unit of all signals.
    signals : str
        ``module:function`` of a function that maps times in s, shape (n,), to the signals, shape
        (n,), by name.
    """

    summary: str
    key: str
    choices: tuple[str, ...]
    unit: str
    signals: str


@dataclass(frozen=True)
class RigDeclaration:
    """Signals of a rig, with their units and hard limits.

    Attributes
    ----------
    inputs, outputs : Mapping of str to str
        SI unit by name of the signal.
    limits : Mapping of str to tuple of float
        Lowest and highest value by name of the signal, and for one that must not step the largest
        change per second, SI.
    """

    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    limits: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


class DesignSignal(NamedTuple):
    """A signal between a plant and its controller: its name, unit, and value where it rests, SI."""

    name: str
    unit: str
    value: float


@dataclass(frozen=True)
class DesignRequest:
    """A linear plant and what its control loop should do, as a design rule takes them.

    Attributes
    ----------
    plant : control.StateSpace
        Sampled, from the command that is held to the measured value at the samples, with all
        delays; a command acts on later samples only.
    measured, command : DesignSignal
    limits : tuple of float
        Lowest and highest command, SI.
    phase_margin : float or None
        Degrees; None if the rule chooses it.
    crossover : float or None
        Frequency of gain one of the loop, Hz; None if the rule chooses it.
    linearise : callable
        Returns the plant before it is sampled, as a linear model with ``state_space`` and
        ``at_rest(name)``, from names of inputs and outputs.
    """

    plant: Any
    measured: DesignSignal
    command: DesignSignal
    limits: tuple[float, float]
    phase_margin: float | None
    crossover: float | None
    linearise: Callable[[Sequence[str], Sequence[str]], Any]


@dataclass(frozen=True)
class DesignedController:
    """A controller as the call that makes its class.

    Attributes
    ----------
    place : str
        ``module:function`` of a function that returns the class of a component.
    arguments : Mapping of str to object
        Its keyword arguments: texts, numbers and lists of numbers.
    signals : Mapping of str to str
        Signal of the plant by input of the component, the measured value first.
    reference, command : str
        Input of the component for the reference, and its output.
    limits : tuple of str
        Parameters for the lowest and the highest command; empty if it has none.
    experiment : tuple of float
        Stop time and step of the class, s; empty for those of the function.
    """

    place: str
    arguments: Mapping[str, Any]
    signals: Mapping[str, str]
    reference: str = "reference"
    command: str = "command"
    limits: tuple[str, ...] = ()
    experiment: tuple[float, ...] = ()

    @property
    def component(self) -> type[Component]:
        """The class of the controller."""
        made: type[Component] = load(self.place)(**self.arguments)
        if self.experiment:
            stop, step = self.experiment
            made.experiment = (stop, step)
        return made

    @property
    def source(self) -> str:
        """Source text of a module with the class ``Controller``."""
        module, _, name = self.place.partition(":")
        # the module knows nothing of numpy, whose numbers have reprs of their own
        plain = {key: getattr(x, "tolist", lambda x=x: x)() for key, x in self.arguments.items()}
        values = "".join(f"    {key}={value!r},\n" for key, value in plain.items())
        call = f"from {module} import {name}\n\nController = {name}(\n{values})\n"
        return f"{call}Controller.experiment = {self.experiment}\n" if self.experiment else call


@dataclass(frozen=True)
class ComponentPackage:
    """A package of components with their systems, stimuli, experiments and calibrations.

    Attributes
    ----------
    components, proxies : Mapping of str to str
        ``module:Class`` by name of the component. Proxies forward their signals to a rig, which
        must run.
    default_model : str
        Default component of commands and functions.
    excitations : Mapping of str to Excitation
        Inputs that a rig can apply, by name of the component.
    declared_systems : tuple of SystemDeclaration
    examples : tuple of Example
    stimuli : Mapping of str to StimulusDeclaration
        Kinds of stimuli by name.
    rigs : Mapping of str to RigDeclaration
        Signals of rigs by name, for ``--option signals=NAME``.
    designs : Mapping of str to str
        Design rules by the kind of controller: ``module:function`` of a function that maps a
        `DesignRequest` to a `DesignedController`.
    experiment_folder, preset_folder : Path or None
        Folders of experiments, and of calibrations of rigs: ``.toml`` files.
    """

    components: Mapping[str, str] = field(default_factory=dict)
    proxies: Mapping[str, str] = field(default_factory=dict)
    default_model: str = ""
    excitations: Mapping[str, Excitation] = field(default_factory=dict)
    declared_systems: tuple[SystemDeclaration, ...] = ()
    examples: tuple[Example, ...] = ()
    stimuli: Mapping[str, StimulusDeclaration] = field(default_factory=dict)
    rigs: Mapping[str, RigDeclaration] = field(default_factory=dict)
    designs: Mapping[str, str] = field(default_factory=dict)
    experiment_folder: Path | None = None
    preset_folder: Path | None = None

    @property
    def models(self) -> Mapping[str, str]:
        """Components and proxies: ``module:Class`` by name."""
        return {**self.components, **self.proxies}

    @property
    def systems(self) -> Mapping[str, SystemDeclaration]:
        """Systems by name."""
        return {system.name: system for system in self.declared_systems}

    @property
    def experiments(self) -> Mapping[str, Path]:
        """Files of experiments by name."""
        return _toml_files(self.experiment_folder)

    @property
    def presets(self) -> Mapping[str, Path]:
        """Files of calibrations by name."""
        return _toml_files(self.preset_folder)

    def offered(self, name: str) -> Any:
        """Return a component's class by name; it serves as ``__getattr__`` of the package's module.

        The class is imported at its first use, so that a list of components imports none.

        Raises
        ------
        AttributeError
            If the package has no such class.
        """
        for place in self.models.values():
            if place.endswith(f":{name}"):
                return load(place)
        raise AttributeError(f"no component class {name!r} in this package")


_KINDS = {
    "models": "component",
    "systems": "system",
    "stimuli": "kind of stimulus",
    "rigs": "rig",
    "designs": "kind of controller",
    "experiments": "experiment",
    "presets": "calibration",
}
"""Attribute of a package whose names must be unique -> word for messages."""


def _toml_files(folder: Path | None) -> dict[str, Path]:
    return {path.stem: path for path in sorted(folder.glob("*.toml"))} if folder else {}


# --- packages ------------------------------------------------------------------------------------


@cache
def packages() -> tuple[ComponentPackage, ...]:
    """Return the installed packages of components.

    The order is: packages of ppy-rig, the one with the default model first; then others by the name
    of their distribution.

    Raises
    ------
    UserError
        If there are none, because the installation is older than the source.
    """
    # imported here, so that commands that need no component start faster
    from importlib.metadata import entry_points

    loaded = [*_load_packages(entry_points(group=GROUP))]
    if not loaded:
        raise UserError(
            f"no package of components is installed (entry points {GROUP!r});"
            " install ppy-rig again, a checkout by: pip install --no-deps -e ."
        )
    owners: dict[tuple[str, str], str] = {}
    accepted = []
    for entry, package in sorted(loaded, key=_sort_key):
        names = [(kind, name) for kind in _KINDS for name in getattr(package, kind)]
        duplicate = next((one for one in names if one in owners), None)
        if duplicate is None:
            owners |= dict.fromkeys(names, entry.value)
            accepted.append(package)
        else:
            kind, name = duplicate
            _warn_omitted(entry, f"{owners[duplicate]} has a {_KINDS[kind]} {name!r} already")
    return tuple(accepted)


def _load_packages(entries: Any) -> Iterator[tuple[EntryPoint, ComponentPackage]]:
    """Yield each entry point with its package; warn of those that cannot be loaded."""
    for entry in entries:
        try:
            package = entry.load()
        except Exception as error:  # foreign code may raise any exception
            raise_interrupt(error)
            _warn_omitted(entry, f"{type(error).__name__}: {error}")
            continue
        if isinstance(package, ComponentPackage):
            yield entry, package
        else:
            _warn_omitted(entry, f"it is no ComponentPackage but {type(package).__name__}")


def _sort_key(pair: tuple[EntryPoint, ComponentPackage]) -> tuple[bool, bool, str, str]:
    """Return the key for the order of `packages`."""
    entry, package = pair
    is_ours = entry.module.partition(".")[0] == _OURS
    return not is_ours, not package.default_model, _distribution(entry), entry.name


def _distribution(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else ""


def _warn_omitted(entry: EntryPoint, reason: str) -> None:
    """Warn that a package is omitted."""
    text = f"components {entry.value} of {_distribution(entry)} are left out: {reason}"
    warnings.warn(" ".join(text.split()), RegistryWarning, stacklevel=2)


# --- contents of all packages --------------------------------------------------------------------


@cache
def _merged(kind: str) -> dict[str, Any]:
    """Return an attribute of all packages, a mapping by name, as one mapping."""
    return {n: one for package in packages() for n, one in getattr(package, kind).items()}


def components() -> dict[str, str]:
    """Return ``module:Class`` of every component by name."""
    return _merged("components")


def proxies() -> dict[str, str]:
    """Return ``module:Class`` of every proxy by name."""
    return _merged("proxies")


def systems() -> dict[str, SystemDeclaration]:
    """Return every system by name."""
    return _merged("systems")


def examples() -> list[Example]:
    """Return every example."""
    return [example for package in packages() for example in package.examples]


def stimuli() -> dict[str, StimulusDeclaration]:
    """Return every kind of stimulus by name."""
    return _merged("stimuli")


def rigs() -> dict[str, RigDeclaration]:
    """Return the signals of every rig by the name of the rig."""
    return _merged("rigs")


def designs() -> dict[str, str]:
    """Return ``module:function`` of every design rule by the kind of controller."""
    return _merged("designs")


def experiments() -> dict[str, Path]:
    """Return the file of every experiment by name."""
    return _merged("experiments")


def presets() -> dict[str, Path]:
    """Return the file of every calibration by name."""
    return _merged("presets")


@cache
def models() -> dict[str, str]:
    """Return ``module:Class`` of every component, then of every proxy, by name."""
    return {**components(), **proxies()}


def default_model() -> str:
    """Return the name of the default component of commands and functions.

    Raises
    ------
    UserError
        If no package has one.
    """
    for package in packages():
        if package.default_model:
            return package.default_model
    raise UserError("no model is named, and no installed package of components has a default")


def excitation(name: str) -> Excitation | None:
    """Return the inputs that a rig can apply to a component; None if they are not known."""
    return _merged("excitations").get(name)


# --- classes -------------------------------------------------------------------------------------


def load(place: str) -> Any:
    """Import the object ``module:name``.

    Raises
    ------
    UserError
        If it cannot be imported.
    """
    module, _, name = place.partition(":")
    try:
        return getattr(import_module(module), name)
    except Exception as error:  # foreign code may raise any exception
        raise_interrupt(error)
        raise UserError(f"{place} cannot be imported: {type(error).__name__}: {error}") from error


@cache
def component(name: str) -> type[Component]:
    """Return the class of a component by its FMU name.

    Raises
    ------
    UserError
        If there is no component of that name, or it cannot be imported.
    """
    from .component import Component

    place = find(name, models(), "no component")
    loaded = load(place)
    if not (isinstance(loaded, type) and issubclass(loaded, Component) and loaded.name == name):
        raise UserError(f"{place} is no component with name = {name!r}")
    return loaded


def is_registered(cls: type[Component]) -> bool:
    """Return whether a class is a registered component without effects."""
    return cls.name in models() and component(cls.name) is cls


def member_class(declared: MemberDeclaration) -> type[Component]:
    """Return the class of a member of a system: its component with its effects.

    Raises
    ------
    UserError
        If there is no such component or effect.
    """
    from .effects import stack

    base = component(declared.component)
    if not declared.effects:
        return base
    known = effects(declared.component)
    chosen = [find(name, known, f"{declared.component}: no effect") for name in declared.effects]
    return stack(base, *chosen, name=declared.model_name)


def effects(name: str) -> dict[str, type[Effect]]:
    """Return the effects of a component by id.

    They are in ``EFFECTS`` of the module ``effects`` of its package, if there is one. Effects on
    laws that only other components of the package have are omitted.

    Raises
    ------
    UserError
        If there is no component of that name.
    """
    from importlib.util import find_spec

    cls = component(name)
    module = cls.__module__.rpartition(".")[0] + ".effects"
    if module == ".effects" or not find_spec(module):
        return {}
    known: dict[str, type[Effect]] = import_module(module).EFFECTS
    return {
        id: effect
        for id, effect in known.items()
        if not effect.term.law or hasattr(cls, effect.term.law)
    }
