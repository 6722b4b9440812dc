"""Declarations: what a component's variables are, said once.

A declaration is written as a class attribute; the value of the same name lives in the instance. Units are strings
that pint understands and are SI throughout; ``display`` names the unit people prefer to read.
"""

from __future__ import annotations

import keyword
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any

from .errors import UserError

Number = float | int | bool


@dataclass(kw_only=True, eq=False)
class Declaration:
    """What every variable has: a name, a unit, a range and a sentence.

    Attributes
    ----------
    unit : str
        SI unit as pint reads it (``"N*s/m"``, ``"ohm"``, ``"1"``).
    doc : str
        One sentence for the FMI ``description``.
    min, max : float
        Inclusive range of meaningful values.
    nominal : float
        Typical magnitude; the integrator's absolute error is relative to it.
    display : str or None
        Unit for people (``"mm"``).
    type : {"real", "integer", "boolean"}
        FMI type.
    source : str
        Where the default value or the law comes from.
    name : str
        Filled in by the class body.
    """

    unit: str
    doc: str = ""
    min: float = -inf
    max: float = inf
    nominal: float = 1.0
    display: str | None = None
    type: str = "real"
    source: str = ""
    name: str = field(default="", init=False)

    def __set_name__(self, owner: Any, name: str) -> None:
        self.name = name


@dataclass(kw_only=True, eq=False)
class _Started(Declaration):
    start: Number = 0.0


@dataclass(kw_only=True, eq=False)
class ParameterDeclaration(_Started):
    """A value fixed before the simulation starts."""


@dataclass(kw_only=True, eq=False)
class InputDeclaration(_Started):
    """A value set from outside at communication points."""


@dataclass(kw_only=True, eq=False)
class OutputDeclaration(Declaration):
    """A law whose value is seen from outside."""

    law: Callable[[Any], Any]


@dataclass(kw_only=True, eq=False)
class StateDeclaration(_Started):
    """A continuous state."""

    rate: str
    output: bool = False


@dataclass(kw_only=True, eq=False)
class DiscreteDeclaration(_Started):
    """A state that changes at sample instants only."""

    update: str
    period: str | float
    output: bool = False


def Parameter(default: Number, unit: str, **about: Any) -> Any:
    """Declare a parameter with its default value, unit and range (see :class:`Declaration`)."""
    return ParameterDeclaration(start=default, unit=unit, **about)


def Input(unit: str, start: Number = 0.0, **about: Any) -> Any:
    """Declare an input; ``start`` is its value until it is set."""
    return InputDeclaration(unit=unit, start=start, **about)


def Output(unit: str, **about: Any) -> Callable[[Callable[[Any], Any]], Any]:
    """Declare the decorated law as an output of the same name; its docstring's first line is the description.

    The law stays callable (``self.voltage()``), and a subclass overrides it with a plain method.
    """

    def declare(law: Callable[[Any], Any]) -> Any:
        summary = (law.__doc__ or "").strip().split("\n")[0].rstrip(".")
        return OutputDeclaration(unit=unit, law=law, **{"doc": summary} | about)

    return declare


def State(unit: str, rate: str, start: Number = 0.0, output: bool = False, **about: Any) -> Any:
    """Declare a continuous state; ``rate`` names the method that gives its time derivative.

    Every state ``s`` brings a parameter ``s_start`` whose default is ``start``.
    """
    return StateDeclaration(unit=unit, rate=rate, start=start, output=output, **about)


def Discrete(
    unit: str, update: str, period: str | float, start: Number = 0.0, output: bool = False, **about: Any
) -> Any:
    """Declare a state that changes only at sample instants.

    ``update`` names the method that gives the next value; ``period`` is the sample period in seconds or the name of
    the parameter that holds it. All states of one period are updated together from the values before the instant.

    A sample instant at the end of a communication step is taken at the start of the next one, with the inputs of that
    one; so at the start time the state still shows its start value. Where several periods coincide they are updated
    in order of declaration, and a later one sees the new values of an earlier one.
    """
    return DiscreteDeclaration(unit=unit, update=update, period=period, start=start, output=output, **about)


@dataclass(frozen=True)
class Preset:
    """A named set of parameter values.

    Attributes
    ----------
    values : Mapping[str, float]
        Parameter name to value in the parameter's SI unit.
    doc : str
        What the preset stands for and where its numbers come from.
    """

    values: Mapping[str, float]
    doc: str


@dataclass(frozen=True)
class Layout:
    """The variables of a component in memory order; an index into :attr:`variables` is the FMI value reference."""

    parameters: tuple[ParameterDeclaration, ...]
    inputs: tuple[InputDeclaration, ...]
    states: tuple[StateDeclaration, ...]
    discretes: tuple[DiscreteDeclaration, ...]
    outputs: tuple[OutputDeclaration, ...]

    @property
    def derivatives(self) -> list[tuple[str, str]]:
        """Name ``der(s)`` and unit of every state's derivative, last in memory."""
        return [(f"der({s.name})", f"{s.unit}/s") for s in self.states]

    @property
    def variables(self) -> tuple[Declaration, ...]:
        """Every declared variable in memory order, without the derivatives."""
        return (*self.parameters, *self.inputs, *self.states, *self.discretes, *self.outputs)

    @property
    def names(self) -> list[str]:
        """Every name in memory order, derivatives included."""
        return [v.name for v in self.variables] + [name for name, _ in self.derivatives]

    @property
    def sampled(self) -> list[tuple[str | float, tuple[DiscreteDeclaration, ...]]]:
        """Discrete states grouped by sample period, in order of first appearance."""
        groups: dict[str | float, list[DiscreteDeclaration]] = {}
        for discrete in self.discretes:
            groups.setdefault(discrete.period, []).append(discrete)
        return [(period, tuple(members)) for period, members in groups.items()]

    @property
    def measurable(self) -> list[Declaration]:
        """What a master can read as output: outputs, and the states declared ``output=True``."""
        return [v for v in self.variables if isinstance(v, OutputDeclaration) or getattr(v, "output", False)]


