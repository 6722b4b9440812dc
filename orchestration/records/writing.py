"""Writing a record in the same CSV form that is read."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import files


def header(units: Mapping[str, str]) -> list[str]:
    """Cells ``name [unit]`` of time and of signals.

    Parameters
    ----------
    units : mapping of str to str
        By signal.

    Raises
    ------
    ValueError
        If a name or a unit cannot stand in a header.
    """
    cells = ["time [s]"]
    for name, given in units.items():
        unit = given or "1"
        if not name or name != name.strip() or any(mark in name + unit for mark in '[]\r\n"'):
            raise ValueError(
                f"signal '{name}' [{unit}]: brackets, quotes, line ends and outer spaces cannot be"
                " written"
            )
        cells.append(f"{name} [{unit}]")
    return cells


def write_record(
    path: str | Path, time: ArrayLike, signals: Mapping[str, ArrayLike], units: Mapping[str, str]
) -> None:
    """Write a record as CSV: a header ``name [unit]``, time in seconds first, one row per sample.

    Every number is written with the fewest digits that read back as the same double. NaN becomes an
    empty cell.

    Parameters
    ----------
    path : str or Path
        The file; one that exists is replaced, whole or not at all.
    time : array_like, shape (n,)
        Seconds, finite and strictly increasing.
    signals : mapping of str to array_like, shape (n,)
        Values.
    units : mapping of str to str
        Unit of every signal.

    Raises
    ------
    ValueError
        If shapes differ, time is not finite and strictly increasing, or a name or a unit cannot
        stand in a header.
    UserError
        If the file cannot be written.
    """
    clock = np.asarray(time, dtype=float)
    if clock.ndim != 1 or not np.all(np.isfinite(clock)) or not np.all(np.diff(clock) > 0):
        raise ValueError("time must be one-dimensional, finite and strictly increasing")
    columns = [clock]
    for name, values in signals.items():
        array = np.asarray(values, dtype=float)
        if array.shape != clock.shape:
            raise ValueError(f"signal '{name}' has shape {array.shape}, time has {clock.shape}")
        if name not in units:
            raise ValueError(f"signal '{name}' has no unit")
        columns.append(array)
    lists = [column.tolist() for column in columns]
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header({name: units[name] for name in signals}))
    writer.writerows(
        ["" if value != value else repr(value) for value in row] for row in zip(*lists, strict=True)
    )
    files.write(Path(path), text.getvalue().encode())
