"""Journal of long work: outcomes of its parts as they come, each a row of numbers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kit import UserError, files
from fmus.kit.arrays import Array
from orchestration.journal.arrays import opened, reserve
from orchestration.journal.folder import ABOUT, DONE, NUMBERS


class WorkJournal:
    """Results of the parts of some work, in a folder from which interrupted work continues.

    Each part has a row of numbers. Arrays have their whole size from the start. A subclass that
    stores more than numbers overrides `begin`.

    Parameters
    ----------
    folder : Path
        An existing one that this process has locked; a journal of the same work is continued.
    kind : str
        Name of the work, for messages.
    about : Mapping of str to str
        Digests of the parts that define the work, by name.
    shape : tuple of int
        Number of parts n, and the shape of the numbers of each.

    Attributes
    ----------
    folder : Path
    numbers : ndarray
        Numbers of all parts, of that shape, mapped from the disk.

    Raises
    ------
    UserError
        If the folder is of other work, or cannot be written.
    """

    def __init__(self, folder: Path, kind: str, about: Mapping[str, str], shape: tuple[int, ...]):
        self.folder = folder
        mode = "r+"
        try:
            if (folder / ABOUT).exists():
                stored = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
                _refuse_other_work(folder, kind, stored, about)
            else:
                mode = "w+"
            self._done = _array(folder / DONE, mode, shape[:1], "u1")
            self.numbers = _array(folder / NUMBERS, mode, shape, "f8")
            self.begin(mode)
            if mode == "w+":  # last: a folder without it is begun anew
                files.write(folder / ABOUT, json.dumps(dict(about)).encode())
        except OSError as error:
            if mode == "w+":
                for path in folder.glob("*.npy"):  # the disk may be full of them
                    path.unlink(missing_ok=True)
            raise UserError(f"{folder}: cannot be written ({error.strerror or error})") from error
        except UserError:  # which is a ValueError
            raise
        except (ValueError, TypeError, RecursionError) as error:
            raise UserError(f"{folder}: is damaged ({error}); remove it to begin anew") from error

    def begin(self, mode: str) -> None:
        """Begin (mode ``w+``) or continue (``r+``) what a subclass stores besides numbers."""

    @property
    def parts(self) -> int:
        """Number of parts."""
        return len(self._done)

    def is_done(self, row: int) -> bool:
        """Return whether the numbers of a part have been written."""
        return bool(self._done[row])

    @property
    def open_rows(self) -> list[int]:
        """Rows of the parts that are not done."""
        return [int(row) for row in np.flatnonzero(self._done == 0)]

    def keep(self, rows: Any, numbers: Array) -> None:
        """Write the numbers of parts, which then count as done."""
        self.numbers[rows] = numbers
        self._done[rows] = 1  # last: work may be interrupted before it


def no_longer_writable(folder: Path, error: OSError) -> UserError:
    """Return the error for a journal that cannot be written any more; finished parts remain."""
    return UserError(
        f"{folder}: cannot be written ({error.strerror}); what is done stands there to go on with"
    )


def count_done(folder: Path) -> tuple[int, int]:
    """Return the numbers of finished parts and of all parts in the journal of a folder.

    Both are 0 without a journal.
    """
    try:
        done = np.load(folder / DONE)
    except (OSError, ValueError, EOFError):  # EOFError by an empty file
        return 0, 0
    return int(np.count_nonzero(done)), done.size


def digest(*parts: Any) -> str:
    """Return the SHA-256 digest of values: arrays by their bytes, all others by their ``repr``."""
    whole = hashlib.sha256()
    for part in parts:
        whole.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
    return whole.hexdigest()


def _array(path: Path, mode: str, shape: tuple[int, ...], kind: str) -> Array:
    """Map an array from the disk; mode r+ opens an existing file, w+ makes one of zeros."""
    if 0 in shape:  # which cannot be mapped
        return np.empty(shape, kind)
    if mode == "r+":
        return opened(path, "r+", shape, kind)
    array = np.lib.format.open_memmap(path, "w+", np.dtype(kind), shape)
    reserve(path)
    return array


def _refuse_other_work(folder: Path, kind: str, stored: Any, digests: Mapping[str, str]) -> None:
    """Refuse a folder whose stored digests belong to other work.

    Raises
    ------
    ValueError
        If the stored data cannot be understood: the journal is damaged.
    UserError
        If it is of other work.
    """
    if not isinstance(stored, dict):
        raise ValueError(f"{ABOUT} holds no table")
    other = [part for part, one in digests.items() if stored.get(part) != one]
    if other:
        raise UserError(
            f"{folder}: is of another {kind} (not the same: {', '.join(other)}); remove it to begin"
            " anew"
        )
