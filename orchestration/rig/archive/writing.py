"""Writer of an archive, within a bound of its size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from math import inf
from pathlib import Path
from typing import Any

from fmus.kit.extras import optional
from orchestration.rig.archive.columns import Columns
from orchestration.rig.archive.files import (
    MICROSECONDS,
    archive_paths,
    longest_pause,
    read_files,
    schema_of,
    write_file,
)

with optional():
    import pyarrow

_MOST_ROWS = 10_000  # of a file, which is written anew with each batch
_LONGEST = 3600.0  # s of a file, so that events are removed together with their samples
_SHARE = 8  # of the archive's size, that a file may have at most


class ArchiveWriter:
    """Writer of the archive of one server.

    Parameters
    ----------
    folder : Path
    size : float
        Size of all files, in bytes; the oldest are removed beyond it.
    rig : Mapping
        Metadata, which JSON can hold: ``run`` identifies the server among others; its rig has
        ``inputs``, ``outputs`` and a ``rate`` in Hz.
    columns : Mapping of str to Mapping
        See `columns_of`.

    Attributes
    ----------
    last : dict of str to int
        Number of the last row by kind; 0 without one.
    """

    def __init__(self, folder: Path, size: float, rig: Mapping[str, Any], columns: Columns) -> None:
        self._folder = folder
        self._size = size
        self._rig = rig
        self._schemas = {kind: schema_of(those) for kind, those in columns.items()}
        self._growing: dict[str, tuple[Path, Any]] = {}  # by kind: a file and its rows
        self.last = dict.fromkeys(columns, 0)
        for file in read_files(folder)[0]:
            if file.rig["run"] == rig["run"]:
                self.last[file.kind] = file.pieces[-1].last

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
            If they cannot be written; they may be added again.
        """
        number, times, *others = zip(*rows, strict=True)
        wall = [round(MICROSECONDS * (moment + ahead)) for moment in times]
        schema = self._schemas[kind]
        columns = dict(zip(schema.names, (number, times, wall, *others), strict=True))
        path, before = self._growing.get(kind) or self._new(kind)
        table = pyarrow.concat_tables([before, pyarrow.table(columns, schema=schema)])
        longest = longest_pause(self._rig) if kind == "samples" else inf
        write_file(path, table, self._rig, longest)
        self.last[kind] = number[-1]
        self._growing[kind] = (path, table)
        is_long = times[-1] - table["time"][0].as_py() > _LONGEST
        is_large = path.stat().st_size > self._size / _SHARE
        if is_long or is_large or table.num_rows >= _MOST_ROWS:
            del self._growing[kind]

    def _new(self, kind: str) -> tuple[Path, Any]:
        """Return a file without rows, and make room for it."""
        self._bound()
        name = f"{datetime.now(UTC):%Y%m%d%H%M%S%f}-{self._rig['run']}-{kind}.parquet"
        return self._folder / name, self._schemas[kind].empty_table()

    def _bound(self) -> None:
        """Remove the oldest files, until there is room for two that grow."""
        growing = [path for path, _ in self._growing.values()]
        sizes = {path: path.stat().st_size for path in archive_paths(self._folder)}
        excess = sum(sizes.values()) - (1 - 2 / _SHARE) * self._size
        for path, size in sizes.items():
            if excess > 0 and path not in growing:
                path.unlink()
                excess -= size
