"""A variable of an FMU as a user meets it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from fmus.kit.errors import UserError

_LARGEST = 2**31 - 1  # integers of FMI 2.0 have 32 bits


@dataclass
class Signal:
    """A variable; `fmus.kit.documentation.shown` and `allowed` write its values and its range.

    Attributes
    ----------
    name : str
    type : {"real", "integer", "boolean"}
    unit : str
        The FMU's; ``"1"`` where it declares none.
    display : str
        Unit that people prefer to read.
    start : float
        Start value, for inputs and parameters.
    min, max : float
        Allowed range.
    """

    name: str
    type: str
    unit: str
    display: str
    start: float
    min: float
    max: float


def read_signal(variable: Any) -> Signal:
    """Gather what fmpy has read of a scalar variable; type definitions fill what the variable leaves out."""

    def attribute(name: str) -> str | None:
        return getattr(variable, name, None) or getattr(variable.declaredType, name, None)

    def number(text: str | None, default: float) -> float:
        if not text:
            return default
        return float(text == "true") if text in ("true", "false") else float(text)

    unit = attribute("unit") or "1"
    low, high = number(attribute("min"), -math.inf), number(attribute("max"), math.inf)
    start = number(variable.start, 0.0)
    return Signal(variable.name, type_of(variable), unit, attribute("displayUnit") or unit, start, low, high)


def type_of(variable: Any) -> str:
    """Type of fmpy's scalar variable: real, integer (enumerations too), boolean or string."""
    return "integer" if variable.type == "Enumeration" else str(variable.type).lower()


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
