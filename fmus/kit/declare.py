"""Declarations of a component's variables: kind, unit, range and description.

A declaration is a class attribute; the attribute of the same name of an instance is the value.
Units are SI, as strings that pint reads; ``display`` is the unit shown to people.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from math import inf
from typing import Any, TypeVar

Number = float | int | bool
_D = TypeVar("_D", bound="Declaration")


def summary(documented: Any) -> str:
    """Return the summary of a docstring in one line, without its full stop.

    The summary ends at the first line that ends with a full stop, or before the first empty line.

    Parameters
    ----------
    documented : object
        A class, or a function.

    Returns
    -------
    str
        Empty if it has no docstring.
    """
    lines: list[str] = []
    for line in (documented.__doc__ or "").strip().split("\n"):
        if not line.strip() or (lines and lines[-1].endswith(".")):
            break
        lines.append(line.strip())
    return " ".join(lines).rstrip(".")


class Constant(float):
    """A number with a unit for use in laws, such as the acceleration of gravity.

    Declare a parameter instead if the value may change. The result of arithmetic with a constant is
    a plain float, without a unit.

    Parameters
    ----------
    value : float
    unit : str
        SI unit as pint reads it.
    """

    unit: str

    def __new__(cls, value: float, unit: str) -> Constant:
        """Make the number."""
        constant = super().__new__(cls, value)
        constant.unit = unit
        return constant


@dataclass(kw_only=True, eq=False)
class Declaration:
    """A declared variable: its name, unit, range and description.

    Attributes
    ----------
    unit : str
        SI unit as pint reads it (``"N*s/m"``, ``"ohm"``, ``"1"``).
    doc : str
        One sentence for the FMI ``description``.
    title : str
        Name for people, such as ``"series resistance"``; if empty, the identifier in words.
    min, max : float
        Inclusive range of meaningful values.
    nominal : float
        Typical magnitude; the integrator's absolute error is relative to it.
    display : str or None
        Unit for people (``"mm"``).
    type : {"real", "integer", "boolean"}
        FMI type.
    source : str
        Source of the default value or of the law.
    name : str
        Name of the class attribute.
    """

    unit: str
    doc: str = ""
    title: str = ""
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
class Started(Declaration):
    """A variable with a start value.

    Attributes
    ----------
    start : float, int or bool
        Start value, SI; the default of a parameter.
    """

    start: Number = 0.0


@dataclass(kw_only=True, eq=False)
class ParameterDeclaration(Started):
    """A value that does not change by itself during a simulation.

    Attributes
    ----------
    starts : str or None
        State, continuous or discrete, whose start value it is; set when the layout is made.
    fitted : bool
        Whether a diagnosis fits it. False for example for a limit of a comparison, which no record
        can identify.
    tunable : bool or None
        Whether a host may change it during a simulation, between steps or at an event. States keep
        their values then, so that none may stand for a product with the parameter. None: no, except
        for the parameter that switches an effect.
    """

    fitted: bool = True
    tunable: bool | None = None
    starts: str | None = field(default=None, init=False)


@dataclass(kw_only=True, eq=False)
class TextDeclaration(Declaration):
    """A parameter that is a text, such as an address or the name of a file; no law can use it.

    Attributes
    ----------
    start : str
        Default.
    """

    start: str = ""


@dataclass(kw_only=True, eq=False)
class InputDeclaration(Started):
    """A value that a host sets at communication points."""


@dataclass(kw_only=True, eq=False)
class OutputDeclaration(Declaration):
    """A law whose value is an output of the FMU.

    Attributes
    ----------
    law : callable
        The decorated method.
    measured : bool
        Whether an instrument can measure it; effects of sensors are for measured outputs only.
    """

    law: Callable[[Any], Any]
    measured: bool = True


@dataclass(kw_only=True, eq=False)
class StateDeclaration(Started):
    """A continuous state.

    Attributes
    ----------
    rate : str
        Method that returns its time derivative.
    output : bool
        Whether it is also an output of the FMU.
    """

    rate: str
    output: bool = False


@dataclass(kw_only=True, eq=False)
class DiscreteDeclaration(Started):
    """A state that changes at sample instants only.

    Attributes
    ----------
    update : str
        Method that returns its next value.
    period : float or str
        Sample period in seconds, or the name of the parameter for it.
    shift : tuple of str
        Parameters whose sum is the time from the start to the first sample instant, seconds.
    output : bool
        Whether it is also an output of the FMU.
    """

    update: str
    period: str | float
    shift: tuple[str, ...] = ()
    output: bool = False


@dataclass(frozen=True)
class ArrayDeclaration:
    """An array of variables that differ in their start values and laws alone.

    Attributes
    ----------
    shape : tuple of int
    element : callable
        Makes the declaration of an element from its indices, from 1.
    """

    shape: tuple[int, ...]
    element: Callable[..., Declaration]

    def elements(self, name: str) -> dict[str, Declaration]:
        """Return the declarations of all elements by name, ``x[1,2]``, row by row."""
        places = list(product(*(range(1, size + 1) for size in self.shape)))
        names = [f"{name}[{','.join(map(str, place))}]" for place in places]
        return {
            name: name_declaration(self.element(*place), name)
            for name, place in zip(names, places, strict=True)
        }


def name_declaration(declaration: _D, name: str) -> _D:
    """Set the name of a declaration outside a class body.

    Parameters
    ----------
    declaration : Declaration
        Changed in place.
    name : str

    Returns
    -------
    Declaration
        The argument.
    """
    declaration.name = name
    return declaration


def make_start_parameter(parameter: ParameterDeclaration, state: str) -> ParameterDeclaration:
    """Make a parameter the start value of a state, and name it after that state.

    Parameters
    ----------
    parameter : ParameterDeclaration
        Changed in place.
    state : str
        Name of the state, continuous or discrete.

    Returns
    -------
    ParameterDeclaration
        The argument.
    """
    parameter.starts = state
    stem, bracket, place = state.partition("[")
    return name_declaration(parameter, f"{stem}_start{bracket}{place}")


def Parameter(default: Number, unit: str, **about: Any) -> Any:
    """Declare a parameter.

    Parameters
    ----------
    default : float, int or bool
        Default value, SI.
    unit : str
        SI unit as pint reads it.
    **about
        Other attributes of :class:`ParameterDeclaration`: range, nominal value, description, ...
    """
    return ParameterDeclaration(start=default, unit=unit, **about)


def Text(default: str, doc: str) -> Any:
    """Declare a text parameter, for a component with an engine of its own.

    Parameters
    ----------
    default : str
        At most 511 bytes of UTF-8.
    doc : str
        One sentence for the FMI ``description``.
    """
    return TextDeclaration(start=default, unit="1", doc=doc, type="string")


def Input(unit: str, start: Number = 0.0, **about: Any) -> Any:
    """Declare an input.

    Parameters
    ----------
    unit : str
        SI unit as pint reads it.
    start : float, int or bool
        Value until a host sets it, SI.
    **about
        See :func:`Parameter`.
    """
    return InputDeclaration(unit=unit, start=start, **about)


def Output(unit: str, **about: Any) -> Callable[[Callable[[Any], Any]], Any]:
    """Declare the decorated law as an output of the same name.

    The summary of its docstring is the description. The law remains a method (``self.voltage()``),
    and a subclass overrides it with a plain method.

    Parameters
    ----------
    unit : str
        SI unit as pint reads it.
    **about
        See :func:`Parameter`.

    Returns
    -------
    callable
        Decorator of the law.
    """

    def declare(law: Callable[[Any], Any]) -> Any:
        return OutputDeclaration(unit=unit, law=law, **{"doc": summary(law)} | about)

    return declare


def State(unit: str, rate: str, start: Number = 0.0, output: bool = False, **about: Any) -> Any:
    """Declare a continuous state ``s``, and with it a parameter ``s_start``.

    Parameters
    ----------
    unit : str
        SI unit as pint reads it.
    rate : str
        Method that returns its time derivative.
    start : float
        Default of its start parameter, SI.
    output : bool
        Whether it is also an output of the FMU.
    **about
        See :func:`Parameter`.
    """
    return StateDeclaration(unit=unit, rate=rate, start=start, output=output, **about)


def Discrete(
    unit: str,
    update: str,
    period: str | float,
    start: Number = 0.0,
    output: bool = False,
    shift: tuple[str, ...] = (),
    **about: Any,
) -> Any:
    """Declare a state that changes only at sample instants.

    All states of one clock (a period and a shift) are updated together from the values before the
    instant. Clocks that tick at the same instant are updated in order of declaration, and a later
    one uses the new values of an earlier one.

    A sample instant at the end of a communication step is taken at the start of the next step, with
    its inputs; therefore at the start time the state has its start value.

    Parameters
    ----------
    unit : str
        SI unit as pint reads it.
    update : str
        Method that returns the next value.
    period : float or str
        Sample period in seconds, or the name of the parameter for it.
    start : float, int or bool
        Default of its start parameter, SI.
    output : bool
        Whether it is also an output of the FMU.
    shift : tuple of str
        Parameters whose sum is the time from the start to the first sample instant, seconds: the
        shift of a clock (FMI 3.0, section 2.2.8.3).
    **about
        See :func:`Parameter`.
    """
    return DiscreteDeclaration(
        unit=unit, update=update, period=period, start=start, output=output, shift=shift, **about
    )


def Array(shape: int | tuple[int, ...], element: Callable[..., Any]) -> Any:
    """Declare an array ``x`` of variables, whose elements are ``x[1]`` or ``x[1,1]``.

    In FMI 3.0 it is one variable, in FMI 2.0 one for each element. An element is read by
    ``getattr(self, "x[1]")``. The start values of an array of states are an array ``x_start``.

    Parameters
    ----------
    shape : int or tuple of int
    element : callable
        Makes the declaration of an element from its indices, from 1. Elements may differ in their
        start values and laws.
    """
    return ArrayDeclaration((shape,) if isinstance(shape, int) else shape, element)


@dataclass(frozen=True)
class Preset:
    """A named set of parameter values.

    Attributes
    ----------
    values : Mapping[str, float]
        Parameter name to value in the parameter's SI unit.
    doc : str
        Meaning of the preset and the source of its numbers.
    """

    values: Mapping[str, float]
    doc: str


@dataclass(frozen=True)
class Engine:
    """The engine that computes a component without laws, such as a connection to a rig.

    The FMU state of such a component cannot be saved, because part of it is outside the FMU.

    Attributes
    ----------
    slave : str
        Class with the methods of :class:`fmus.kit.slave.Slave`, ``module:Class``; its arguments are
        the component's class, memory and texts.
    needs : Mapping of str to str
        Packages that it imports at run time: name of the distribution by name of the module.
    folder : str
        Package with the C files of the native build.
    sources : tuple of str
        C files, which implement the engine of ``fmi/engine.h``.
    headers : tuple of str
        Header files.
    libraries : Mapping of str to tuple of str
        Names for ``-l`` by FMI platform.
    """

    slave: str
    needs: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""
    sources: tuple[str, ...] = ()
    headers: tuple[str, ...] = ()
    libraries: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
