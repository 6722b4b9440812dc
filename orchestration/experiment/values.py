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

from fmus.kit import files, units
from fmus.kit.errors import UserError, suggestion
from orchestration.fmu.signal import read_quantity

Checked = TypeVar("Checked", bound=BaseModel)


class ValueTable(BaseModel):
    """Base of all tables of a file; raises an error for an unknown key, with the nearest one."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, given: Any) -> Any:
        for key in given if isinstance(given, dict) else ():
            if key not in cls.model_fields:
                raise ValueError(f"unknown key {key!r}{suggestion(key, cls.model_fields)}")
        return given


class QuantityValue(NamedTuple):
    """A number and its unit; an empty unit is that of the variable."""

    value: float
    unit: str = ""

    def to(self, unit: str, what: str = "value") -> float:
        """Return the number in a unit; UserError if the units have different dimensions."""
        return float(units.convert(self.value, self.unit or unit, unit, what))


def _read_quantity(given: Any) -> QuantityValue:
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


def _serialise(quantity: QuantityValue) -> float | str:
    return f"{quantity.value!r} {quantity.unit}" if quantity.unit else quantity.value


def _converted_to(unit: str, positive: bool = True) -> BeforeValidator:
    """Return the validator of pydantic that reads a value and converts it to a unit."""

    def read(given: Any) -> float:
        value = _read_quantity(given).to(unit)
        if positive and not value > 0.0:
            raise ValueError("must be above 0")
        return value

    return BeforeValidator(read)


def _resolve_path(given: Any, info: ValidationInfo) -> Any:
    """Resolve the path of a file in the experiment's folder, or else in the working folder."""
    folder = (info.context or {}).get("folder")
    if not isinstance(given, str) or not Path(given).suffix or folder is None:
        return given  # a name, or a type that pydantic refuses next
    neighbour = Path(folder) / given
    return str((neighbour if neighbour.is_file() else Path(given)).absolute())


Amount = Annotated[QuantityValue, PlainValidator(_read_quantity), PlainSerializer(_serialise)]
Seconds = Annotated[float, _converted_to("s", positive=False)]
Span = Annotated[float, _converted_to("s")]
Hertz = Annotated[float, _converted_to("Hz")]
File = Annotated[str, BeforeValidator(_resolve_path)]


def read_toml(path: Path) -> dict[str, Any]:
    """Read a file as TOML; UserError with the first wrong line."""
    try:
        return tomllib.loads(files.contents(path).decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not a text in UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise UserError(f"{path}: {str(error)[0].lower()}{str(error)[1:]}") from error
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error


def checked(
    table: type[Checked], given: Mapping[str, Any], where: str, folder: str | None = None
) -> Checked:
    """Return a file's tables as a model of pydantic; UserError with the first error.

    Relative paths are resolved in `folder`. `parse` is the same for an experiment.
    """
    try:
        return table.model_validate(given, context={"folder": folder})
    except ValidationError as error:
        problems = error.errors(include_url=False)
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise UserError(f"{where}: {_describe_problem(problems[0])}{more}") from error


def _describe_problem(problem: Any) -> str:
    """Return an error of pydantic as a line: the key, the value, the allowed values."""
    path = list(problem["loc"])
    if path[:1] == ["inputs"]:
        del path[2:3]  # the kind, by which pydantic distinguishes the tables
    key = _dotted_key(path)
    kind, given, context = problem["type"], problem["input"], problem.get("ctx", {})
    if kind == "missing":
        return f"{key} is missing"
    if kind == "union_tag_not_found":
        return f"{key}.kind is missing"
    if kind == "union_tag_invalid":
        kinds = [tag.strip("' ") for tag in context["expected_tags"].split(",")]
        return f"{key}.kind = {context['tag']!r}: unknown{suggestion(context['tag'], kinds)}"
    value = "" if isinstance(given, dict) else f" = {given!r}"
    if kind == "model_type":
        return f"{key}{value}: should be a table"
    if kind == "value_error":
        return f"{key}{value}: {context['error']}".removeprefix(": ")
    allowed = (
        problem["msg"]
        .removeprefix("Input ")
        .replace("valid dictionary", "table")
        .replace(" after validation", "")
    )
    return f"{key}{value}: {allowed[0].lower()}{allowed[1:]}"


def _dotted_key(path: list[Any]) -> str:
    """Return a key as in TOML, ``inputs.current.levels[1]``, from its names and indices."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".")
