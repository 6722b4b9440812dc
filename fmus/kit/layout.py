"""The layout of a component: its declared variables in memory order, and their consistency."""

from __future__ import annotations

import keyword
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from inspect import isfunction
from math import inf
from typing import Any, NamedTuple

from .declare import (
    Declaration,
    DiscreteDeclaration,
    InputDeclaration,
    OutputDeclaration,
    ParameterDeclaration,
    Started,
    StateDeclaration,
    TextDeclaration,
    make_start_parameter,
)
from .errors import DeclarationError, UserError, suggestion
from .ports import DOMAINS, PowerPort

_TYPES = ("real", "integer", "boolean")
APART = "_apart"  # declarations of a class body that have left it already
_LONGEST_TEXT = 511  # bytes, of fmi/engine.h
LONGEST_SHIFT = 2  # parameters, of fmi2/any_model.h


class Clock(NamedTuple):
    """When a group of discrete states is sampled: sample k at start + shift + k period.

    Attributes
    ----------
    period : float or str
        Seconds, or the parameter that holds it.
    shift : tuple of str
        Parameters whose sum is the shift.
    """

    period: str | float
    shift: tuple[str, ...] = ()


@dataclass(frozen=True)
class Layout:
    """The variables of a component in memory order.

    An index into :attr:`variables` is the FMI value reference.

    Attributes
    ----------
    parameters : tuple of ParameterDeclaration
        The start values of the states are last among them.
    inputs : tuple of InputDeclaration
    states : tuple of StateDeclaration
    discretes : tuple of DiscreteDeclaration
    outputs : tuple of OutputDeclaration
    texts : tuple of TextDeclaration
        Not in memory; their value references follow those of all names.
    """

    parameters: tuple[ParameterDeclaration, ...]
    inputs: tuple[InputDeclaration, ...]
    states: tuple[StateDeclaration, ...]
    discretes: tuple[DiscreteDeclaration, ...]
    outputs: tuple[OutputDeclaration, ...]
    texts: tuple[TextDeclaration, ...] = ()

    @property
    def parameter_index(self) -> dict[str, int]:
        """Place of every parameter among the parameters."""
        return {p.name: i for i, p in enumerate(self.parameters)}

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

    @cached_property
    def start_parameters(self) -> dict[str, str]:
        """The state that starts at each parameter that is a start value, by name."""
        return {p.name: p.starts for p in self.parameters if p.starts is not None}

    @cached_property
    def start_of(self) -> dict[str, str]:
        """The start parameter of each state, continuous or discrete, by name."""
        return {state: parameter for parameter, state in self.start_parameters.items()}

    @property
    def sampled(self) -> list[tuple[Clock, tuple[DiscreteDeclaration, ...]]]:
        """Discrete states grouped by their clock, in order of first appearance."""
        groups: dict[Clock, list[DiscreteDeclaration]] = {}
        for discrete in self.discretes:
            groups.setdefault(Clock(discrete.period, discrete.shift), []).append(discrete)
        return [(clock, tuple(members)) for clock, members in groups.items()]

    @property
    def clock_parameters(self) -> set[str]:
        """Parameters that say when something is sampled: periods and shifts."""
        names: set[str] = set()
        for clock, _ in self.sampled:
            names.update(clock.shift)
            if isinstance(clock.period, str):
                names.add(clock.period)
        return names

    @property
    def shown(self) -> list[Declaration]:
        """Variables that are outputs of the FMU: outputs, and states declared ``output=True``."""
        return [
            v
            for v in self.variables
            if isinstance(v, OutputDeclaration) or getattr(v, "output", False)
        ]

    @property
    def measurable(self) -> list[Declaration]:
        """Those of them that an instrument can show."""
        return [v for v in self.shown if getattr(v, "measured", True)]

    @property
    def measured_outputs(self) -> tuple[OutputDeclaration, ...]:
        """Outputs that an instrument can show, without states."""
        return tuple(v for v in self.outputs if v.measured)


def law_of(owner: type, name: str) -> Callable[..., Any] | None:
    """Return a method of a class; None if it has none of that name.

    It may have the name of something that is said of an effect, such as its id, which is what
    ``getattr`` gives.
    """
    held = _held(owner, name)
    return held if callable(held) else None


def _held(owner: type, name: str) -> Any:
    """Return what stands under a name in the body of a class, or of its nearest base; or None."""
    return next((vars(part)[name] for part in owner.__mro__ if name in vars(part)), None)


