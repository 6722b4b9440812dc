"""Writer of an archive: a segment that grows, closed segments, and a bound of their size."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic
from typing import Any

from fmus.kit.extras import optional
from orchestration.rig.archive.layout import (
    ABOUT,
    CLOSED,
    GROWING,
    MICROSECONDS,
    about_of,
    archive_files,
    kind_of,
    schema_of,
    segment_of,
    summarise,
    whole_rows,
)

with optional():
    import pyarrow
    from pyarrow import parquet

_LONGEST = 3600.0  # s of a segment
_LARGEST = 2**24  # bytes of it while it grows
_SHARE = 8  # of the archive's size, that it may have then at most
_GROUP = 1000  # rows of a closed file, of which the extremes of each signal are stored


class ArchiveWriter:
    """Writer of the archive of one server.

    Parameters
    ----------
    folder : Path
    size : float
        Size of all files, in bytes; the oldest segments are removed beyond it.
    about : Mapping
        Metadata, which JSON can hold; ``run`` identifies the server among others.
    columns : Mapping of str to Mapping
        See `columns_of`.
    """

    def __init__(
        self,
        folder: Path,
        size: float,
        about: Mapping[str, Any],
        columns: Mapping[str, Mapping[str, str | None]],
    ) -> None:
        self._folder = folder
        self._largest = min(_LARGEST, size / _SHARE)
        self._size = size - 2 * self._largest  # room for a segment that grows, and for closing it
        self._run = about["run"]
        self._schemas = {kind: schema_of(those, about) for kind, those in columns.items()}
        self._growing: dict[str, _GrowingFile] = {}
        self._segment = ""
        self._begun = 0.0

    def last(self, kind: str) -> int:
        """Return the number of the last row of a kind that this run has written; 0 without one.

        Raises
        ------
        OSError
            If the files cannot be read.
        """
        self.tidy()
        own = [path for path in archive_files(self._folder) if segment_of(path).endswith(self._run)]
        closed = [path for path in own if path.suffix == CLOSED and kind_of(path) == kind]
        return max((about_of(parquet.read_schema(path))["last"] for path in closed), default=0)

    def add(self, kind: str, rows: Sequence[tuple[Any, ...]], ahead: float) -> None:
        """Write rows; they are on the disk when this returns.

        Parameters
        ----------
        kind : str
        rows : sequence of tuple
            Number, time in s and the other columns.
        ahead : float
            Lead of the wall time over these times, s.

        Raises
        ------
        OSError
            If they cannot be written; the segment has ended then, and they may be written again.
        """
        try:
            if not self._growing:
                self._begun = monotonic()
                self._segment = f"{datetime.now(UTC):%Y%m%d%H%M%S%f}-{self._run}"
            if kind not in self._growing:
                path = self._folder / f"{self._segment}-{kind}{GROWING}"
                self._growing[kind] = _GrowingFile(path, self._schemas[kind])
            self._growing[kind].add(rows, ahead)
        except OSError:
            self._end_segment()
            raise
        is_large = sum(file.size for file in self._growing.values()) > self._largest
        if is_large or monotonic() - self._begun > _LONGEST:
            self.close()

    def close(self) -> None:
        """Close the segment.

        Raises
        ------
        OSError
            If its files cannot be closed; they are whole, and `tidy` tries again.
        """
        self._end_segment()
        self.tidy()

    def _end_segment(self) -> None:
        for file in self._growing.values():
            file.close()
        self._growing = {}

    def tidy(self) -> None:
        """Close files that were left, and remove the oldest segments beyond the size.

        Raises
        ------
        OSError
            If that cannot be done.
        """
        growing = {file.path for file in self._growing.values()}
        self._bound()
        for path in archive_files(self._folder):
            if path.suffix == GROWING and path not in growing:
                _close(path)
        for path in self._folder.glob(f"*{GROWING}"):
            if path.with_suffix(CLOSED).exists():  # the end came between the last two steps
                path.unlink()
        self._bound()

    def _bound(self) -> None:
        """Remove the oldest segments, as far as the size demands."""
        sizes: dict[str, int] = {}
        for path in archive_files(self._folder):
            segment = segment_of(path)
            sizes[segment] = sizes.get(segment, 0) + path.stat().st_size
        total = sum(sizes.values())
        for segment, size in sizes.items():
            if total <= self._size or segment == self._segment:
                return
            for path in self._folder.glob(f"{segment}-*"):
                path.unlink()
            total -= size


def _close(path: Path) -> None:
    """Turn a file that was left into a closed one; remove one without a whole batch."""
    table = whole_rows(path)
    if table is not None:
        closed = table.replace_schema_metadata({ABOUT: json.dumps(summarise(table))})
        part = path.with_suffix(".part")
        try:
            parquet.write_table(closed, part, row_group_size=_GROUP, compression="zstd")
            part.replace(path.with_suffix(CLOSED))
        except OSError:
            with suppress(OSError):
                part.unlink()
            raise
    path.unlink()


class _GrowingFile:
    """A file of Arrow's stream format that is written batch by batch.

    Parameters
    ----------
    path : Path
    schema : pyarrow.Schema
    """

    def __init__(self, path: Path, schema: Any) -> None:
        self.path = path
        self.size = 0
        self._schema = schema
        self._file = path.open("xb")
        self._writer = pyarrow.ipc.new_stream(self._file, schema)

    def add(self, rows: Sequence[tuple[Any, ...]], ahead: float) -> None:
        """Write rows as a batch, through to the disk; see `ArchiveWriter.add`."""
        number, times, *others = zip(*rows, strict=True)
        wall = [round(MICROSECONDS * (moment + ahead)) for moment in times]
        columns = [
            pyarrow.array(cells, field.type, from_pandas=True)
            for cells, field in zip((number, times, wall, *others), self._schema, strict=True)
        ]
        self._writer.write_batch(pyarrow.record_batch(columns, schema=self._schema))
        self._file.flush()
        os.fsync(self._file.fileno())
        self.size = self._file.tell()

    def close(self) -> None:
        """Close the file, without what was not written in full, which would fill a full disk."""
        with suppress(OSError):
            self._file.close()
        with suppress(OSError):
            os.truncate(self.path, self.size)
            if not self.size:
                self.path.unlink()
