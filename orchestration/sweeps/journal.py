"""What a sweep has done so far, on disk: numbers as they come, so that an interrupted one goes on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import files
from fmus.kit.errors import UserError
from orchestration.sweeps.task import Outcome, Task, failed
from orchestration.sweeps.traces import TraceFile, reserve

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
            self._traces = self._open_traces(mode, len(cases), nothing)
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

    def _open_traces(self, mode: str, cases: int, nothing: Outcome) -> TraceFile | None:
        points, outputs = nothing.trace.shape
        return TraceFile(self.folder / _TRACES, mode, (cases, outputs, points)) if nothing.trace.size else None

    def traces(self, output: int, shape: tuple[int, ...]) -> Any:
        """Traces of one output over cases in a shape, and time, which are read when they are used."""
        assert self._traces is not None
        return self._traces.of(output, shape)

    @property
    def left(self) -> list[int]:
        """Cases that are not done."""
        return [int(row) for row in np.flatnonzero(self._done == 0)]

    def write(self, row: int, outcome: Outcome) -> None:
        """Keep what a case left; it is done once its numbers are there."""
        self.numbers[row] = outcome.numbers
        try:
            if self._traces is not None:
                self._traces.write(row, outcome.trace)
            if outcome.failure:
                self.failures[row] = outcome.failure
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
    reserve(path)
    return array


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
        "what is kept": digest(task.outputs, task.keep, "traces by outputs"),
        "the engine": task.engine,
    }


def _check(folder: Path, known: Mapping[str, str], about: Mapping[str, str]) -> None:
    other = [what for what, digest in about.items() if known.get(what) != digest]
    if other:
        raise UserError(f"{folder}: is of another sweep ({', '.join(other)} differ); remove it, or name another --out")
