"""Declarations of a component's variables: kind, unit, range and description.

A declaration is a class attribute; the attribute of the same name of an instance is the value.
Units are SI, as strings that pint reads; ``display`` is the unit shown to people.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from math import inf, prod
from typing import Any, TypeVar

from .errors import UserError

Number = float | int | bool
_D = TypeVar("_D", bound="Declaration")
# names of pint for scales of temperature with another zero
_SCALES = ("degC", "°C", "celsius", "degreeC", "degree_Celsius", "degF", "°F", "fahrenheit")
# a sample period, s, that leaves one sample in any simulation: the one at the start
ONCE = 1e9


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


def of_differences(unit: str) -> str:
    """Return the unit of differences of values in a unit: ``delta_degC`` for ``degC``.

    It needs no library, unlike that of :mod:`.units`, for what travels inside an FMU.
    """
    return f"delta_{unit}" if unit in _SCALES else unit


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

    def __getnewargs__(self) -> tuple[float, str]:  # type: ignore[override]
        """Return number and unit, for copies."""
        return float(self), self.unit


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
    is_memory : bool
        Whether its first sample replaces a start value that has no meaning.
    """

    update: str
    period: str | float
    shift: tuple[str, ...] = ()
    output: bool = False
    is_memory: bool = False


@dataclass(frozen=True)
class ArrayDeclaration:
    """An array of variables of one kind, whose elements are named ``x[1]`` or ``x[1,1]``.

    Attributes
    ----------
    element : Declaration
        What all elements have in common.
    shape : tuple
        Of each dimension the size, or a function that returns it for a class.
    starts : sequence of float
        Start value of each element, row by row; empty for that of `element`.
    """

    element: Declaration
    shape: tuple[int | Callable[[Any], int], ...]
    starts: Sequence[Number] = ()

    def elements(self, owner: Any, name: str) -> dict[str, Declaration]:
        """Return the elements by name, row by row, and give a class the law of each.

        Parameters
        ----------
        owner : type
        name : str

        Raises
        ------
        UserError
            If a size is no positive number, or there are more or fewer start values than elements.
        """
        shape = [size(owner) if callable(size) else size for size in self.shape]
        count = prod(shape)
        if min(shape, default=0) < 1 or len(self.starts) not in (0, count):
            size = " x ".join(map(str, shape))
            raise UserError(
                f"{owner.__module__}.{owner.__qualname__}: array {name!r} has {size} elements and"
                f" {len(self.starts)} start values; it needs at least one, and a value for each"
            )
        declared = {}
        for k, place in enumerate(product(*(range(1, size + 1) for size in shape))):
            start: dict[str, Any] = {"start": self.starts[k]} if self.starts else {}
            element = name_declaration(replace(self.element, **start), _element_name(name, place))
            for law in _LAWS & vars(element).keys():
                _bind_law(owner, element, law, place)
            declared[element.name] = element
        return declared


class Elements:
    """The elements of an array of an instance, ``self.x[1]`` or ``self.x[1, 1]``.

    Parameters
    ----------
    name : str
    instance : object
        Its attributes are the elements, by their names.
    """

    def __init__(self, name: str, instance: Any = None):
        self.name = name
        self.instance = instance

    def __get__(self, instance: Any, owner: Any) -> Elements:
        return Elements(self.name, instance)

    def __getitem__(self, place: int | tuple[int, ...]) -> Any:
        return getattr(self.instance, _element_name(self.name, place))

    def __setitem__(self, place: int | tuple[int, ...], value: Any) -> None:
        setattr(self.instance, _element_name(self.name, place), value)


@cache
def _element_name(array: str, place: int | tuple[int, ...]) -> str:
    indices = place if isinstance(place, tuple) else (place,)
    return f"{array}[{','.join(map(str, indices))}]"


_LAWS = {"rate", "update", "law"}  # attributes of declarations that are laws


def _bind_law(owner: Any, element: Any, kind: str, place: tuple[int, ...]) -> None:
    """Give a class the law of an element, which is that of the array for this place."""
    of_array = getattr(element, kind)

    def law(self: Any) -> Any:
        return of_array(self, *place) if kind == "law" else getattr(self, of_array)(*place)

    name = element.name if kind == "law" else _element_name(of_array, place)
    law.__doc__ = f"Element of :meth:`{name}`."
    setattr(owner, name, law)
    setattr(element, kind, law if kind == "law" else name)


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


def Array(element: Any, *shape: int | Callable[[Any], int], starts: Sequence[Number] = ()) -> Any:
    """Declare an array: one variable in FMI 3.0, one for each element in FMI 2.0.

    Its law takes the indices of an element, from 1; laws read it as ``self.x[1]``. The start
    values of states are an array ``x_start``.

    Parameters
    ----------
    element : Declaration
        What all elements have in common, as :func:`Discrete` declares it.
    *shape : int or callable
        Of each dimension the size, or a function that returns it for a class, so that a subclass
        can have another size.
    starts : sequence of float
        Start value of each element, row by row; by default that of `element` for all.
    """
    return ArrayDeclaration(element, shape, starts)


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
