"""Values that users set: reading from text, checks, and display."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from fmus.kit import UserError, units
from fmus.kit.units import format_range, format_value
from orchestration.fmu.signal.signal import TRUTHS, Signal, Value
from orchestration.reporting import option

_QUANTITY = re.compile(r"^\s*(?P<number>[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)\s*(?P<unit>.*)$")


def is_text(kind: str, value: Value, where: str) -> bool:
    """Return whether a value is a text; raise UserError if the type of the variable differs.

    Parameters
    ----------
    kind : {"real", "integer", "boolean", "string"}
    value : float or str
    where : str
        Beginning of the message.

    Raises
    ------
    UserError
        If the value is a number for a string, or a text for another type.
    """
    if isinstance(value, str):
        if kind != "string":
            raise UserError(
                f"{where}: {value!r} is a text; the parameter is {kind} and takes a number"
            )
        return True
    if kind == "string":
        raise UserError(f"{where}: {value!r} is a number; the parameter is a text")
    return False


def numeric(values: Mapping[str, Value]) -> dict[str, float]:
    """Return values as numbers, by name.

    Raises
    ------
    UserError
        If a value is a text.
    """
    for name, value in values.items():
        if isinstance(value, str):
            raise UserError(f"{name} = {value!r} is a text; only numbers are allowed here")
    return {name: float(value) for name, value in values.items()}


def check_value(signal: Signal, value: Value, where: str) -> None:
    """Raise UserError if a variable cannot have a value.

    Parameters
    ----------
    signal : Signal
    value : float or str
    where : str
        Beginning of the message.

    Raises
    ------
    UserError
        If the value is of another type, not finite, out of range, or no item of an enumeration.
    """
    if is_text(signal.type, value, where):
        return
    number = float(value)
    if not math.isfinite(number):
        raise UserError(f"{where}: {value} is not a finite number")
    check_type(signal.type, number, where, signal.max if math.isfinite(signal.max) else 0.0)
    if signal.items and number not in signal.items.values():
        raise UserError(f"{where}: {number:g} is none of {allowed(signal)}")
    if not signal.min <= number <= signal.max:
        raise UserError(
            f"{where}: {format_value(number, signal)} is out of range; allowed is {allowed(signal)}"
        )


def show(value: Value, signal: Signal) -> str:
    """Return a value for display: a number with its unit, an item by name, a text in quotes."""
    if isinstance(value, str):
        return repr(value)
    names = (name for name, number in signal.items.items() if number == value)
    return next(names, None) or format_value(value, signal)


def start_of(signal: Signal) -> str:
    """Return the start value for display; empty if the FMU declares none."""
    return show(signal.default, signal) if signal.declares_start else ""


def allowed(signal: Signal) -> str:
    """Return the values that a variable may have, for display; empty if all numbers are."""
    if signal.type == "string":
        return "any text"
    items = ", ".join(f"{name} ({number:g})" for name, number in signal.items.items())
    return items or format_range(signal)


def check_type(kind: str, value: float, where: str, largest: float = 0.0) -> None:
    """Raise UserError if a number is not of a type, to which it would be truncated.

    Parameters
    ----------
    kind : {"real", "integer", "boolean", "string"}
    value : float
    where : str
        Beginning of the message.
    largest : float
        Largest value of an integer of more than 32 bits.

    Raises
    ------
    UserError
        If an integer has a fraction or too many bits, or a boolean is neither 0 nor 1.
    """
    high = max(largest, 2.0**31 - 1.0)
    if kind == "integer" and not (-high - 1.0 <= value <= high and value == math.floor(value)):
        raise UserError(
            f"{where}: {value:.16g} is not a whole number from {-high - 1.0:.0f} to {high:.0f}"
        )
    if kind == "boolean" and value not in (0.0, 1.0):
        raise UserError(f"{where}: {value:g} is neither true (1) nor false (0)")


def read_quantity(text: str) -> tuple[float, str] | None:
    """Split a text such as ``610 mohm`` or ``6.3[N/mm]`` into number and unit.

    Returns
    -------
    tuple of float and str, or None
        The unit is empty for a number alone; None if the text does not begin with a number.
    """
    match = _QUANTITY.match(text)
    if match is None:
        return None
    unit = match["unit"].strip().removeprefix("[").removesuffix("]").strip()
    return float(match["number"]), unit


def read_amount(given: str, unit: str, where: str, difference: bool = False) -> float:
    """Read a number with an optional unit and convert it.

    Parameters
    ----------
    given : str
        Text such as ``30``, ``30s``, ``0.5 min`` or ``10[ms]``.
    unit : str
        Unit of the result, and of a number without a unit.
    where : str
        Beginning of the message.
    difference : bool
        Whether it is a difference of values, such as a deviation, of which ``1degC`` is 1 K.

    Returns
    -------
    float
        In `unit`.

    Raises
    ------
    UserError
        For a text without a number, or a unit of another quantity.
    """
    quantity = read_quantity(given)
    if quantity is None:
        raise UserError(f"{where}: {given!r} is not a number with an optional unit")
    value, given_unit = quantity
    if not given_unit:
        return value
    if difference:
        units.check(given_unit)
        given_unit, unit = map(units.difference_unit, (given_unit, unit))
    return _convert(value, given_unit, unit, where)


def _convert(value: float, unit: str, to: str, where: str) -> float:
    """Convert a value between units; UserError for an unknown unit or one of another quantity."""
    try:
        units.check(unit)
        if to.startswith("delta_"):
            unit = units.difference_unit(unit)
    except UserError as error:
        raise UserError(f"{where}: {error}") from error
    return float(units.convert(value, unit, to, where))


def read_setting(given: str, signal: Signal, where: str) -> Value:
    """Read a value that a user sets for a variable.

    Parameters
    ----------
    given : str
        A number in the variable's unit or with another unit, such as ``0.61``, ``610mohm`` or
        ``6.3[N/mm]``; for a boolean also ``true`` or ``false``; for an enumeration the name of an
        item; for a string any text.
    signal : Signal
    where : str
        Beginning of the message.

    Returns
    -------
    float or str
        In the variable's unit.

    Raises
    ------
    UserError
        For a text without a number, a wrong unit, or a value that is not of the type or out of
        range.
    """
    if signal.type == "string":
        return given
    word = given.strip()
    words = TRUTHS if signal.type == "boolean" else signal.items
    value = words.get(word.lower() if words is TRUTHS else word)
    if value is None:
        value = _read_number(given, signal, where)
    check_value(signal, value, where)
    return value


def _read_number(given: str, signal: Signal, where: str) -> float:
    """Read a number with an optional unit in the unit of a signal; see `read_setting`."""
    quantity = read_quantity(given)
    if quantity is None and signal.items:
        raise UserError(f"{where}: {given.strip()!r} is none of {allowed(signal)}")
    if quantity is None:
        either = " (nor true or false)" if signal.type == "boolean" else ""
        raise UserError(f"{where}: {given!r} is not a number with an optional unit{either}")
    number, unit = quantity
    if unit and signal.type != "real":
        raise UserError(
            f"{where}: {signal.name} is {signal.type} and has no unit; leave out {unit!r}"
        )
    return _converted(number, unit, signal, where) if unit else number


def _converted(number: float, unit: str, signal: Signal, where: str) -> float:
    """Convert a value to the unit of a signal; UserError if their dimensions differ.

    The rounding error of the conversion must not move 10 uH beyond the bound 1e-5 H.
    """
    if not signal.declares_unit:
        declared = option("units", {signal.name: unit})
        raise UserError(
            f"{where}: the FMU declares no unit of {signal.name}; {declared} declares one"
        )
    value = _convert(number, unit, signal.unit_of_records, where)
    bounds = (signal.min, signal.max)
    return next((b for b in bounds if math.isclose(value, b, rel_tol=1e-12)), value)
