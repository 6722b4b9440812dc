"""A journal: a record that is written while it is made, and survives a process that is killed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic

from fmus.kit import UserError
from orchestration.records.writing import header
from orchestration.reporting import BackgroundWriter

_EVERY = 2.0  # s between two pieces


class Journal:
    """A record as CSV, a row at a time; every two seconds what has come together goes to the disk.

    Parameters
    ----------
    path : Path
        A file that is not there yet.
    units : Mapping of str to str
        Of the signals, in the order of the values.

    Raises
    ------
    UserError
        If the file is there, or cannot be made.
    """

    def __init__(self, path: Path, units: Mapping[str, str]):
        self.path = path
        try:
            self._file = path.open("xb", buffering=0)
        except FileExistsError:
            raise UserError(
                f"{path} is there: what a run recorded that was killed; read it (ppy compare takes"
                " it), then remove it"
            ) from None
        except OSError as error:
            raise UserError(f"cannot write {path}: {error.strerror}") from error
        self._writer = BackgroundWriter(self._write)
        self._rows = [",".join(f'"{cell}"' if "," in cell else cell for cell in header(units))]
        self._since, self._is_empty = monotonic(), True

    @property
    def error(self) -> str:
        """Why nothing is written any more; empty if all is well."""
        error = self._writer.error
        return "" if error is None else f"cannot write {self.path}: {error.strerror}"

    def add(self, time: float, values: Sequence[float]) -> None:
        """Add a row: time in s, and a value of each signal."""
        self._is_empty = False
        self._rows.append(
            ",".join(["" if value != value else repr(value) for value in (time, *values)])
        )
        if monotonic() - self._since > _EVERY:
            self._pass_on()

    def close(self) -> None:
        """Write what there is; the file stays, unless there was no row."""
        self._pass_on()
        if self._writer.close():
            self._file.close()
        if self._is_empty:
            self.path.unlink(missing_ok=True)

    def _pass_on(self) -> None:
        if self._rows:
            self._writer.put(("\n".join(self._rows) + "\n").encode())
        self._rows, self._since = [], monotonic()

    def _write(self, content: bytes) -> None:
        rest = memoryview(content)
        while rest:
            rest = rest[self._file.write(rest) or 0 :]
        os.fsync(self._file.fileno())
