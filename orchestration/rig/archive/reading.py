"""Reader of an archive: its spans, gaps and events, and the signals in a span of time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array
from fmus.kit.extras import optional
from orchestration.rig.archive.layout import (
    CLOSED,
    Gap,
    about_of,
    archive_files,
    gap_between,
    kind_of,
    longest_pause,
    summarise,
    wall_seconds,
    whole_rows,
)

with optional():
    import pyarrow
    from pyarrow import parquet

_MOST_ROWS = 300_000  # that are read for one picture; of more the extremes in the files are used


class Span(NamedTuple):
    """What one server archived: its wall times in s since 1970, its run and number of samples."""

    begin: float
    end: float
    run: str
    samples: int


@dataclass(frozen=True)
class ArchiveFile:
    """A file of an archive.

    Attributes
    ----------
    path : Path
    kind : str
        ``samples``, ``commands`` or ``events``.
    about : dict
        Its metadata, see `layout.summarise`.
    rows : int
    growing : pyarrow.Table or None
        All rows, if it is not closed.
    """

    path: Path
    kind: str
    about: dict[str, Any]
    rows: int
    growing: Any = field(default=None, repr=False)

    def table(self, columns: list[str] | None = None) -> Any:
        """Return the rows, of some columns or of all."""
        if self.growing is None:
            return parquet.read_table(self.path, columns=columns)
        return self.growing if columns is None else self.growing.select(columns)


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
        self.damaged: list[Path] = []
        try:
            paths = archive_files(folder)
        except OSError as error:
            raise UserError(f"{folder}: cannot be read: {error.strerror}") from error
        self._files = [file for path in paths if (file := self._opened(path)) is not None]
        if not self._of("samples"):
            raise UserError(f"{folder}: holds no samples of ppy rig serve --archive")

    def _opened(self, path: Path) -> ArchiveFile | None:
        """Return a file; None if it is empty, damaged, or was closed or removed meanwhile."""
        closed = path.with_suffix(CLOSED)
        try:
            if path.suffix == CLOSED or closed.exists():
                return _closed_file(closed)
            table = whole_rows(path)
        except FileNotFoundError:
            return self._opened(closed) if closed.exists() else None
        except (OSError, pyarrow.ArrowException, KeyError, ValueError, TypeError):
            self.damaged.append(path)
            return None
        if table is None:
            return None
        return ArchiveFile(path, kind_of(path), summarise(table), table.num_rows, table)

    def _of(self, kind: str, begin: float = -inf, end: float = inf) -> list[ArchiveFile]:
        """Return the files of a kind that overlap a span of wall time, the oldest first."""
        files = [file for file in self._files if file.kind == kind]
        return [each for each in files if each.about["begin"] <= end and begin <= each.about["end"]]

    def about_at(self, begin: float = -inf, end: float = inf) -> dict[str, Any]:
        """Return the metadata of the newest samples in a span of wall time."""
        return (self._of("samples", begin, end) or self._of("samples"))[-1].about

    def contents(self, begin: float = -inf, end: float = inf) -> dict[str, Any]:
        """Return what the archive holds in a span of wall time, as JSON can hold it."""
        spans = [span for span in self.spans() if span.begin < end and span.end > begin]
        return {
            "rig": self.about_at(begin, end),
            "spans": [span._asdict() for span in spans],
            "gaps": [gap._asdict() for gap in self.gaps(begin, end)],
            "events": [
                {"time": wall, "what": what, "text": text}
                for wall, what, text in self.events(begin, end)
            ],
        }

    def lines(self, begin: float = -inf, end: float = inf) -> Iterator[str]:
        """Yield what the archive holds in a span of wall time for a reader, in local time."""
        contents = self.contents(begin, end)
        rig = contents["rig"]
        names = ", ".join(f"{name} [{unit}]" for name, unit in _signals_of(rig).items())
        yield f"{rig['backend']} on {rig['host']}, {rig['rate']:g} samples a second: {names}"
        for span in contents["spans"]:
            yield f"{_local(span['begin'])} to {_local(span['end'])}  {span['samples']} samples"
        for gap in contents["gaps"]:
            lost = f"{gap['lost']} samples " * bool(gap["lost"])
            yield f"{_local(gap['begin'])} to {_local(gap['end'])}  gap: {lost}{gap['reason']}"
        for event in contents["events"]:
            yield f"{_local(event['time'])}  {event['what']}: {event['text']}"

    def spans(self) -> list[Span]:
        """Return what was archived of each run of a server, the oldest first."""
        spans: dict[str, Span] = {}
        for file in self._of("samples"):
            about = file.about
            before = spans.get(about["run"], Span(about["begin"], 0.0, about["run"], 0))
            total = before.samples + file.rows
            spans[before.run] = before._replace(end=about["end"], samples=total)
        return list(spans.values())

    def gaps(self, begin: float = -inf, end: float = inf) -> list[Gap]:
        """Return the gaps of the samples that overlap a span of wall time, the oldest first.

        Samples are lost when the archive cannot be written for too long. None is taken while the
        device is away, and between two runs of a server.
        """
        return [gap for gap in self._gaps() if gap.begin < end and gap.end > begin]

    def _gaps(self) -> Iterator[Gap]:
        before: dict[str, Any] | None = None
        for file in self._of("samples"):
            about = file.about
            if before is not None and before["run"] != about["run"]:
                yield Gap(before["end"], about["begin"], 0, "not served")
            elif before is not None:
                last, first = (before["last"], before["end"]), (about["first"], about["begin"])
                yield from gap_between(last, first, longest_pause(about))
            yield from (Gap(*gap) for gap in about["gaps"])
            before = about

    def events(self, begin: float = -inf, end: float = inf) -> list[tuple[float, str, str]]:
        """Return wall time in s, kind (``log`` or ``state``) and text of the events in a span."""
        events: list[tuple[float, str, str]] = []
        for file in self._of("events", begin, end):
            table = file.table()
            columns = (wall_seconds(table), table["what"].to_pylist(), table["text"].to_pylist())
            events.extend(zip(columns[0].tolist(), *columns[1:], strict=True))
        return [event for event in events if begin <= event[0] <= end]

    def rows(self, kind: str, begin: float, end: float) -> Any:
        """Return the rows of one run in a span of wall time, each once.

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
        tables = []
        last = 0
        for file in files:
            table = file.table()
            wall = wall_seconds(table)
            numbers = table["number"].to_numpy()
            tables.append(table.filter((begin <= wall) & (wall <= end) & (numbers > last)))
            last = file.about["last"]
        if not sum(table.num_rows for table in tables):
            raise UserError(f"{self.folder}: holds no {kind} in this span of time")
        if len({file.about["run"] for file in files}) > 1:
            raise UserError(
                f"{self.folder}: the span holds several runs of the server, whose signals may"
                " differ; choose one with --from and --to, as ppy rig archive lists them"
            )
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
        files = [
            file for file in self._of("samples", begin, end) if name in _signals_of(file.about)
        ]
        is_coarse = sum(file.rows for file in files) > _MOST_ROWS
        read = _extremes_of_groups if is_coarse else _all_values
        parts = [read(file, name) for file in files]
        time, low, high = np.hstack([np.empty((3, 0)), *parts])
        inside = (begin <= time) & (time <= end) & np.isfinite(low)
        time, low, high = time[inside], low[inside], high[inside]
        if not time.size:
            return time, low, high
        width = (end - begin) / most
        place = np.floor((time - begin) / width).astype(int)
        starts = np.flatnonzero(np.diff(place, prepend=-1))
        middle = begin + (place[starts] + 0.5) * width
        return middle, np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)


