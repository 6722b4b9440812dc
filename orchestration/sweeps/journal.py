"""What a sweep has done so far, on disk: numbers as they come, so that an interrupted one goes on."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import files
from fmus.kit.errors import UserError
from orchestration.sweeps.task import Outcome, Task, failed

Array = NDArray[np.float64]
_ABOUT, _DONE, _NUMBERS, _TRACES, _FAILURES = "sweep.json", "done.npy", "numbers.npy", "traces.npy", "failures.jsonl"


class Journal:
    """Outcomes of all cases of a sweep in a folder; arrays there are as large as all of them from the start.

    Parameters
    ----------
    folder : Path
        Made if it is not there; of a sweep that is the same it is gone on with.
    task : Task
    cases : ndarray, shape (n, p)
    guid : str
        Of the FMU.

    Raises
    ------
    UserError
        If the folder is of another sweep, or cannot be written.
    """

    def __init__(self, folder: Path, task: Task, cases: Array, guid: str):
        self.folder, self._task = folder, task
        about = _about(task, cases, guid)
        nothing, mode = failed(task, ""), ""
        try:
            if (folder / _ABOUT).exists():
                _check(folder, json.loads((folder / _ABOUT).read_text(encoding="utf-8")), about)
                mode = "r+"
            else:
                folder.mkdir(parents=True, exist_ok=True)
                (folder / _FAILURES).unlink(missing_ok=True)
                mode = "w+"
            self._done = _array(folder / _DONE, mode, (len(cases),), "u1")
            self.numbers = _array(folder / _NUMBERS, mode, (len(cases), *nothing.numbers.shape), "f8")
            self.traces = _array(folder / _TRACES, mode, (len(cases), *nothing.trace.shape), "f8")
            if mode == "w+":  # last: a folder without it is begun anew
                files.write(folder / _ABOUT, json.dumps(about).encode())
            self.failures = _failures(folder / _FAILURES)
        except OSError as error:
            if mode == "w+":
                for name in (_DONE, _NUMBERS, _TRACES):  # what has no room is not left in the way of others
                    (folder / name).unlink(missing_ok=True)
            raise UserError(f"{folder}: cannot be written ({error.strerror or error})") from error
        except ValueError as error:
            raise UserError(f"{folder}: is damaged ({error}); remove it to begin anew") from error

    @property
    def left(self) -> list[int]:
        """Cases that are not done."""
        return [int(row) for row in np.flatnonzero(self._done == 0)]

    def write(self, row: int, outcome: Outcome) -> None:
        """Keep what a case left; it is done once its numbers are there."""
        self.numbers[row] = outcome.numbers
        if outcome.trace.size:
            self.traces[row] = outcome.trace
        if outcome.failure:
            self.failures[row] = outcome.failure
            try:
                with (self.folder / _FAILURES).open("a", encoding="utf-8") as file:
                    file.write(json.dumps([row, outcome.failure]) + "\n")
            except OSError as error:
                raise UserError(
                    f"{self.folder}: cannot be written ({error.strerror}); what is done stands there to go on with"
                ) from error
        self._done[row] = 1


def _failures(path: Path) -> dict[int, str]:
    """Why cases left nothing; a line that was not written to its end is of a case that is not done, and goes."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        files.write(path, whole.encode())
    return {int(row): str(reason) for row, reason in map(json.loads, whole.splitlines())}


def _array(path: Path, mode: str, shape: tuple[int, ...], kind: str) -> Array:
    if 0 in shape:
        return np.empty(shape, kind)
    if mode == "r+":
        return np.lib.format.open_memmap(path, "r+")
    array = np.lib.format.open_memmap(path, "w+", np.dtype(kind), shape)
    _reserve(path)
    return array


def _reserve(path: Path) -> None:
    """Take room on the disk for all of a file: to write into a mapped file that has none ends the process."""
    size = path.stat().st_size
    if hasattr(os, "posix_fallocate"):
        with path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, size)
    elif shutil.disk_usage(path.parent).free < size:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _about(task: Task, cases: Array, guid: str) -> dict[str, str]:
    """Digests of what a sweep is."""

    def digest(*parts: Any) -> str:
        whole = hashlib.sha256()
        for part in parts:
            whole.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
        return whole.hexdigest()

    return {
        "the FMU": guid,
        "the cases": digest(task.names, cases),
        "settings and inputs": digest(
            sorted(task.settings.items()), task.time, sorted(task.inputs), *task.inputs.values()
        ),
        "what is kept": digest(task.outputs, task.keep),
        "the engine": task.engine,
    }


def _check(folder: Path, known: Mapping[str, str], about: Mapping[str, str]) -> None:
    other = [what for what, digest in about.items() if known.get(what) != digest]
    if other:
        raise UserError(f"{folder}: is of another sweep ({', '.join(other)} differ); remove it, or name another --out")
