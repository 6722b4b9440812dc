"""A measured record, with a report of repairs and notices."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit import UserError, quoting
from fmus.kit.arrays import Array
from fmus.kit.units import Described, convert
from orchestration.reporting import Displayable, one_line, option

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

_BYTES = re.compile(r"'?<_io\.BytesIO [^>]*>'?")  # the content, as a parser names it
REPAIRING_KINDS = frozenset(
    {
        "partial line",
        "missing time",
        "order",
        "duplicates",
        "filled hole",
        "held",
        "masked",
        "infinite",
        "no value",
        "unit replaced",
    }
)
"""Kinds of `Repair` that changed, dropped or reinterpreted data; all others are notices."""
_LONGEST = 1000  # characters of a message


@dataclass(frozen=True)
class Repair:
    """A repair of a file, or a notice about it.

    Parameters
    ----------
    kind : str
        Short fixed name, for example ``"duplicates"`` or ``"gap"``.
    message : str
        One line for the user.
    rows : tuple of int
        Rows that it concerns: line numbers of a text file, data rows (from 1) of a binary file.
        For a gap, the row after it.
    """

    kind: str
    message: str
    rows: tuple[int, ...] = ()

    @property
    def changed_data(self) -> bool:
        """True if data was changed, dropped or reinterpreted; else the line is a notice."""
        return self.kind in REPAIRING_KINDS


class Repaired:
    """Data with a list of their repairs."""

    repairs: list[Repair]

    def note(self, kind: str, message: str, rows: Iterable[int] = ()) -> None:
        """Add a repair or a notice, see `Repair`."""
        self.repairs.append(Repair(kind, message, tuple(rows)))


@dataclass
class Record(Displayable):
    """A measured record in SI units.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds, strictly increasing.
    signals : dict of str to ndarray, shape (n,)
        Values in the units of the model; NaN where an output has no valid sample.
    units : dict of str to str
        Unit by signal, as the model declares it.
    source : Path
        The file.
    repairs : list of Repair
        Repairs and notices in the order of reading.
    label : str
        Label of the run, if the file has several; else empty.
    scales : dict of str to str
        Scale of the file by signal that is a temperature: degC, degF or K.
    """

    time: Array
    signals: dict[str, Array]
    units: dict[str, str]
    source: Path
    repairs: list[Repair] = field(default_factory=list)
    label: str = ""
    scales: dict[str, str] = field(default_factory=dict)

    def part(self, rows: Any) -> Record:
        """Return the samples of some rows, given as NumPy takes them."""
        signals = {name: values[rows] for name, values in self.signals.items()}
        return replace(self, time=self.time[rows], signals=signals)

    def display_unit(self, name: str, signal: Described) -> str:
        """Return the unit in which a signal is displayed: of a temperature that of the file."""
        return self.scales.get(name) or signal.display or signal.unit

    def __str__(self) -> str:
        signals = ", ".join(f"{name} [{self.units[name]}]" for name in self.signals)
        return "\n".join([f"{self._extent}: {signals}", *self._repair_lines])

    def __repr__(self) -> str:
        signals = ", ".join(self.signals)
        return one_line(f"Record {self.source.name}: {self.time.size} samples of {signals}")

    @property
    def _extent(self) -> str:
        """File, number of samples and duration, in a line."""
        seconds = float(self.time[-1] - self.time[0]) if self.time.size else 0.0
        run = f", run {self.label}" if self.label else ""
        return f"{self.source.name}{run}: {self.time.size} samples over {seconds:.6g} s"

    @property
    def _repair_lines(self) -> list[str]:
        return [f"{'repaired' if r.changed_data else 'noted'}: {r.message}" for r in self.repairs]

    def overview(self) -> Iterator[RenderableType]:
        """Yield the display in a notebook: the extent, a table of the signals, and the repairs."""
        from orchestration.reporting import plain_table

        columns = ("smallest", "largest", "missing")
        table = plain_table(None, "signal", "unit", *columns, right=columns)
        for name, values in self.signals.items():
            unit = self.scales.get(name, self.units[name])
            finite = convert(values[np.isfinite(values)], self.units[name], unit)
            smallest = f"{finite.min():.6g}" if finite.size else ""
            largest = f"{finite.max():.6g}" if finite.size else ""
            missing = f"{values.size - finite.size}"
            table.add_row(name, unit, smallest, largest, missing)
        yield self._extent
        yield table
        yield from self._repair_lines

    def to_frame(self) -> pandas.DataFrame:
        """Return the signals as a DataFrame with the time in seconds as index.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        return pandas.DataFrame(self.signals, index=pandas.Index(self.time, name="time"))


def list_rows(rows: Iterable[int], limit: int = 5) -> str:
    """Return row numbers for a message: all, or the first `limit` and the number of the others.

    Parameters
    ----------
    rows : iterable of int
        Row numbers.
    limit : int
        Most row numbers in the list.

    Returns
    -------
    str
        For example ``"row 4"`` or ``"rows 3, 4, 5, 6, 7 and 12 more"``.
    """
    numbers = list(rows)
    if len(numbers) == 1:
        return f"row {numbers[0]}"
    listed = ", ".join(str(number) for number in numbers[:limit])
    more = f" and {len(numbers) - limit} more" if len(numbers) > limit else ""
    return f"rows {listed}{more}"


def refuse(path: Path, message: str) -> UserError:
    """Return the error for a file that cannot be used, to be raised by the caller.

    Parameters
    ----------
    path : Path
        The file.
    message : str
        Row, reason and what is allowed.

    Returns
    -------
    UserError
        One line that starts with the file. Messages of other libraries, which may quote the file,
        have escapes for unprintable characters, and lose everything beyond 1000 characters.
    """
    line = quoting.line(message)
    return UserError(f"{path}: {line if len(line) <= _LONGEST else line[:_LONGEST] + '...'}")


@contextmanager
def damaged(path: Path, kind: str) -> Iterator[None]:
    """Refuse a file of a kind for an exception of its parser, which may raise any."""
    try:
        yield
    except UserError:
        raise
    except Exception as error:
        reason = _BYTES.sub("it", str(error))
        raise refuse(
            path, f"the {kind} file is damaged: {type(error).__name__}: {reason}"
        ) from error


def refuse_loss(path: Path, what: str, rows: Sequence[int], total: int, discard: float) -> None:
    """Refuse to leave out more rows than a user allows.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What is wrong with them, such as ``rows have no valid time``.
    rows : sequence of int
        The rows.
    total : int
        Number of rows of data.
    discard : float
        Largest share that may be left out, in percent.

    Raises
    ------
    UserError
        With the option that allows it.
    """
    share = 100.0 * len(rows) / total
    if share > discard:
        allowed = option("discard", f"{math.ceil(10.0 * share) / 10.0:g}%")
        raise refuse(
            path,
            f"{len(rows)} of {total} {what} ({list_rows(rows)}): left out are at most {discard:g} %"
            f" of the rows; {allowed} allows it",
        )


def record_labels(records: Sequence[Record]) -> list[str]:
    """Return different names for records: of the run, the file, both, or numbers from 1 on."""
    files = [record.source.stem for record in records]
    runs = [record.label for record in records]
    both = [f"{file}:{run}" if run else file for file, run in zip(files, runs, strict=True)]
    for names in (runs, files, both):
        if all(names) and len(set(names)) == len(names):
            return names
    return [str(number) for number in range(1, len(records) + 1)]