def extract(owner: type) -> dict[str, Declaration]:
    """Take the declarations out of a class body, leaving an output's law as an ordinary method.

    CPython reads an instance attribute fast only where the class has none of that name.

    Parameters
    ----------
    owner : type

    Returns
    -------
    dict of str to Declaration
        By name.
    """
    declared = {
        name: value for name, value in vars(owner).items() if isinstance(value, Declaration)
    }
    apart: dict[str, Declaration] = vars(owner).get(APART, {})
    for name, declaration in declared.items():
        if isinstance(declaration, OutputDeclaration):
            setattr(owner, name, declaration.law)
        else:
            delattr(owner, name)
    return declared | apart


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

    def of_kind(kind: type) -> tuple[Any, ...]:
        return tuple(v for v in declared if type(v) is kind)

    starts = []
    for state in (*of_kind(StateDeclaration), *of_kind(DiscreteDeclaration)):
        start = ParameterDeclaration(
            start=state.start,
            unit=state.unit,
            doc=f"value of {state.name} at the start",
            min=state.min,
            max=state.max,
            nominal=state.nominal,
            display=state.display,
            type=state.type,
        )
        starts.append(make_start_parameter(start, state.name))
    return Layout(
        parameters=(*of_kind(ParameterDeclaration), *starts),
        inputs=of_kind(InputDeclaration),
        states=of_kind(StateDeclaration),
        discretes=of_kind(DiscreteDeclaration),
        outputs=of_kind(OutputDeclaration),
        texts=of_kind(TextDeclaration),
    )


def check_laws(owner: Any) -> None:
    """Check that no law of a class body has the name of something that every component has.

    Parameters
    ----------
    owner : type

    Raises
    ------
    UserError
        Naming class and law.
    """
    component = owner.__mro__[-2]
    taken = {*component.__annotations__, *vars(component)}
    for name, law in vars(owner).items():
        if owner is not component and name in taken and isfunction(law) and name[0] != "_":
            raise UserError(
                f"{owner.__module__}.{owner.__qualname__}: law {name!r} has the name of something"
                " that every component has"
            )


def check(owner: Any, layout: Layout) -> None:
    """Check the variables of a class body for mistakes that would otherwise show far from there.

    Parameters
    ----------
    owner : type
        The class; methods that its declarations name must be there, and its ports fit, unless it is
        abstract, without a ``name``.
    layout : Layout

    Raises
    ------
    UserError
        Naming class and variable.
    """
    _check_variables(owner, layout)
    if owner.name:
        _check_references(owner, layout)
        for port in owner.ports:
            _check_port(owner, layout, port)


def _check_variables(owner: Any, layout: Layout) -> None:
    """Check each variable for itself: name, range, nominal value, type and start value."""
    names: set[str] = set()
    # parameters last, so that a mistake in a state is not blamed on its start parameter
    for v in (
        *layout.inputs,
        *layout.states,
        *layout.discretes,
        *layout.outputs,
        *layout.parameters,
        *layout.texts,
    ):
        _check_name(owner, v, names)
        names.add(v.name)
        if not v.min < v.max:
            raise _mistake(owner, v, f"has an empty range, {_span(v)}")
        if not 0.0 < v.nominal < inf:
            raise _mistake(
                owner, v, f"has the nominal value {v.nominal:g} {v.unit}; it must be positive"
            )
        if isinstance(v, TextDeclaration):
            if len(v.start.encode()) > _LONGEST_TEXT:
                raise _mistake(owner, v, f"starts with a text of more than {_LONGEST_TEXT} bytes")
        else:
            _check_type_and_start(owner, v)


def _check_name(owner: Any, v: Declaration, taken: set[str]) -> None:
    """Check that the name of a variable is an identifier and names nothing else."""
    component = owner.__mro__[-2]
    # the law of an output has its name
    holder = component if isinstance(v, OutputDeclaration) else owner
    if not _is_name(v.name) or v.name.startswith("_"):
        raise _mistake(
            owner, v, "must be named by an ASCII identifier without an underscore in front"
        )
    if v.name in taken:
        raise _mistake(owner, v, "is declared twice; every state brings its '_start' parameter")
    held = _held(holder, v.name)
    # what has a setter computes the variable, as an input that arrives late
    is_taken = held is not None and not hasattr(held, "__set__")
    if v.name in component.__annotations__ or is_taken:
        raise _mistake(
            owner, v, "has the name of something else in the class; give one of both another name"
        )


