"""Signals: the variables of an FMU with types, units and ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from fmus.kit import UserError, units
from fmus.kit.declare import Declaration, DiscreteDeclaration, OutputDeclaration, StateDeclaration

# value of a variable: a number in the FMU's unit (0 or 1 for a boolean), or a text
Value = float | str

TRUTHS = {"true": 1.0, "false": 0.0}

# variables that are computed at the start, so that the FMU declares no start value
_CALCULATED = (OutputDeclaration, StateDeclaration, DiscreteDeclaration)


@dataclass
class Signal:
    """A variable of an FMU with its type, unit and range.

    Attributes
    ----------
    name : str
    type : {"real", "integer", "boolean", "string"}
    unit : str
        Unit of the FMU; ``"1"`` if it declares none.
    display : str
        Unit in which values are displayed.
    start : float
        Start value, for inputs and parameters.
    min, max : float
        Allowed range.
    doc : str
        Description.
    text : str
        Start value of a string, for which `start` is 0.
    declares_start : bool
        Whether the FMU declares a start value; `start` is 0 without one.
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
    declares_start: bool = True

    @property
    def default(self) -> Value:
        """The start value: a number, or a text for a string."""
        return self.text if self.type == "string" else self.start


def read_signal(variable: Any) -> Signal:
    """Return the signal of a scalar variable of fmpy, completed from its type definition.

    Raises
    ------
    UserError
        If its start value or an end of its range is no number.
    """
    kind = type_of(variable)
    doc = variable.description or ""
    if kind == "string":
        return Signal(
            name=variable.name,
            type=kind,
            unit="1",
            display="1",
            start=0.0,
            min=-math.inf,
            max=math.inf,
            doc=doc,
            text=variable.start or "",
        )
    unit = _attribute(variable, "unit") or "1"
    display = _attribute(variable, "displayUnit") or unit
    low = _number(variable, "min", _attribute(variable, "min"), -math.inf)
    high = _number(variable, "max", _attribute(variable, "max"), math.inf)
    start = _number(variable, "start", variable.start, 0.0)
    return Signal(
        variable.name,
        kind,
        units.to_familiar(unit),
        units.to_familiar(display),
        start,
        low,
        high,
        doc,
        declares_start=bool(variable.start),
    )


def _attribute(variable: Any, name: str) -> str | None:
    """Return an attribute of a scalar variable, or that of its declared type."""
    return getattr(variable, name, None) or getattr(variable.declaredType, name, None)


def _number(variable: Any, name: str, text: str | None, default: float) -> float:
    """Return the number in an attribute, the default if it is empty; UserError if it is invalid."""
    if not text:
        return default
    try:
        return TRUTHS[text] if text in TRUTHS else float(text)
    except ValueError:
        raise UserError(
            f"modelDescription.xml: {variable.name}: {name} {text[:40]!r} is no number"
        ) from None


def declared_signal(variable: Declaration) -> Signal:
    """Return the signal of a variable that a component declares, as its FMU describes it."""
    start: Any = getattr(variable, "start", 0.0)
    is_string = variable.type == "string"
    return Signal(
        name=variable.name,
        type=variable.type,
        unit=variable.unit,
        display=variable.display or variable.unit,
        start=0.0 if is_string else float(start),
        min=variable.min,
        max=variable.max,
        doc=variable.doc,
        text=str(start) if is_string else "",
        declares_start=not isinstance(variable, _CALCULATED),
    )


def type_of(variable: Any) -> str:
    """Return the type of a scalar variable of fmpy: real, integer, boolean or string.

    An enumeration is an integer.
    """
    return "integer" if variable.type == "Enumeration" else str(variable.type).lower()
