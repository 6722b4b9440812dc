"""Writing of records as CSV: as a whole, or row by row during a measurement."""

import csv
import io
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from time import monotonic

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import UserError, files
from orchestration.reporting import BackgroundWriter

_EVERY = 2.0  # s between two writes of a journal


def header(units: Mapping[str, str | None]) -> list[str]:
    """Return the header cells ``name [unit]`` of time and signals.

    Parameters
    ----------
    units : mapping of str to str
        Unit by signal; None for texts.

    Returns
    -------
    list of str

    Raises
    ------
    UserError
        If a name or a unit cannot stand in a header.
    """
    cells = ["time [s]"]
    for name, stated in units.items():
        unit = "1" if stated == "" else stated
        is_split = any(mark in name for mark in "\r\n") or any(mark in "[]" for mark in unit or "")
        if not name or name != name.strip() or is_split:
            raise UserError(
                f"signal {name!r} [{unit}]: line ends, outer spaces and brackets in units cannot"
                " stand in a CSV header; write .nc or .parquet"
            )
        cells.append(name if unit is None else f"{name} [{unit}]")
    return cells


def write_record(
    path: str | Path,
    time: ArrayLike,
    signals: Mapping[str, ArrayLike],
    units: Mapping[str, str | None],
) -> None:
    """Write a record as CSV: a header ``name [unit]``, time in seconds first, a row per sample.

    Numbers have the fewest digits that read back as the same double. NaN becomes an empty cell.

    Parameters
    ----------
    path : str or Path
        An existing file is replaced, either whole or not at all.
    time : array_like, shape (n,)
        Seconds, finite and strictly increasing.
    signals : mapping of str to array_like, shape (n,)
        Values by signal.
    units : mapping of str to str
        Unit by signal; None for texts.

    Raises
    ------
    ValueError
        If shapes differ, or time is not finite and strictly increasing.
    UserError
        If a name or a unit cannot stand in a header, or the file cannot be written.
    """
    clock = np.asarray(time, dtype=float)
    if clock.ndim != 1 or not np.all(np.isfinite(clock)) or not np.all(np.diff(clock) > 0):
        raise ValueError("time must be one-dimensional, finite and strictly increasing")
    columns = [clock]
    for name, values in signals.items():
        if name not in units:
            raise ValueError(f"signal '{name}' has no unit")
        array = np.asarray(values, dtype=str if units[name] is None else float)
        if array.shape != clock.shape:
            raise ValueError(f"signal '{name}' has shape {array.shape}, time has {clock.shape}")
        columns.append(array)
    lists = [column.tolist() for column in columns]
    rows = [header({name: units[name] for name in signals})]
    rows += [[*map(_cell, row)] for row in zip(*lists, strict=True)]
    files.write(Path(path), _text(rows).encode())


def _text(rows: Iterable[Iterable[str]]) -> str:
    """Return rows of cells as CSV."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _cell(value: float | str) -> str:
    """Return a text, or the shortest one that reads back as the same double; none for NaN."""
    if isinstance(value, str):
        return value
    return "" if math.isnan(value) else repr(value)


class Journal:
    """A record that is written as CSV row by row, so that it survives the end of the process.

    New rows go to the disk every two seconds.

    Parameters
    ----------
    path : Path
        A file that does not exist yet.
    units : Mapping of str to str
        Unit by signal, in the order of the values.

    Raises
    ------
    UserError
        If the file exists, or cannot be made.
    """

    def __init__(self, path: Path, units: Mapping[str, str]):
        self.path = path
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError:
            raise UserError(
                f"{path} exists: the record of a run that was killed; read it (ppy compare accepts"
                " it), then remove it"
            ) from None
        except OSError as error:
            raise UserError(f"cannot write {path}: {error.strerror}") from error
        self._writer = BackgroundWriter(self._write)
        self._rows: list[list[str]] = [header(units)]
        self._since = monotonic()
        self._is_empty = True

    @property
    def error(self) -> str:
        """Message of the error that stopped the writing; empty without one."""
        error = self._writer.error
        return "" if error is None else f"cannot write {self.path}: {error.strerror}"

    def add(self, time: float, values: Sequence[float]) -> None:
        """Add a row of the time in s and a value of each signal."""
        self._is_empty = False
        self._rows.append([*map(_cell, (time, *values))])
        if monotonic() - self._since > _EVERY:
            self._pass_on()

    def close(self) -> None:
        """Write the last rows and close the file; a file without rows is removed."""
        self._pass_on()
        if self._writer.close():
            self._file.close()
        if self._is_empty:
            self.path.unlink(missing_ok=True)

    def _pass_on(self) -> None:
        if self._rows:
            self._writer.put(_text(self._rows).encode())
        self._rows = []
        self._since = monotonic()

    def _write(self, content: bytes) -> None:
        rest = memoryview(content)
        while rest:
            rest = rest[self._file.write(rest) or 0 :]
        os.fsync(self._file.fileno())