def _check_type_and_start(owner: Any, v: Declaration) -> None:
    """Check that a variable has a type of FMI, and a start value of that type in its range."""
    if v.type not in _TYPES or (v.type != "real" and isinstance(v, StateDeclaration)):
        kinds = "there are real, integer and boolean, and a continuous state is real"
        raise _mistake(owner, v, f"is of type {v.type!r}; {kinds}")
    if not isinstance(v, Started):
        return
    if v.type == "integer" and v.start != int(v.start):
        raise _mistake(owner, v, f"is an integer but starts at {v.start:g}")
    if not v.min <= v.start <= v.max:
        raise _mistake(owner, v, f"starts at {v.start:g} {v.unit}, outside its range, {_span(v)}")


def _check_references(owner: Any, layout: Layout) -> None:
    """Check the methods, parameters and sample periods that a class names."""
    if not _is_name(owner.name):
        raise UserError(
            f"{owner.__module__}.{owner.__qualname__}: name {owner.name!r} must be an ASCII"
            " identifier"
        )
    for state in layout.states:
        _check_method(owner, state, "rate", state.rate)
    for discrete in layout.discretes:
        _check_method(owner, discrete, "update", discrete.update)
    parameters = {p.name: p for p in layout.parameters}
    for title, preset in owner.presets.items():
        for name, value in preset.values.items():
            if name not in parameters or not parameters[name].min <= value <= parameters[name].max:
                raise UserError(
                    f"{owner.name}: preset {title!r} sets {name} to {value:g}, which no parameter"
                    " allows"
                )
    for discrete in layout.discretes:
        unknown = [name for name in discrete.shift if name not in parameters]
        if unknown:
            raise _mistake(owner, discrete, f"has the shift {unknown[0]!r}, which is no parameter")
        period = discrete.period
        known = period in parameters if isinstance(period, str) else 0.0 < period < inf
        if not known:
            reason = (
                f"has the period {period!r}, which is neither a parameter nor a positive number"
                " of seconds"
            )
            raise _mistake(owner, discrete, reason)


def _check_port(owner: Any, layout: Layout, port: PowerPort) -> None:
    """Check the domain, the variables and the connectors of a port."""
    place = f"{owner.__module__}.{owner.__qualname__}: port {port.name!r}"
    if port.domain not in DOMAINS:
        raise UserError(f"{place} is {port.domain!r}{suggestion(port.domain, DOMAINS)}")
    if len(port.connectors) not in (1, 2):
        raise UserError(f"{place} has {len(port.connectors)} connectors; it may have one or two")
    domain = DOMAINS[port.domain]
    wanted = {port.potential: domain.potential, port.flow: domain.flow}
    if port.rate:
        wanted[port.rate] = f"{domain.potential}/s"
    known = {v.name: v for v in (*layout.inputs, *layout.shown)}
    for name, unit in wanted.items():
        if name not in known:
            raise UserError(
                f"{place} has {name!r}, which is no input or output{suggestion(name, known)}"
            )
        if known[name].unit != unit:
            raise UserError(f"{place} has {name!r} in {known[name].unit}; it must be in {unit}")
    for connector in port.connectors:
        if not _is_name(connector) or connector in layout.names:
            raise UserError(
                f"{place} has a connector {connector!r}; it must be an ASCII identifier and no"
                " variable"
            )


def _check_method(owner: Any, variable: Declaration, kind: str, name: str) -> None:
    """Check that a declaration names a method of the class."""
    if law_of(owner, name) is None:
        component = owner.__mro__[-2]
        laws = [n for n in dir(owner) if law_of(owner, n) and not hasattr(component, n)]
        reason = f"has the {kind} {name!r}, which is no method of the class{suggestion(name, laws)}"
        raise _mistake(owner, variable, reason)


def _mistake(owner: Any, variable: Declaration, reason: str) -> UserError:
    """Return the error for a mistake in a declaration."""
    text = f"{owner.__module__}.{owner.__qualname__}: variable {variable.name!r} {reason}"
    return DeclarationError(text, owner.__qualname__, variable.name)


def _span(variable: Declaration) -> str:
    """Return the range of a variable as text."""
    return f"{variable.min:g} to {variable.max:g} {variable.unit}"


def _is_name(text: str) -> bool:
    """Return whether a text can be a name in Python, in C and in FMI's structured naming."""
    return text.isascii() and text.isidentifier() and not keyword.iskeyword(text)
