"""Texts about parts of some work, such as why one failed: a line of JSON each, in a file."""

from __future__ import annotations

import json
from collections.abc import Sequence

from fmus.kit import files
from orchestration.journal.work import WorkJournal

Pair = tuple[int, str]  # row of a part, and a text about it


class RowTexts:
    """Texts of finished parts, next to their numbers.

    Texts about parts that are not done are removed from the file, as is an unfinished last line.

    Parameters
    ----------
    journal : WorkJournal
    name : str
        Of the file in its folder.
    mode : {"w+", "r+"}
        Begins or continues the file.

    Attributes
    ----------
    pairs : list of tuple of int and str
        Rows of parts, and texts, in the order in which they came.

    Raises
    ------
    ValueError
        If the file cannot be understood: the journal is damaged.
    OSError
        If it can be neither read nor written.
    """

    def __init__(self, journal: WorkJournal, name: str, mode: str):
        self._path = journal.folder / name
        if mode == "w+":
            self._path.unlink(missing_ok=True)
        self.pairs = self._read(journal)

    def append(self, pairs: Sequence[Pair]) -> None:
        """Keep texts about parts, which are done once their numbers are kept, too.

        Raises
        ------
        OSError
            If they cannot be written.
        """
        if pairs:
            self.pairs.extend(pairs)
            with self._path.open("a", encoding="utf-8") as file:
                file.writelines(_lines(pairs))

    def _read(self, journal: WorkJournal) -> list[Pair]:
        """Return the entries of parts that are done, and remove all others from the file."""
        text = self._path.read_text(encoding="utf-8") if self._path.exists() else ""
        lines = text[: text.rfind("\n") + 1].splitlines()
        pairs = [(int(row), str(entry)) for row, entry in map(json.loads, lines)]
        if any(not 0 <= row < journal.parts for row, _ in pairs):
            raise ValueError(f"{self._path.name} is of another number of parts")
        kept = [(row, entry) for row, entry in pairs if journal.is_done(row)]
        whole = "".join(_lines(kept))
        if whole != text:
            files.write(self._path, whole.encode())
        return kept


def _lines(pairs: Sequence[Pair]) -> list[str]:
    return [json.dumps(pair) + "\n" for pair in pairs]
