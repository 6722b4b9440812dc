"""Signals: the variables of an FMU with types, units and ranges."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fmus.kit import UserError
from fmus.kit.declare import Declaration, DiscreteDeclaration, OutputDeclaration, StateDeclaration

# value of a variable: a number in the FMU's unit (0 or 1 for a boolean), or a text
Value = float | str

TRUTHS = {"true": 1.0, "false": 0.0}

_OF_DIFFERENCES = "delta_"  # of pint, before a unit of differences of temperatures

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
    declares_unit : bool
        Whether the FMU declares a unit.
    is_relative : bool
        Whether values are differences, such as of temperatures (``relativeQuantity`` of FMI).
    items : dict of str to float
        Values of an enumeration, which is an integer, by name.
    is_tunable : bool
        Whether it is a parameter, but no text, that may be moved in a run.
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
    declares_unit: bool = True
    is_relative: bool = False
    items: Mapping[str, float] = field(default_factory=dict)
    is_tunable: bool = False

    @property
    def unit_of_records(self) -> str:
        """Unit to which columns and settings are converted: none if the FMU declares none.

        A temperature in degC that is a difference is one in K.
        """
        if not self.declares_unit:
            return ""
        return "delta_degC" if self.is_relative and self.unit == "K" else self.unit

    @property
    def unit_in_files(self) -> str | None:
        """Unit in a header; None for a text, which has none."""
        return None if self.type == "string" else self.unit

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
    declared = variable.declaredType
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
    stated = getattr(variable, "unit", None)
    unit = stated or "1"
    display = getattr(variable, "displayUnit", None) or unit
    low = _number(variable, "min", _attribute(variable, "min"), -math.inf)
    high = _number(variable, "max", _attribute(variable, "max"), math.inf)
    start = _number(variable, "start", variable.start, 0.0)
    return Signal(
        variable.name,
        kind,
        unit,
        display,
        start,
        low,
        high,
        doc,
        declares_start=bool(variable.start),
        declares_unit=bool(stated),
        is_relative=bool(_attribute(variable, "relativeQuantity"))
        or display.startswith(_OF_DIFFERENCES),
        items={item.name: float(item.value) for item in getattr(declared, "items", ())},
        is_tunable=variable.causality == "parameter" and variable.variability == "tunable",
    )


def _attribute(variable: Any, name: str) -> Any:
    """Return an attribute of a scalar variable, or that of its declared type."""
    own = getattr(variable, name, None)
    return getattr(variable.declaredType, name, None) if own is None else own


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
    display = variable.display or variable.unit
    return Signal(
        name=variable.name,
        type=variable.type,
        unit=variable.unit,
        display=display,
        start=0.0 if is_string else float(start),
        min=variable.min,
        max=variable.max,
        doc=variable.doc,
        text=str(start) if is_string else "",
        declares_start=not isinstance(variable, _CALCULATED),
        declares_unit=variable.type == "real",
        is_relative=display.startswith(_OF_DIFFERENCES),
        is_tunable=bool(getattr(variable, "tunable", False)),
    )


def type_of(variable: Any) -> str:
    """Return the type of a scalar variable of fmpy: real, integer, boolean or string.

    An enumeration is an integer.
    """
    return "integer" if variable.type == "Enumeration" else str(variable.type).lower()
