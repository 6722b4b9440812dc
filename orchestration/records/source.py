"""Sources of records: a file or arrays, the form of the table in it, and the part that is used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from orchestration.records.frames import Arrays


@dataclass(frozen=True)
class Reading:
    """Form of a table that its file does not tell, and the part of it that is used.

    Attributes
    ----------
    columns : tuple of str
        Names of the columns of a file without a header, as ``name`` or ``name=unit``.
    rate : float or None
        Rows per second of a file without a time, Hz.
    decimal : {"", "comma", "point"}
        Decimal mark of numbers that may be read with either.
    table : str
        Name or number (from 1) of the table, of a file that has several.
    begin, end : float or None
        First and last time that is used, s.
    rows : tuple of int or None
        First and last row that is used, numbered as in messages.
    segment : Mapping of str to str
        Labels, separated by commas, of the rows that are used, by column.
    discard : float
        Largest share of the rows that repairs may leave out, in percent.
    texts : bool
        True if the cells of text files stay text although they are numbers, as for words.
    """

    columns: tuple[str, ...] = ()
    rate: float | None = None
    decimal: str = ""
    table: str = ""
    begin: float | None = None
    end: float | None = None
    rows: tuple[int, int] | None = None
    segment: Mapping[str, str] = field(default_factory=dict)
    discard: float = 1.0
    texts: bool = False


AS_IT_STANDS = Reading()


@dataclass(frozen=True)
class Source:
    """A file or arrays, and how they are read.

    Attributes
    ----------
    data : Path, DataFrame or Mapping of str to array_like, shape (n,)
    reading : Reading
    """

    data: Path | Arrays
    reading: Reading = AS_IT_STANDS

    @classmethod
    def of(cls, data: Readable, **reading: Any) -> Source:
        """Return a source as it is, or data as a source with fields of its `Reading`."""
        if isinstance(data, Source):
            return data
        return cls(Path(data) if isinstance(data, str) else data, Reading(**reading))


Readable: TypeAlias = "str | Path | Arrays | Source"
