"""Layout of an archive's files: their names, columns and metadata.

A segment is what one server wrote in some minutes: a file for samples, one for commands and one for
events, whose names begin with the time of their first row in UTC. A file that grows is a stream of
Arrow, of which all whole batches can be read whatever happens; a closed file is Parquet.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fmus.kit.extras import optional

with optional():
    import pyarrow

KINDS = ("samples", "commands", "events")
GROWING = ".arrows"
CLOSED = ".parquet"
ABOUT = b"ppy_rig_archive"
_NAME = re.compile(rf"\d{{20}}-[0-9a-f]+-({'|'.join(KINDS)})({GROWING}|{CLOSED})")
MICROSECONDS = 1e6  # in a second
_PAUSE = 1.0  # s without a sample that are a gap, and at least three periods
_PERIODS = 3.0


class Gap(NamedTuple):
    """A gap of an archive: its wall times in s since 1970, rows lost in it, and its reason."""

    begin: float
    end: float
    lost: int
    reason: str


def archive_files(folder: Path) -> list[Path]:
    """Return the files of an archive, the oldest first; a closed one in place of what it grew from.

    Raises
    ------
    OSError
        If the folder cannot be read.
    """
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):  # GROWING comes before CLOSED
        if _NAME.fullmatch(path.name):
            found[path.stem] = path
    return list(found.values())


def segment_of(path: Path) -> str:
    """Return the name that the files of a segment share: its time and the server's run."""
    return path.stem.rpartition("-")[0]


def kind_of(path: Path) -> str:
    """Return which of `KINDS` a file holds."""
    return path.stem.rpartition("-")[2]


def schema_of(columns: Mapping[str, str | None], about: Mapping[str, Any]) -> Any:
    """Return the schema of a file of Arrow.

    Parameters
    ----------
    columns : Mapping of str to str or None
        As in `columns_of`.
    about : Mapping
        Metadata, which JSON can hold.
    """
    fields = [
        pyarrow.field("number", pyarrow.uint64()),
        pyarrow.field("time", pyarrow.float64(), metadata={"unit": "s"}),
        pyarrow.field("wall", pyarrow.timestamp("us", tz="UTC")),
    ]
    for name, unit in columns.items():
        kind = pyarrow.string() if unit is None else pyarrow.float64()
        fields.append(pyarrow.field(name, kind, metadata={"unit": unit or ""}))
    return pyarrow.schema(fields, metadata={ABOUT: json.dumps(about)})


def about_of(schema: Any) -> dict[str, Any]:
    """Return the metadata of a file."""
    about: dict[str, Any] = json.loads(schema.metadata[ABOUT])
    return about


def whole_rows(path: Path) -> Any:
    """Return the table of all whole batches of a file that grows or that was left.

    Returns
    -------
    pyarrow.Table or None
        None if it has no whole batch.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    content = path.read_bytes()
    batches = []
    try:
        with pyarrow.ipc.open_stream(content) as reader:
            batches.extend(reader)  # as far as they are whole
    except (pyarrow.ArrowInvalid, OSError):
        pass
    return pyarrow.Table.from_batches(batches) if batches else None


def summarise(table: Any) -> dict[str, Any]:
    """Return the metadata of a file with what it holds.

    Returns
    -------
    dict
        Numbers of the ``first`` and ``last`` row, their wall times in s (``begin`` and ``end``),
        and the ``gaps`` between, each with its wall times, number of lost rows and reason.
    """
    about = about_of(table.schema)
    numbers = table["number"].to_numpy().astype(np.int64)
    wall = wall_seconds(table)
    rows = list(zip(numbers.tolist(), wall.tolist(), strict=True))
    gaps: list[Gap] = []
    longest = longest_pause(about) if "missed" in table.column_names else np.inf
    for k in np.flatnonzero((np.diff(numbers) > 1) | (np.diff(wall) > longest)):
        gaps.extend(gap_between(rows[k], rows[k + 1], longest))
    (first, begin), (last, end) = rows[0], rows[-1]
    return {**about, "first": first, "last": last, "begin": begin, "end": end, "gaps": gaps}


def longest_pause(about: Mapping[str, Any]) -> float:
    """Return the longest time in s between two samples that is no gap."""
    return max(_PAUSE, _PERIODS / about["rate"])


def gap_between(
    before: tuple[int, float], after: tuple[int, float], longest: float = np.inf
) -> list[Gap]:
    """Return the gap between two rows that follow each other, in a list that is empty without one.

    Parameters
    ----------
    before, after : tuple of int and float
        Number and wall time in s.
    longest : float
        Longest time in s between two rows that is no gap.
    """
    lost = after[0] - before[0] - 1
    reason = "lost" if lost > 0 else "no sample taken"
    is_gap = lost > 0 or after[1] - before[1] > longest
    return [Gap(before[1], after[1], max(lost, 0), reason)] * is_gap


def wall_seconds(table: Any) -> Any:
    """Return the wall time of each row in s since 1970 (UTC)."""
    return table["wall"].cast(pyarrow.int64()).to_numpy() / MICROSECONDS
