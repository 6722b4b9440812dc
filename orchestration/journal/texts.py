"""Texts about parts of some work, such as why one failed: a line of JSON each, in a file."""

from __future__ import annotations

import json
from collections.abc import Sequence

from fmus.kit import files
from orchestration.journal.work import WorkJournal

Pair = tuple[int, str]  # row of a part in the numbers of the journal, and a text about it


class RowTexts:
    """Texts about the finished parts of some work, in a file with a line of JSON for each.

    When the file is opened, texts about parts that are not done are removed from it, as is an
    unfinished last line.

    Parameters
    ----------
    journal : WorkJournal
    name : str
        Name of the file in the folder of the journal.
    mode : {"w+", "r+"}
        Begin the file anew, or continue it.

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
        """Append texts to the file; each counts once the numbers of its part are written as well.

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
        """Return the texts about parts that are done, and remove all others from the file."""
        text = self._path.read_text(encoding="utf-8") if self._path.exists() else ""
        lines = text[: text.rfind("\n") + 1].splitlines()  # without an unfinished last one
        pairs = [(int(row), str(entry)) for row, entry in map(json.loads, lines)]
        if any(not 0 <= row < journal.parts for row, _ in pairs):
            raise ValueError(f"{self._path.name} is of another number of parts")
        valid = [(row, entry) for row, entry in pairs if journal.is_done(row)]
        valid_text = "".join(_lines(valid))
        if valid_text != text:
            files.write(self._path, valid_text.encode())
        return valid


def _lines(pairs: Sequence[Pair]) -> list[str]:
    return [json.dumps(pair) + "\n" for pair in pairs]
