"""Values and tables of a calibration file: their types, and the error that refuses one.

The description of a type names the allowed values, and every refusal ends with it.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    InstanceOf,
    ValidationError,
)

from fmus.kit.errors import UserError, suggestion

_LONGEST_VALUE = 60  # characters of a value in a message
_TWO_NUMBERS = "[low, high] of two finite numbers is wanted, the lower one first"


def _check_not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("must not be zero")
    return value


def _check_rising(bounds: tuple[float, float]) -> tuple[float, float]:
    if not bounds[0] < bounds[1]:
        raise ValueError(_TWO_NUMBERS)
    return bounds


def _check_one_group(pattern: re.Pattern[str]) -> re.Pattern[str]:
    if pattern.groups != 1:
        raise ValueError("one group in parentheses is wanted, which finds the number")
    return pattern


Number = Annotated[
    float, Field(strict=True, allow_inf_nan=False, description="a finite number is wanted")
]
Positive = Annotated[Number, Field(gt=0.0, description="a finite number above 0 is wanted")]
NotNegative = Annotated[Number, Field(ge=0.0, description="a number of at least 0 is wanted")]
NotZero = Annotated[Number, AfterValidator(_check_not_zero)]
Sign = Annotated[
    int,
    Field(strict=True, ge=-1, le=1, description="1 or -1 is wanted"),
    AfterValidator(_check_not_zero),
]
Timeout = Annotated[
    Positive,
    Field(
        le=5.0,
        description="a finite number above 0 and at most 5 s is wanted, as the rig waits that long",
    ),
]
Text = Annotated[str, Field(strict=True, pattern=r"\S", description="a text is wanted")]
Texts = Annotated[
    tuple[Annotated[str, Field(strict=True)], ...], Field(description="a list of texts is wanted")
]
Ending = Annotated[str, Field(strict=True, min_length=1, description="a text is wanted")]
Pattern = Annotated[re.Pattern[str], Field(description="a valid regular expression is wanted")]
NumberPattern = Annotated[Pattern, AfterValidator(_check_one_group)]
Baudrate = Annotated[
    int | None, Field(strict=True, gt=0, description="a whole number above 0 is wanted")
]
Framing = Annotated[
    str,
    Field(
        strict=True,
        pattern="^[5-8][NEO][12]$",
        description="data bits, parity (N, E or O) and stop bits are wanted, such as 8N1",
    ),
]
Interval = Annotated[
    tuple[Number, Number], AfterValidator(_check_rising), Field(description=_TWO_NUMBERS)
]
Date = Annotated[
    InstanceOf[datetime.date], Field(description="a date is wanted, such as 2007-05-01")
]
TableByName = dict[str, dict[str, Any]]


class TomlTable(BaseModel):
    """One table of a calibration file, in which only known keys are allowed."""

    model_config = ConfigDict(extra="forbid", frozen=True)


AnyTable = TypeVar("AnyTable", bound=TomlTable)


def checked(kind: type[AnyTable], values: Mapping[str, Any], where: str) -> AnyTable:
    """Check the values of a table.

    Parameters
    ----------
    kind : type
    values : Mapping of str to object
        Values of the table as TOML has them.
    where : str
        File and table, for the message, with the character that is between table and key.

    Returns
    -------
    TomlTable

    Raises
    ------
    UserError
        About the first key that is unknown, missing or wrong.
    """
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        if not problem["loc"]:
            raise UserError(f"{where[:-1]}: a table is wanted") from error
        key = str(problem["loc"][0])
        if problem["type"] == "extra_forbidden":
            allowed = f"there is no such key{suggestion(key, list(kind.model_fields))}"
        elif problem["type"] == "value_error":
            allowed = str(problem["ctx"]["error"])
            if isinstance(problem["ctx"]["error"], UserError):  # of a table within this one
                raise UserError(f"{where}{allowed}") from error
        else:
            allowed = kind.model_fields[key].description or problem["msg"]
        raise value_error(where, key, values.get(key), allowed) from error


def value_error(where: str, key: str, value: Any, allowed: str) -> UserError:
    """Return the error for the value of a key; a value of None is missing in the file."""
    if value is None:
        return UserError(f"{where}{key} is missing: {allowed}")
    text = repr(value) if isinstance(value, str) else str(value)
    return UserError(f"{where}{key} = {text:.{_LONGEST_VALUE}}: {allowed}")
