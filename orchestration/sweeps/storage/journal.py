"""What a sweep has done so far, on disk: numbers as they come, so that an interrupted one goes on."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import files
from fmus.kit.errors import UserError
from orchestration.sweeps.storage import lock
from orchestration.sweeps.storage.traces import TraceFile, opened, reserve
from orchestration.sweeps.task import Outcomes, Task, failed

Array = NDArray[np.float64]
_ABOUT, _DONE, _NUMBERS, _TRACES, _FAILURES = (
    "sweep.json",
    "done.npy",
    "numbers.npy",
    "traces.npy",
    "failures.jsonl",
)
_KNOWN = (_ABOUT, _DONE, _NUMBERS, _TRACES, _FAILURES, lock.NAME)


def check(folder: Path) -> None:
    """Refuse a folder that holds anything else than a journal: it would be in the way of what is removed at the end.

    Raises
    ------
    UserError
        Names the first thing that is none of a journal.
    """
    try:
        strange = next((path for path in _within(folder) if not _own(path)), None)
    except OSError as error:
        raise UserError(f"{folder}: cannot be read ({error.strerror})") from error
    if strange is not None:
        raise UserError(
            f"{folder}: holds {strange.name}, which is not of a sweep, and what a sweep has done goes there: "
            "move that elsewhere, or name another --out"
        )


def remove(folder: Path) -> None:
    """Remove a journal and nothing else, and its folder if nothing is left in it."""
    with contextlib.suppress(OSError):
        for path in _within(folder):
            if _own(path):
                path.unlink(missing_ok=True)
        folder.rmdir()


def _within(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []


def _own(path: Path) -> bool:
    """Whether something is a file of a journal, or what was left of one that was not written to its end."""
    parts = path.name.endswith(".part") and any(
        path.name.startswith(f"{known}.") for known in _KNOWN
    )
    return (path.name in _KNOWN or parts) and path.is_file() and not path.is_symlink()


class Journal:
    """Outcomes of all cases of a sweep in a folder; arrays there are as large as all of them from the start.

    Parameters
    ----------
    folder : Path
        There already, and `lock.held`; of a sweep that is the same it is gone on with.
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
                (folder / _FAILURES).unlink(missing_ok=True)
                mode = "w+"
            self._done = _array(folder / _DONE, mode, (len(cases),), "u1")
            self.numbers = _array(
                folder / _NUMBERS, mode, (len(cases), *nothing.numbers.shape[1:]), "f8"
            )
            self._traces = self._open_traces(mode, len(cases), nothing)
            if mode == "w+":  # last: a folder without it is begun anew
                files.write(folder / _ABOUT, json.dumps(about).encode())
            self.failures = _failures(folder / _FAILURES, self._done)
        except OSError as error:
            if mode == "w+":
                for name in (
                    _DONE,
                    _NUMBERS,
                    _TRACES,
                ):  # what has no room is not left in the way of others
                    (folder / name).unlink(missing_ok=True)
            raise UserError(f"{folder}: cannot be written ({error.strerror or error})") from error
        except (ValueError, TypeError, RecursionError) as error:
            raise UserError(f"{folder}: is damaged ({error}); remove it to begin anew") from error

    def _open_traces(self, mode: str, cases: int, nothing: Outcomes) -> TraceFile | None:
        _, points, outputs = nothing.traces.shape
        return (
            TraceFile(self.folder / _TRACES, mode, (cases, outputs, points))
            if nothing.traces.size
            else None
        )

    def traces(self, output: int, shape: tuple[int, ...]) -> Any:
        """Traces of one output over cases in a shape, and time, which are read when they are used."""
        assert self._traces is not None
        return self._traces.of(output, shape)

    @property
    def left(self) -> list[int]:
        """Cases that are not done."""
        return [int(row) for row in np.flatnonzero(self._done == 0)]

    def write(self, rows: Sequence[int], found: Outcomes) -> None:
        """Keep what cases left; they are done once their numbers are there."""
        self.numbers[[*rows]] = found.numbers
        try:
            if self._traces is not None:
                self._traces.write(rows, found.traces)
            if found.failures:
                told = {rows[place]: reason for place, reason in found.failures.items()}
                self.failures.update(told)
                with (self.folder / _FAILURES).open("a", encoding="utf-8") as file:
                    file.writelines(
                        json.dumps([row, reason]) + "\n" for row, reason in told.items()
                    )
        except OSError as error:
            raise UserError(
                f"{self.folder}: cannot be written ({error.strerror}); what is done stands there to go on with"
            ) from error
        self._done[[*rows]] = 1


def _failures(path: Path, done: Array) -> dict[int, str]:
    """Why cases left nothing; of a case that is not done, as in a line that was not written to its end, it goes."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    lines = text[: text.rfind("\n") + 1].splitlines()
    told = [(int(row), str(reason)) for row, reason in map(json.loads, lines)]
    if any(not 0 <= row < len(done) for row, _ in told):
        raise ValueError(f"{path.name} is of another number of cases")
    kept = {row: reason for row, reason in told if done[row]}
    whole = "".join(json.dumps([row, reason]) + "\n" for row, reason in kept.items())
    if whole != text:
        files.write(path, whole.encode())
    return kept


def _array(path: Path, mode: str, shape: tuple[int, ...], kind: str) -> Array:
    if 0 in shape:
        return np.empty(shape, kind)
    if mode == "r+":
        return opened(path, "r+", shape, kind)
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


def _check(folder: Path, known: Any, about: Mapping[str, str]) -> None:
    if not isinstance(known, dict):
        raise ValueError(f"{_ABOUT} holds no table")
    other = [what for what, digest in about.items() if known.get(what) != digest]
    if other:
        raise UserError(
            f"{folder}: is of another sweep ({', '.join(other)} differ); remove it, or name another --out"
        )
