"""Reader of an archive: its spans, gaps and events, and the signals in a span of time."""

from __future__ import annotations

from datetime import datetime
from itertools import groupby, pairwise
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.extras import optional
from orchestration.rig.archive.files import ArchiveFile, longest_pause, read_files, wall_seconds

with optional():
    import pyarrow
    from pyarrow import parquet

_MOST_ROWS = 2_000_000  # that are read for a curve; of more, the extremes of each file are shown


class Span(NamedTuple):
    """Rows of one run of a server: wall times in s since 1970, run and number of samples."""

    begin: float
    end: float
    run: str
    samples: int


class Gap(NamedTuple):
    """A gap of an archive: its wall times in s since 1970, rows lost in it, and its reason."""

    begin: float
    end: float
    lost: int
    reason: str


class Event(NamedTuple):
    """An event: wall time in s since 1970, ``log`` or ``state``, and its text."""

    time: float
    what: str
    text: str


class Archive:
    """An archive of a rig, as it was when this was made.

    Parameters
    ----------
    folder : Path

    Attributes
    ----------
    damaged : list of Path
        Files that could not be read.

    Raises
    ------
    UserError
        If there is no archive with samples.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files, self.damaged = read_files(folder)
        if not self._of("samples"):
            raise UserError(f"{folder}: holds no samples of ppy rig serve --archive")

    def _of(self, kind: str, begin: float = -inf, end: float = inf) -> list[ArchiveFile]:
        """Return the files of a kind that overlap a span of wall time, the oldest first."""
        return [file for file in self._files if file.kind == kind and file.overlaps(begin, end)]

    def contents(self, begin: float = -inf, end: float = inf) -> dict[str, Any]:
        """Return what the archive holds in a span of wall time, as JSON can hold it."""
        spans = [span for span in self.spans() if span.begin < end and span.end > begin]
        return {
            "rig": self.rig(begin, end),
            "spans": [span._asdict() for span in spans],
            "gaps": [gap._asdict() for gap in self.gaps(begin, end)],
            "events": [event._asdict() for event in self.events(begin, end)],
        }

    def rig(self, begin: float = -inf, end: float = inf) -> dict[str, Any]:
        """Return the metadata of the newest samples in a span of wall time, or of all."""
        return (self._of("samples", begin, end) or self._of("samples"))[-1].rig

    def spans(self) -> list[Span]:
        """Return what was archived of each run of a server, the oldest first."""
        spans = []
        for run, group in groupby(self._of("samples"), _run):
            files = list(group)
            rows = sum(file.rows for file in files)
            spans.append(Span(files[0].pieces[0].begin, files[-1].pieces[-1].end, run, rows))
        return spans

    def gaps(self, begin: float = -inf, end: float = inf) -> list[Gap]:
        """Return the gaps of the samples that overlap a span of wall time, the oldest first.

        Samples are lost when the archive cannot be written for too long. None is taken while the
        device is away, and between two runs of a server.
        """
        gaps = []
        pieces = [(file.rig, piece) for file in self._of("samples") for piece in file.pieces]
        for (rig, before), (next_rig, after) in pairwise(pieces):
            lost = 0
            if rig["run"] != next_rig["run"]:
                reason = "not served"
            elif after.first > before.last + 1:
                reason = "lost"
                lost = after.first - before.last - 1
            elif after.begin - before.end > longest_pause(rig):
                reason = "no sample taken"
            else:
                continue
            gaps.append(Gap(before.end, after.begin, lost, reason))
        return [gap for gap in gaps if gap.begin < end and gap.end > begin]

    def events(self, begin: float = -inf, end: float = inf) -> list[Event]:
        """Return the events in a span of wall time."""
        events: list[Event] = []
        for file in self._of("events", begin, end):
            table = parquet.read_table(file.path)
            wall = wall_seconds(table).tolist()
            events += map(Event, wall, table["what"].to_pylist(), table["text"].to_pylist())
        return [event for event in events if begin <= event.time <= end]

    def rows(self, kind: str, begin: float, end: float) -> Any:
        """Return the rows of one run in a span of wall time.

        Parameters
        ----------
        kind : str
        begin, end : float
            Wall times in s.

        Returns
        -------
        pyarrow.Table

        Raises
        ------
        UserError
            If there is none, or they are of several runs, whose clocks differ.
        """
        files = self._of(kind, begin, end)
        if len({*map(_run, files)}) > 1:
            raise UserError(
                f"{self.folder}: the span holds several runs of the server, whose signals may"
                " differ; choose one with --from and --to, as ppy rig archive lists them"
            )
        tables = []
        for file in files:
            table = parquet.read_table(file.path)
            wall = wall_seconds(table)
            tables.append(table.filter((begin <= wall) & (wall <= end)))
        if not any(table.num_rows for table in tables):
            raise UserError(f"{self.folder}: holds no {kind} in this span of time")
        return pyarrow.concat_tables(tables)

    def extremes(self, name: str, begin: float, end: float, most: int) -> tuple[Array, ...]:
        """Return the extremes of a signal in equal parts of a span, as far as it has samples there.

        Parameters
        ----------
        name : str
        begin, end : float
            Wall times in s.
        most : int
            Number of parts.

        Returns
        -------
        time, low, high : ndarray, shape (n,)
            Middle of each part in s, and the least and the largest value in it.
        """
        files = [file for file in self._of("samples", begin, end) if name in file.extremes]
        is_long = sum(file.rows for file in files) > _MOST_ROWS
        points = [np.empty((3, 0))]
        for file in files:
            if is_long:
                amid = (file.pieces[0].begin + file.pieces[-1].end) / 2
                points.append(np.array([[amid, *file.extremes[name]]]).T)
            else:
                table = parquet.read_table(file.path, columns=["wall", name])
                values = table[name].to_numpy()
                points.append(np.array([wall_seconds(table), values, values]))
        time, low, high = np.hstack(points)
        inside = (begin <= time) & (time <= end) & np.isfinite(low)
        time, low, high = time[inside], low[inside], high[inside]
        width = (end - begin) / most
        place, starts = np.unique(np.floor((time - begin) / width), return_index=True)
        if not starts.size:
            return time, low, high
        middle = begin + (place + 0.5) * width
        return middle, np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)


def _run(file: ArchiveFile) -> str:
    return str(file.rig["run"])


def read_date(text: str | None, option: str, default: float) -> float:
    """Return the wall time of a date in s since 1970, in local time unless it says another.

    Raises
    ------
    UserError
        If it is no date.
    """
    if text is None:
        return default
    try:
        return datetime.fromisoformat(text).timestamp()
    except (ValueError, OverflowError, OSError) as error:
        raise UserError(f"{option} {text!r}: write a date such as '2026-11-29 18:30:05'") from error
