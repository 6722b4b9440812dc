"""Values in an experiment's file: numbers, texts with a unit, paths, and tables by their keys."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    PlainSerializer,
    PlainValidator,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from fmus.kit import units
from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.signal import read_quantity

Checked = TypeVar("Checked", bound=BaseModel)


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


def read_toml(path: Path) -> dict[str, Any]:
    """Read a file as TOML; UserError with the line that is none."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not a text in UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{path}: {str(error)[0].lower()}{str(error)[1:]}") from error
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error


def checked(
    table: type[Checked], given: Mapping[str, Any], where: str, folder: str | None = None
) -> Checked:
    """Check a file against the keys of its tables.

    It is `parse` for files that hold more than an experiment.
    """
    try:
        return table.model_validate(given, context={"folder": folder})
    except ValidationError as error:
        problems = error.errors(include_url=False)
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise UserError(f"{where}: {_line(problems[0])}{more}") from error


def _line(problem: Any) -> str:
    """Put a problem that pydantic reports into a line: key, value, what is allowed."""
    place = list(problem["loc"])
    if place[:1] == ["inputs"]:
        del place[2:3]  # the kind, by which pydantic distinguishes the tables
    kind, given, context = problem["type"], problem["input"], problem.get("ctx", {})
    if kind == "missing":
        return f"{_key(place)} is missing"
    if kind == "union_tag_not_found":
        return f"{_key(place)}.kind is missing"
    if kind == "union_tag_invalid":
        kinds = [tag.strip("' ") for tag in context["expected_tags"].split(",")]
        return (
            f"{_key(place)}.kind = {context['tag']!r}: unknown{suggestion(context['tag'], kinds)}"
        )
    value = "" if isinstance(given, dict) else f" = {given!r}"
    if kind == "model_type":
        return f"{_key(place)}{value}: should be a table"
    if kind == "value_error":
        return f"{_key(place)}{value}: {context['error']}".removeprefix(": ")
    allowed = (
        problem["msg"]
        .removeprefix("Input ")
        .replace("valid dictionary", "table")
        .replace(" after validation", "")
    )
    return f"{_key(place)}{value}: {allowed[0].lower()}{allowed[1:]}"


def _key(place: list[Any]) -> str:
    text = ""
    for part in place:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text