def take(owner: type) -> dict[str, Declaration]:
    """Take the declarations out of a class body, leaving an output's law as an ordinary method.

    CPython reads an instance attribute fast only where the class has none of that name.
    """
    found = {name: value for name, value in vars(owner).items() if isinstance(value, Declaration)}
    for name, declaration in found.items():
        if isinstance(declaration, OutputDeclaration):
            setattr(owner, name, declaration.law)
        else:
            delattr(owner, name)
    return found


def check(owner: Any, layout: Layout) -> None:
    """Check the variables of a class body, for what would otherwise show far from there.

    Parameters
    ----------
    owner : type
        The class; methods that its declarations name must be there unless it is abstract, without a ``name``.
    layout : Layout

    Raises
    ------
    UserError
        Naming class and variable.
    """
    component = owner.__mro__[-2]

    def refuse(variable: Declaration, reason: str) -> None:
        raise UserError(f"{owner.__module__}.{owner.__qualname__}: variable {variable.name!r} {reason}")

    seen = set()
    # parameters last, so that a mistake in a state is not told of its start parameter
    for v in (*layout.inputs, *layout.states, *layout.discretes, *layout.outputs, *layout.parameters):
        taken = component if isinstance(v, OutputDeclaration) else owner  # the law of an output has its name
        if not _is_name(v.name) or v.name.startswith("_"):
            refuse(v, "must be named by an ASCII identifier without an underscore in front")
        if v.name in seen:
            refuse(v, "is declared twice; every state brings its '_start' parameter")
        if v.name in component.__annotations__ or hasattr(taken, v.name):
            refuse(v, "has the name of something else in the class")
        seen.add(v.name)
        if not v.min < v.max:
            refuse(v, f"has an empty range, {v.min:g} to {v.max:g} {v.unit}")
        if not 0.0 < v.nominal < inf:
            refuse(v, f"has the nominal value {v.nominal:g} {v.unit}; it must be positive")
        if v.type not in ("real", "integer", "boolean") or (v.type != "real" and isinstance(v, StateDeclaration)):
            refuse(v, f"is of type {v.type!r}; there are real, integer and boolean, and a continuous state is real")
        if isinstance(v, _Started) and v.type == "integer" and v.start != int(v.start):
            refuse(v, f"is an integer but starts at {v.start:g}")
        if isinstance(v, _Started) and not v.min <= v.start <= v.max:
            refuse(v, f"starts at {v.start:g} {v.unit}, outside its range, {v.min:g} to {v.max:g} {v.unit}")
    if not owner.name:
        return
    if not _is_name(owner.name):
        raise UserError(f"{owner.__module__}.{owner.__qualname__}: name {owner.name!r} must be an ASCII identifier")
    for kind, group in (("rate", layout.states), ("update", layout.discretes)):
        for v in group:
            law = getattr(v, kind)
            if not callable(getattr(owner, law, None)):
                refuse(v, f"has the {kind} {law!r}, which is no method of the class")
    parameters = {p.name: p for p in layout.parameters}
    for title, preset in owner.presets.items():
        for name, value in preset.values.items():
            if name not in parameters or not parameters[name].min <= value <= parameters[name].max:
                raise UserError(f"{owner.name}: preset {title!r} sets {name} to {value:g}, which no parameter allows")
    for d in layout.discretes:
        known = d.period in parameters if isinstance(d.period, str) else 0.0 < d.period < inf
        if not known:
            refuse(d, f"has the period {d.period!r}, which is neither a parameter nor a positive number of seconds")


def _is_name(text: str) -> bool:
    """Whether it can be a name in Python, in C and in FMI's structured naming."""
    return text.isascii() and text.isidentifier() and not keyword.iskeyword(text)


def arrange(declarations: Iterable[Declaration]) -> Layout:
    """Put declarations into memory order, adding the start parameter of every state.

    Parameters
    ----------
    declarations : iterable of Declaration
        In order of appearance, bases first.

    Returns
    -------
    Layout
    """
    declared = list(declarations)

    def of(kind: type) -> tuple[Any, ...]:
        return tuple(v for v in declared if type(v) is kind)

    starts = []
    for state in (*of(StateDeclaration), *of(DiscreteDeclaration)):
        start = ParameterDeclaration(
            start=state.start, unit=state.unit, doc=f"value of {state.name} at the start", min=state.min, max=state.max,
            nominal=state.nominal, display=state.display, type=state.type,
        )  # fmt: skip
        start.name = f"{state.name}_start"
        starts.append(start)
    parameters = (*of(ParameterDeclaration), *starts)
    return Layout(parameters, *map(of, (InputDeclaration, StateDeclaration, DiscreteDeclaration, OutputDeclaration)))
