"""Units: from the unit a file states to the unit a model declares."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.records.record import refuse

if TYPE_CHECKING:
    import pint

_DIMENSIONLESS = frozenset({"", "1", "-", "–"})


@cache
def registry() -> "pint.UnitRegistry[Any]":
    """Give the one unit registry of the process (building it takes a moment, so it is built on first use).

    Returns
    -------
    pint.UnitRegistry
        Shared; not to be changed.
    """
    import pint

    return pint.UnitRegistry()


def parse_unit(text: str) -> Any:
    """Understand a unit.

    Parameters
    ----------
    text : str
        For example ``"mA"``, ``"degC"``, ``"1"``.

    Returns
    -------
    pint.Unit
        The unit.

    Raises
    ------
    UserError
        If the text is no unit.
    """
    text = text.strip()
    try:
        return registry().Unit("" if text in _DIMENSIONLESS else text)
    except (
        Exception
    ) as error:  # pint raises AssertionError, ValueError, tokenize errors ... for texts that are no units
        raise UserError(f"unit '{text}' is not known (allowed: for example A, mA, V, N, mm, ms, degC, 1)") from error


def convert(
    path: Path, column: str, values: NDArray[np.float64], found: str, expected: str, signal: str
) -> NDArray[np.float64]:
    """Convert a column's values from the file's unit to the model's.

    Parameters
    ----------
    path : Path
        The file, for the message.
    column : str
        Column name in the file, for the message.
    values : ndarray, shape (n,)
        In the unit `found`.
    found, expected : str
        Unit in the file, and unit of the result.
    signal : str
        The model's name of the signal, for the hint.

    Returns
    -------
    ndarray, shape (n,)
        In the unit `expected`.

    Raises
    ------
    UserError
        If the unit is not known or of another dimension.
    """
    try:
        source = parse_unit(found)
    except UserError as error:
        raise refuse(
            path, f"column '{column}': {error}; to state it yourself: --map '{column}={signal}[unit]'"
        ) from error
    target = parse_unit(expected)
    # pint counts 1 Hz as 1 rad/s; a factor of 2π must not be lost in that
    frequency_as_speed = ("hertz" in str(source)) != ("hertz" in str(target)) and "radian" in f"{source} {target}"
    if source.dimensionality != target.dimensionality or frequency_as_speed:
        raise refuse(
            path,
            f"column '{column}' is in {found}, but {signal} is in {expected}, "
            f"and {found} cannot be converted to {expected}; "
            f"to read the numbers as another unit: --map '{column}={signal}[{expected}]'",
        )
    if source == target:
        return values
    return np.asarray(registry().Quantity(values, source).to(target).magnitude, dtype=float)
