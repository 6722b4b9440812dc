"""The layout of a component: its declared variables in memory order, and checks of them."""

from __future__ import annotations

import keyword
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from inspect import isfunction, signature
from itertools import chain
from math import inf, prod
from typing import Any, NamedTuple

from .declare import (
    ArrayDeclaration,
    Declaration,
    DiscreteDeclaration,
    Elements,
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
APART = "_apart"  # class attribute for declarations that are not members of the class
_LONGEST_TEXT = 511  # bytes, as in fmi/engine.h
LONGEST_SHIFT = 2  # parameters, as in fmi/any_model.h


class Clock(NamedTuple):
    """The clock of a group of discrete states, with sample k at start + shift + k period.

    Attributes
    ----------
    period : float or str
        Seconds, or the name of the parameter for it.
    shift : tuple of str
        Parameters whose sum is the shift.
    """

    period: str | float
    shift: tuple[str, ...] = ()


class ArrayPlace(NamedTuple):
    """The place of an array in memory, where its elements follow one another row by row.

    Attributes
    ----------
    name : str
    first : int
        Index of its first element.
    shape : tuple of int
    """

    name: str
    first: int
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of elements."""
        return prod(self.shape)


@dataclass(frozen=True)
class Layout:
    """The variables of a component in memory order.

    An index into :attr:`variables` is the FMI value reference.

    Attributes
    ----------
    parameters : tuple of ParameterDeclaration
        The start values of the states are the last of them.
    inputs : tuple of InputDeclaration
    states : tuple of StateDeclaration
    discretes : tuple of DiscreteDeclaration
    outputs : tuple of OutputDeclaration
    texts : tuple of TextDeclaration
        They are not in memory; their value references come after those of all names.
    """

    parameters: tuple[ParameterDeclaration, ...]
    inputs: tuple[InputDeclaration, ...]
    states: tuple[StateDeclaration, ...]
    discretes: tuple[DiscreteDeclaration, ...]
    outputs: tuple[OutputDeclaration, ...]
    texts: tuple[TextDeclaration, ...] = ()

    @property
    def parameter_index(self) -> dict[str, int]:
        """Index of every parameter among the parameters, by name."""
        return {p.name: i for i, p in enumerate(self.parameters)}

    @property
    def derivatives(self) -> list[tuple[str, str]]:
        """Name ``der(s)`` and unit of the derivative of every state; they are last in memory."""
        return [(f"der({s.name})", f"{s.unit}/s") for s in self.states]

    @property
    def variables(self) -> tuple[Declaration, ...]:
        """Every declared variable in memory order, without the derivatives."""
        return (*chain(*self.arguments), *self.outputs)

    @property
    def arguments(self) -> tuple[tuple[Declaration, ...], ...]:
        """Groups of the variables that laws are functions of, besides the time."""
        return self.parameters, self.inputs, self.states, self.discretes

    @property
    def names(self) -> list[str]:
        """Every name in memory order, derivatives included."""
        return [v.name for v in self.variables] + [name for name, _ in self.derivatives]

    @cached_property
    def arrays(self) -> tuple[ArrayPlace, ...]:
        """Arrays in memory order, with those of start values and derivatives."""
        elements: dict[str, list[tuple[int, str]]] = {}
        for index, name in enumerate(self.names):
            stem, bracket, rest = name.partition("[")
            place, _, end = rest.partition("]")
            if bracket and place.replace(",", "").isdigit():  # in FMUs of others any text
                elements.setdefault(stem + end, []).append((index, place))
        return tuple(
            ArrayPlace(name, members[0][0], tuple(map(int, members[-1][1].split(","))))
            for name, members in elements.items()
        )

    @cached_property
    def start_parameters(self) -> dict[str, str]:
        """State of each start parameter, by name of the parameter."""
        return {p.name: p.starts for p in self.parameters if p.starts is not None}

    @cached_property
    def start_of(self) -> dict[str, str]:
        """Start parameter of each state, continuous or discrete, by name of the state."""
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
        """Parameters that are periods or shifts of clocks."""
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
        """Outputs of the FMU that an instrument can measure."""
        return [v for v in self.shown if getattr(v, "measured", True)]

    @property
    def measured_outputs(self) -> tuple[OutputDeclaration, ...]:
        """Outputs that an instrument can measure, without states."""
        return tuple(v for v in self.outputs if v.measured)


def law_of(owner: type, name: str) -> Callable[..., Any] | None:
    """Return a method of a class; None if it has none of that name.

    A law may have the name of an attribute of effects, such as ``id``, which ``getattr`` would
    return instead.
    """
    member = _member(owner, name)
    return member if callable(member) else None


def takes_arguments(owner: type, name: str) -> bool:
    """Return whether a method of a class takes more than its instance."""
    method = law_of(owner, name)
    return method is not None and len(signature(method).parameters) > 1


def _member(owner: type, name: str) -> Any:
    """Return a member from the body of a class, or of its nearest base; None if there is none."""
    return next((vars(part)[name] for part in owner.__mro__ if name in vars(part)), None)


def _component_class(owner: type) -> type:
    """Return the class `Component`, which this module cannot import: the last base but object."""
    return owner.__mro__[-2]


def extract(owner: type) -> dict[str, Declaration | ArrayDeclaration]:
    """Remove the declarations from a class; the law of an output stays as a method.

    CPython reads an instance attribute fast only if the class has no attribute of that name.

    Parameters
    ----------
    owner : type

    Returns
    -------
    dict of str to Declaration or ArrayDeclaration
        Declaration by name.
    """
    declared = {
        name: value
        for name, value in vars(owner).items()
        if isinstance(value, Declaration | ArrayDeclaration)
    }
    apart: dict[str, Declaration] = vars(owner).get(APART, {})
    for name, declaration in declared.items():
        if isinstance(declaration, OutputDeclaration):
            setattr(owner, name, declaration.law)
        elif isinstance(declaration, ArrayDeclaration):
            setattr(owner, name, Elements(name))
        else:
            delattr(owner, name)
    return declared | apart


def expand(
    owner: type, declared: Mapping[str, Declaration | ArrayDeclaration]
) -> dict[str, Declaration]:
    """Replace arrays by their elements, and give a class the law of each element.

    Parameters
    ----------
    owner : type
    declared : Mapping of str to Declaration or ArrayDeclaration
        In order of appearance; that of an element replaces the one of its array before it.

    Returns
    -------
    dict of str to Declaration
    """
    expanded: dict[str, Declaration] = {}
    for name, declaration in declared.items():
        if isinstance(declaration, ArrayDeclaration):
            expanded |= declaration.elements(owner, name)
        else:
            expanded[name] = declaration
    return expanded


def arrange(declarations: Iterable[Declaration]) -> Layout:
    """Arrange declarations in memory order, and add the start parameter of every state.

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
            doc=f"value of {state.name.partition('[')[0]} at the start",
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
    """Raise an error if a law of a class has the name of a member of every component.

    Parameters
    ----------
    owner : type

    Raises
    ------
    UserError
        With the names of class and law.
    """
    component = _component_class(owner)
    taken = {*component.__annotations__, *vars(component)}
    for name, law in vars(owner).items():
        if owner is not component and name in taken and isfunction(law) and name[0] != "_":
            raise UserError(
                f"{owner.__module__}.{owner.__qualname__}: law {name!r} has the name of something"
                " that every component has"
            )


def check(owner: Any, layout: Layout) -> None:
    """Raise an error for a mistake in the declarations of a class.

    Parameters
    ----------
    owner : type
        The class. Methods that its declarations name, and its ports, are checked only if it has a
        ``name``, as abstract classes have none.
    layout : Layout

    Raises
    ------
    UserError
        With the names of class and variable.
    """
    _check_variables(owner, layout)
    for array in layout.arrays:
        if array.name in layout.names:
            first = layout.variables[array.first]
            raise _mistake(owner, first, "is of an array that has the name of another variable")
    if owner.name:
        _check_references(owner, layout)
        for port in owner.ports:
            _check_port(owner, layout, port)


def _check_variables(owner: Any, layout: Layout) -> None:
    """Check name, range, nominal value, type and start value of each variable."""
    names: set[str] = set()
    # parameters last, so that a message about a state does not name its start parameter
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
            raise _mistake(owner, v, f"has an empty range, {_range_text(v)}")
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
    """Check that the name of a variable is an identifier and not that of another member."""
    component = _component_class(owner)
    # the law of an output has its name
    holder = component if isinstance(v, OutputDeclaration) else owner
    name = v.name.partition("[")[0]
    if not _is_name(name) or name.startswith("_"):
        raise _mistake(
            owner, v, "must be named by an ASCII identifier without an underscore in front"
        )
    if v.name in taken:
        raise _mistake(owner, v, "is declared twice; every state brings its '_start' parameter")
    member = _member(holder, name)
    # a descriptor with a setter computes the variable, such as an input that arrives late
    is_taken = not (member is None or hasattr(member, "__set__") or isinstance(member, Elements))
    if name in component.__annotations__ or is_taken:
        raise _mistake(
            owner, v, "has the name of something else in the class; give one of both another name"
        )


def _check_type_and_start(owner: Any, v: Declaration) -> None:
    """Check that a variable has a type of FMI, and that its start value fits type and range."""
    if v.type not in _TYPES or (v.type != "real" and isinstance(v, StateDeclaration)):
        kinds = "there are real, integer and boolean, and a continuous state is real"
        raise _mistake(owner, v, f"is of type {v.type!r}; {kinds}")
    if not isinstance(v, Started):
        return
    if v.type == "integer" and v.start != int(v.start):
        raise _mistake(owner, v, f"is an integer but starts at {v.start:g}")
    if not v.min <= v.start <= v.max:
        raise _mistake(
            owner, v, f"starts at {v.start:g} {v.unit}, outside its range, {_range_text(v)}"
        )


def _check_references(owner: Any, layout: Layout) -> None:
    """Check the name of a class, and the methods and parameters that its declarations name."""
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
    _check_presets(owner, parameters)
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


def _check_presets(owner: Any, parameters: Mapping[str, ParameterDeclaration]) -> None:
    """Check that presets, which become files, set parameters within their ranges."""
    for title, preset in owner.presets.items():
        if not _is_name(title):
            raise UserError(f"{owner.name}: preset {title!r} must be an ASCII identifier")
        for name, value in preset.values.items():
            parameter = parameters.get(name)
            if parameter is None or not parameter.min <= value <= parameter.max:
                raise UserError(
                    f"{owner.name}: preset {title!r} sets {name} to {value:g}, which no parameter"
                    " allows"
                )


def _check_port(owner: Any, layout: Layout, port: PowerPort) -> None:
    """Check the domain, the variables and the connectors of a port."""
    place = f"{owner.__module__}.{owner.__qualname__}: port {port.name!r}"
    if port.domain not in DOMAINS:
        raise UserError(f"{place} is {port.domain!r}{suggestion(port.domain, DOMAINS)}")
    if len(port.connectors) not in (1, 2):
        raise UserError(f"{place} has {len(port.connectors)} connectors; it may have one or two")
    domain = DOMAINS[port.domain]
    required_units = {port.potential: domain.potential, port.flow: domain.flow}
    if port.rate:
        required_units[port.rate] = f"{domain.potential}/s"
    known = {v.name: v for v in (*layout.inputs, *layout.shown)}
    for name, unit in required_units.items():
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
        component = _component_class(owner)
        laws = [n for n in dir(owner) if law_of(owner, n) and not hasattr(component, n)]
        reason = f"has the {kind} {name!r}, which is no method of the class{suggestion(name, laws)}"
        raise _mistake(owner, variable, reason)


def _mistake(owner: Any, variable: Declaration, reason: str) -> UserError:
    """Return the error for a mistake in a declaration."""
    text = f"{owner.__module__}.{owner.__qualname__}: variable {variable.name!r} {reason}"
    return DeclarationError(text, owner.__qualname__, variable.name)


def _range_text(variable: Declaration) -> str:
    """Return the range of a variable as text."""
    return f"{variable.min:g} to {variable.max:g} {variable.unit}"


def _is_name(text: str) -> bool:
    """Return whether a text can be a name in Python, in C and in FMI's structured naming."""
    return text.isascii() and text.isidentifier() and not keyword.iskeyword(text)
