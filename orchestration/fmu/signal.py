"""A variable of an FMU as a user meets it, and the values it can have: numbers, or texts."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fmus.kit import units
from fmus.kit.declare import Declaration
from fmus.kit.errors import UserError
from fmus.kit.units import allowed, shown

_QUANTITY = re.compile(r"^\s*(?P<number>[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)\s*(?P<unit>.*)$")
_WORDS = {"true": 1.0, "false": 0.0}
_LARGEST = 2**31 - 1  # integers of FMI 2.0 have 32 bits

Value = (
    float | str
)  # of a variable: a number in the FMU's unit (0 and 1 for a boolean), or a text for a string


@dataclass
class Signal:
    """A variable; `show` and `fmus.kit.units.allowed` write its values and its range.

    Attributes
    ----------
    name : str
    type : {"real", "integer", "boolean", "string"}
    unit : str
        The FMU's; ``"1"`` where it declares none.
    display : str
        Unit that people prefer to read.
    start : float
        Start value, for inputs and parameters.
    min, max : float
        Allowed range.
    doc : str
        What it is, in words.
    text : str
        Start value of a string, whose `start` is 0.
    """

    name: str
    type: str
    unit: str
    display: str
    start: float
    min: float
    max: float
    doc: str = ""
    text: str = ""

    @property
    def default(self) -> Value:
        """Start value, of whichever kind it is."""
        return self.text if self.type == "string" else self.start


def read_signal(variable: Any) -> Signal:
    """Gather what fmpy has read of a scalar variable; type definitions fill what the variable leaves out.

    Raises
    ------
    UserError
        If its start value, or an end of its range, is no number.
    """

    def attribute(name: str) -> str | None:
        return getattr(variable, name, None) or getattr(variable.declaredType, name, None)

    def number(name: str, text: str | None, default: float) -> float:
        if not text:
            return default
        try:
            return _WORDS[text] if text in _WORDS else float(text)
        except ValueError:
            raise UserError(
                f"modelDescription.xml: {variable.name}: {name} {text[:40]!r} is no number"
            ) from None

    unit, doc = attribute("unit") or "1", variable.description or ""
    if type_of(variable) == "string":
        return Signal(
            variable.name, "string", "1", "1", 0.0, -math.inf, math.inf, doc, variable.start or ""
        )
    low, high = (
        number("min", attribute("min"), -math.inf),
        number("max", attribute("max"), math.inf),
    )
    start = number("start", variable.start, 0.0)
    unit, display = units.familiar(unit), units.familiar(attribute("displayUnit") or unit)
    return Signal(variable.name, type_of(variable), unit, display, start, low, high, doc)


def declared_signal(variable: Declaration) -> Signal:
    """Gather what a component declares of a variable, as its FMU will tell it."""
    start: Any = getattr(variable, "start", 0.0)
    number, text = (0.0, str(start)) if variable.type == "string" else (float(start), "")
    display, bounds = variable.display or variable.unit, (variable.min, variable.max)
    return Signal(
        variable.name, variable.type, variable.unit, display, number, *bounds, variable.doc, text
    )


def type_of(variable: Any) -> str:
    """Type of fmpy's scalar variable: real, integer (enumerations too), boolean or string."""
    return "integer" if variable.type == "Enumeration" else str(variable.type).lower()


def is_text(kind: str, value: Value, where: str) -> bool:
    """Whether a value is a text that its type wants; this is where texts and numbers are told apart.

    Parameters
    ----------
    kind : {"real", "integer", "boolean", "string"}
    value : float or str
    where : str
        What the message begins with.

    Raises
    ------
    UserError
        If it is a number for a text, or a text for a number.
    """
    if isinstance(value, str) != (kind == "string"):
        is_, wanted = (
            ("a text", f"{kind} and takes a number")
            if isinstance(value, str)
            else ("a number", "a text")
        )
        raise UserError(f"{where}: {value!r} is {is_}; the parameter is {wanted}")
    return isinstance(value, str)


def numeric(values: Mapping[str, Value]) -> dict[str, float]:
    """Return values for what computes with them.

    Raises
    ------
    UserError
        If one is a text.
    """
    for name, value in values.items():
        if isinstance(value, str):
            raise UserError(f"{name} = {value!r}: is a text; this can take numbers only")
    return {name: float(value) for name, value in values.items()}


