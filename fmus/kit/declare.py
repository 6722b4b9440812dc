"""Declarations of a component's variables: kind, unit, range and description, each stated once.

A declaration is written as a class attribute; the value of the same name lives in the instance.
Units are strings that pint understands and are SI throughout; ``display`` names the unit people
prefer to read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, TypeVar

Number = float | int | bool
_D = TypeVar("_D", bound="Declaration")


def summary(documented: Any) -> str:
    """Return the summary of a docstring, in one line and without its full stop.

    It is the first line, and those after it until one ends with a full stop or is empty.

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
    """A number with a unit that is written into laws, such as the acceleration of gravity.

    A parameter is better where somebody may want another value. What is computed of two constants
    has no unit.

    Parameters
    ----------
    value : float
    unit : str
        As pint reads it.
    """

    unit: str

    def __new__(cls, value: float, unit: str) -> Constant:
        """Make the number."""
        made = super().__new__(cls, value)
        made.unit = unit
        return made


@dataclass(kw_only=True, eq=False)
class Declaration:
    """The attributes that every variable has: a name, a unit, a range and a description.

    Attributes
    ----------
    unit : str
        SI unit as pint reads it (``"N*s/m"``, ``"ohm"``, ``"1"``).
    doc : str
        One sentence for the FMI ``description``.
    title : str
        Name for people, such as ``"series resistance"``; the identifier in words where empty.
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
        Set by the class body.
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
    """A variable with a value to begin with.

    Attributes
    ----------
    start : float, int or bool
        SI; of a parameter it is the default.
    """

    start: Number = 0.0


@dataclass(kw_only=True, eq=False)
class ParameterDeclaration(Started):
    """A value fixed before the simulation starts.

    Attributes
    ----------
    starts : str or None
        The state, continuous or discrete, whose start value it is; set where the layout is made.
    fitted : bool
        Whether a diagnosis fits it; of a limit that is only compared with no record tells.
    """

    fitted: bool = True
    starts: str | None = field(default=None, init=False)


@dataclass(kw_only=True, eq=False)
class TextDeclaration(Declaration):
    """A parameter that is a text, such as an address or the name of a file; no law sees it.

    Attributes
    ----------
    start : str
        Its default.
    """

    start: str = ""


@dataclass(kw_only=True, eq=False)
class InputDeclaration(Started):
    """A value set from outside at communication points."""


@dataclass(kw_only=True, eq=False)
class OutputDeclaration(Declaration):
    """A law whose value is seen from outside.

    Attributes
    ----------
    law : callable
        The decorated method.
    measured : bool
        Whether an instrument can show it; what only the model tells has no error of a sensor.
    """

    law: Callable[[Any], Any]
    measured: bool = True


@dataclass(kw_only=True, eq=False)
class StateDeclaration(Started):
    """A continuous state.

    Attributes
    ----------
    rate : str
        Method that gives its time derivative.
    output : bool
        Whether it is an output of the FMU too.
    """

    rate: str
    output: bool = False


@dataclass(kw_only=True, eq=False)
class DiscreteDeclaration(Started):
    """A state that changes at sample instants only.

    Attributes
    ----------
    update : str
        Method that gives its next value.
    period : float or str
        Sample period in seconds, or the parameter that holds it.
    shift : tuple of str
        Parameters whose sum is the time from the start to the first sample instant, seconds.
    output : bool
        Whether it is an output of the FMU too.
    """

    update: str
    period: str | float
    shift: tuple[str, ...] = ()
    output: bool = False


def name_declaration(declaration: _D, name: str) -> _D:
    """Name a declaration outside a class body.

    Parameters
    ----------
    declaration : Declaration
        Changed in place.
    name : str

    Returns
    -------
    Declaration
        The same.
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
        The same.
    """
    parameter.starts = state
    return name_declaration(parameter, f"{state}_start")


def Parameter(default: Number, unit: str, **about: Any) -> Any:
    """Declare a parameter.

    Parameters
    ----------
    default : float, int or bool
        SI.
    unit : str
        SI unit as pint reads it.
    **about
        The other attributes of :class:`Declaration`: range, nominal value, description, ...
    """
    return ParameterDeclaration(start=default, unit=unit, **about)


def Text(default: str, doc: str) -> Any:
    """Declare a parameter that is a text, for a component with an engine of its own.

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
        Its value until it is set, SI.
    **about
        See :func:`Parameter`.
    """
    return InputDeclaration(unit=unit, start=start, **about)


def Output(unit: str, **about: Any) -> Callable[[Callable[[Any], Any]], Any]:
    """Declare the decorated law as an output of the same name.

    The first line of its docstring is the description. The law stays callable
    (``self.voltage()``), and a subclass overrides it with a plain method.

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
    """Declare a continuous state; every state ``s`` brings a parameter ``s_start``.

    Parameters
    ----------
    unit : str
        SI unit as pint reads it.
    rate : str
        Method that gives its time derivative.
    start : float
        Default of its start parameter, SI.
    output : bool
        Whether it is an output of the FMU too.
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

    All states of one clock, which is a period and a shift, are updated together from the values
    before the instant. Where several clocks coincide they are updated in order of declaration, and
    a later one sees the new values of an earlier one.

    A sample instant at the end of a communication step is taken at the start of the next one, with
    the inputs of that one; so at the start time the state still shows its start value.

    Parameters
    ----------
    unit : str
        SI unit as pint reads it.
    update : str
        Method that gives the next value.
    period : float or str
        Sample period in seconds, or the parameter that holds it.
    start : float, int or bool
        Default of its start parameter, SI.
    output : bool
        Whether it is an output of the FMU too.
    shift : tuple of str
        Parameters whose sum is the time from the start to the first sample instant, seconds; a
        shift of a clock as FMI 3.0 has it (section 2.2.8.3).
    **about
        See :func:`Parameter`.
    """
    return DiscreteDeclaration(
        unit=unit, update=update, period=period, start=start, output=output, shift=shift, **about
    )


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
    """The engine that computes a component without laws, such as a rig at the end of a cable.

    Such a component keeps something outside of its memory, so its FMU state cannot be saved.

    Attributes
    ----------
    slave : str
        Class with the methods of :class:`fmus.kit.slave.Slave`, ``module:Class``; called with the
        component's class, its memory and its texts.
    needs : Mapping of str to str
        Packages that it imports at run time, by the name that is imported: what to install.
    folder : str
        Package with the C files of the native build.
    sources : tuple of str
        C files, which implement the engine of ``fmi/engine.h``.
    headers : tuple of str
    libraries : Mapping of str to tuple of str
        Names for ``-l`` by FMI platform.
    """

    slave: str
    needs: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""
    sources: tuple[str, ...] = ()
    headers: tuple[str, ...] = ()
    libraries: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
