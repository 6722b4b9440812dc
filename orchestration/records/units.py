"""Units: from the unit a file states to the unit a model declares."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fmus.kit import UserError, units
from orchestration.records.record import refuse


def convert(
    path: Path, column: str, values: NDArray[np.float64], unit: str, expected: str, signal: str
) -> NDArray[np.float64]:
    """Convert a column's values from the file's unit to the model's.

    Parameters
    ----------
    path : Path
        The file, for the message.
    column : str
        Column name in the file, for the message.
    values : ndarray, shape (n,)
        In `unit`.
    unit, expected : str
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
        source = units.parse(unit)
    except UserError as error:
        raise refuse(
            path,
            f"column '{column}': {error}; to state it yourself: --map '{column}={signal}[unit]'",
        ) from error
    if not units.convertible(source, units.parse(expected)):
        raise refuse(
            path,
            f"column '{column}' is in {unit}, but {signal} is in {expected}, "
            f"and {unit} cannot be converted to {expected}; "
            f"to read the numbers as another unit: --map '{column}={signal}[{expected}]'",
        )
    return np.asarray(units.convert(values, unit, expected), dtype=float)