def check_value(signal: Signal, value: Value, where: str) -> None:
    """Refuse a value that a variable cannot have.

    Raises
    ------
    UserError
        If it is of the wrong kind, no finite number, beyond what the type can hold, or out of range.
    """
    if is_text(signal.type, value, where):
        return
    number = float(value)
    if not math.isfinite(number):
        raise UserError(f"{where}: {value} is not a finite number")
    check_type(signal.type, number, where)
    if not signal.min <= number <= signal.max:
        raise UserError(
            f"{where}: {shown(number, signal)} is out of range; allowed is {allowed(signal)}"
        )


def show(value: Value, signal: Signal) -> str:
    """Write a value as people read it: a number with its unit, a text in quotes."""
    return repr(value) if isinstance(value, str) else shown(value, signal)


def check_type(kind: str, value: float, where: str) -> None:
    """Refuse a value that a type cannot hold, instead of cutting something off.

    Raises
    ------
    UserError
        If an integer would get a fraction or more than 32 bits, or a boolean anything but 0 and 1.
    """
    if kind == "integer" and not (abs(value) <= _LARGEST and value == math.floor(value)):
        raise UserError(f"{where}: {value:g} is not a whole number from {-_LARGEST} to {_LARGEST}")
    if kind == "boolean" and value not in (0.0, 1.0):
        raise UserError(f"{where}: {value:g} is neither true (1) nor false (0)")


def read_quantity(text: str) -> tuple[float, str] | None:
    """Split ``610 mohm`` or ``6.3[N/mm]`` into number and unit, empty if there is none; None if it is no such text."""
    match = _QUANTITY.match(text)
    if match is None:
        return None
    return float(match["number"]), match["unit"].strip().removeprefix("[").removesuffix("]").strip()


def read_amount(given: str, unit: str, where: str) -> float:
    """Read a number in a unit, or one with a unit of its own, which is converted.

    Parameters
    ----------
    given : str
        Like ``30``, ``30s``, ``0.5 min`` or ``10[ms]``.
    unit : str
        Unit of the result, and of a plain number.
    where : str
        What the message begins with.

    Returns
    -------
    float

    Raises
    ------
    UserError
        For no number, or a unit of another quantity.
    """
    quantity = read_quantity(given)
    if quantity is None:
        raise UserError(f"{where}: {given!r} is not a number with an optional unit")
    value, own = quantity
    return _converted(value, own, unit, where) if own else value


def _converted(value: float, unit: str, to: str, where: str) -> float:
    try:
        units.parse(unit)
    except UserError as error:
        raise UserError(f"{where}: {error}") from error
    return float(units.convert(value, unit, to, where))


def read_setting(given: str, signal: Signal, where: str) -> Value:
    """Read a value that a user gives to a variable: a number, in the variable's unit or with one of its own; a text.

    Parameters
    ----------
    given : str
        Like ``0.61``, ``610mohm`` or ``6.3[N/mm]``; ``true`` and ``false`` too for a boolean; for a string anything.
    signal : Signal
    where : str
        What the message begins with.

    Returns
    -------
    float or str
        In the variable's unit.

    Raises
    ------
    UserError
        For no number, a wrong unit, a value that the type cannot hold or that is out of range.
    """
    if signal.type == "string":
        return given
    if signal.type == "boolean" and given.strip().lower() in _WORDS:
        return _WORDS[given.strip().lower()]
    quantity = read_quantity(given)
    if quantity is None:
        words = " (nor true or false)" if signal.type == "boolean" else ""
        raise UserError(f"{where}: {given!r} is not a number with an optional unit{words}")
    value, unit = quantity
    if unit and signal.type != "real":
        raise UserError(
            f"{where}: {signal.name} is {signal.type} and has no unit; leave out {unit!r}"
        )
    if unit:
        value = _converted(value, unit, signal.unit, where)
        for bound in (
            signal.min,
            signal.max,
        ):  # converting 10 uH must not miss 1e-5 H by its rounding
            value = bound if math.isclose(value, bound, rel_tol=1e-12) else value
    check_value(signal, value, where)
    return value