@lru_cache(maxsize=2**16)  # closed files never change, and an archive may have thousands
def _closed_file(path: Path) -> ArchiveFile:
    """Return a closed file."""
    metadata = parquet.read_metadata(path)
    about = about_of(metadata.schema.to_arrow_schema())
    return ArchiveFile(path, kind_of(path), about, metadata.num_rows)


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


def _local(wall: float) -> str:
    return datetime.fromtimestamp(wall).isoformat(" ", "milliseconds")


def _signals_of(about: Mapping[str, Any]) -> dict[str, str]:
    """Return the units of all signals of a file, by name."""
    return {**about["inputs"], **about["outputs"]}


def _all_values(file: ArchiveFile, name: str) -> Array:
    """Return the wall time of every row and twice its value, shape (3, n)."""
    table = file.table(["wall", name])
    values = table[name].to_numpy()
    return np.array([wall_seconds(table), values, values])


def _extremes_of_groups(file: ArchiveFile, name: str) -> Array:
    """Return the middle wall time and the extremes of each group of rows, shape (3, n).

    A group has a thousand rows, and its extremes are in the metadata of the file.
    """
    if file.growing is not None:
        return _all_values(file, name)
    metadata = parquet.read_metadata(file.path)
    names = metadata.schema.names
    found = []
    for k in range(metadata.num_row_groups):
        group = metadata.row_group(k)
        wall = group.column(names.index("wall")).statistics
        values = group.column(names.index(name)).statistics
        if values is not None and values.has_min_max:
            middle = (wall.min.timestamp() + wall.max.timestamp()) / 2
            found.append((middle, values.min, values.max))
    return np.array(found).reshape(-1, 3).T
