"""Values in an experiment's file: numbers, texts with a unit, paths, and tables by their keys."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    PlainSerializer,
    PlainValidator,
    ValidationInfo,
    model_validator,
)

from fmus.kit import units
from fmus.kit.errors import suggestion
from orchestration.fmu.signal import read_quantity


class ValueTable(BaseModel):
    """A table of the file; an unknown key is refused with the nearest one."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, given: Any) -> Any:
        for key in given if isinstance(given, dict) else ():
            if key not in cls.model_fields:
                raise ValueError(f"unknown key {key!r}{suggestion(key, cls.model_fields)}")
        return given


class QuantityValue(NamedTuple):
    """A number and its unit, empty for that of the variable it is for."""

    value: float
    unit: str = ""

    def to(self, unit: str, what: str = "value") -> float:
        """Return the number in a unit; UserError if the two measure different things."""
        return float(units.convert(self.value, self.unit or unit, unit, what))


def _read(given: Any) -> QuantityValue:
    """Return a number, or a text with a number and a unit, as a quantity; ValueError if neither."""
    if isinstance(given, str):
        quantity = QuantityValue(*(read_quantity(given) or (math.nan,)))
    elif isinstance(given, int | float) and not isinstance(given, bool):
        quantity = QuantityValue(float(given))
    else:
        quantity = QuantityValue(math.nan)
    if not math.isfinite(quantity.value):
        raise ValueError(
            "a finite number is needed, or a text with a number and a unit such as '500 mA'"
        )
    if quantity.unit:
        units.parse(quantity.unit)
    return quantity


def _written(quantity: QuantityValue) -> float | str:
    return f"{quantity.value!r} {quantity.unit}" if quantity.unit else quantity.value


def _in(unit: str, positive: bool = True) -> BeforeValidator:
    """Return what reads a value into a unit, for pydantic."""

    def read(given: Any) -> float:
        value = _read(given).to(unit)
        if positive and not value > 0.0:
            raise ValueError("must be above 0")
        return value

    return BeforeValidator(read)


def _reachable(given: Any, info: ValidationInfo) -> Any:
    """Resolve a file's path beside the experiment's own file, else from the working folder."""
    folder = (info.context or {}).get("folder")
    if not isinstance(given, str) or not Path(given).suffix or folder is None:
        return given  # no path but a name, or not for this validator to judge
    beside = Path(folder) / given
    return str((beside if beside.is_file() else Path(given)).absolute())


Amount = Annotated[QuantityValue, PlainValidator(_read), PlainSerializer(_written)]
Seconds = Annotated[float, _in("s", positive=False)]
Span = Annotated[float, _in("s")]
Hertz = Annotated[float, _in("Hz")]
File = Annotated[str, BeforeValidator(_reachable)]
