"""Files of an archive: their names, columns and metadata.

Each is a Parquet file of some thousand rows that one server wrote: samples, commands or events. Its
name begins with the time of its first row in UTC. The newest one of a kind is written anew with
each batch of rows and replaces the one before, so that every file is whole at any time.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.extras import optional

with optional():
    import pyarrow
    from pyarrow import compute, parquet

_ABOUT = b"ppy_rig_archive"
MICROSECONDS = 1e6  # in a second
_PAUSE = 1.0  # s without a sample that are a gap, and at least three periods
_PERIODS = 3.0


class Piece(NamedTuple):
    """Rows that follow each other without a gap: numbers and wall times in s of first and last."""

    first: int
    begin: float
    last: int
    end: float


@dataclass(frozen=True)
class ArchiveFile:
    """A file of an archive, by its name and metadata.

    Attributes
    ----------
    path : Path
    kind : str
        ``samples``, ``commands`` or ``events``.
    rows : int
    rig : dict
        The server and its rig.
    pieces : list of Piece
        One more than there are gaps.
    extremes : dict of str to list
        The least and the largest value of each signal, NaN without any.
    """

    path: Path
    kind: str
    rows: int
    rig: dict[str, Any]
    pieces: list[Piece]
    extremes: dict[str, list[float]]

    def overlaps(self, begin: float, end: float) -> bool:
        """Return True if rows may be in a span of wall time."""
        return self.pieces[0].begin <= end and begin <= self.pieces[-1].end


def archive_paths(folder: Path) -> list[Path]:
    """Return the files of an archive, the oldest first."""
    return sorted(folder.glob(f"{20 * '[0-9]'}-*.parquet"))


def read_files(folder: Path) -> tuple[list[ArchiveFile], list[Path]]:
    """Return the files of an archive, the oldest first, and those that are damaged."""
    files = []
    damaged = []
    for path in archive_paths(folder):
        try:
            files.append(_read_file(path, path.stat().st_mtime_ns))
        except FileNotFoundError:  # the server has removed it meanwhile
            pass
        except (OSError, pyarrow.ArrowException, LookupError, ValueError, TypeError):
            damaged.append(path)
    return files, damaged


@lru_cache(maxsize=2**16)  # an archive may have thousands, of which a few change
def _read_file(path: Path, changed: int) -> ArchiveFile:
    """Return a file as it was at the time `changed`, ns."""
    metadata = parquet.read_metadata(path)
    about = json.loads(metadata.metadata[_ABOUT])
    about["pieces"] = [Piece(*piece) for piece in about["pieces"]]
    return ArchiveFile(path, path.stem.rpartition("-")[2], metadata.num_rows, **about)


def schema_of(columns: Mapping[str, str | None]) -> Any:
    """Return the schema of a file with some columns after number, time and wall time."""
    fields = [
        pyarrow.field("number", pyarrow.int64()),
        pyarrow.field("time", pyarrow.float64(), metadata={"unit": "s"}),
        pyarrow.field("wall", pyarrow.timestamp("us", tz="UTC")),
    ]
    for name, unit in columns.items():
        kind = pyarrow.string() if unit is None else pyarrow.float64()
        fields.append(pyarrow.field(name, kind, metadata={"unit": unit or ""}))
    return pyarrow.schema(fields)


def write_file(path: Path, table: Any, rig: Mapping[str, Any], longest: float) -> None:
    """Write a file through to the disk, in place of the one before, which stays if that fails.

    Parameters
    ----------
    path : Path
    table : pyarrow.Table
    rig : Mapping
        Metadata, which JSON can hold.
    longest : float
        Longest time in s between two rows that is no gap.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    signals = {**rig["inputs"], **rig["outputs"]}
    extremes = {
        name: [*compute.min_max(table[name]).as_py().values()]
        for name in signals.keys() & table.column_names
    }
    about = {"rig": rig, "pieces": _pieces(table, longest), "extremes": extremes}
    part = path.with_name(f"{rig['run']}.part")  # which the next writer of a run replaces
    try:
        with part.open("wb") as file:
            described = table.replace_schema_metadata({_ABOUT: json.dumps(about)})
            parquet.write_table(described, file, compression="zstd", use_dictionary=False)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        with suppress(OSError):
            part.unlink()


def _pieces(table: Any, longest: float) -> list[tuple[int, float, int, float]]:
    """Return the fields of the pieces of a table."""
    numbers = table["number"].to_numpy()
    wall = wall_seconds(table)
    breaks = np.flatnonzero((np.diff(numbers) > 1) | (np.diff(wall) > longest))
    first = [0, *breaks + 1]
    last = [*breaks, -1]
    fields = (numbers[first], wall[first], numbers[last], wall[last])
    return list(zip(*(field.tolist() for field in fields), strict=True))


def longest_pause(rig: Mapping[str, Any]) -> float:
    """Return the longest time in s between two samples that is no gap."""
    return max(_PAUSE, _PERIODS / rig["rate"])


def wall_seconds(table: Any) -> Array:
    """Return the wall time of each row in s since 1970 (UTC)."""
    seconds: Array = table["wall"].cast(pyarrow.int64()).to_numpy() / MICROSECONDS
    return seconds
