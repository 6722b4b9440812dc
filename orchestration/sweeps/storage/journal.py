"""Journal of a sweep in a folder: its outcomes as they come, so that an interrupted sweep goes on.

One process at a time works on a folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from fmus.kit import UserError, files
from fmus.kit.arrays import Array
from orchestration.reporting import option
from orchestration.sweeps.storage.traces import TraceFile, opened, reserve
from orchestration.sweeps.task import Outcomes, Task, failed

_ABOUT = "sweep.json"
_DONE = "done.npy"
_NUMBERS = "numbers.npy"
_TRACES = "traces.npy"
_FAILURES = "failures.jsonl"
_LOCK = "lock"
_KNOWN = (_ABOUT, _DONE, _NUMBERS, _TRACES, _FAILURES, _LOCK)


@contextlib.contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Lock a folder for this process while the context lasts; it is made if it does not exist.

    The operating system holds the lock, which therefore ends with the process, however that ends.

    Raises
    ------
    UserError
        If another process has it, or it cannot be written.
    """
    path = folder.absolute() / _LOCK
    lock = FileLock(path, timeout=0)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except FileExistsError as error:
        raise UserError(f"{folder}: is no folder") from error
    except Timeout as error:
        raise UserError(
            f"{folder}: another process works on it ({_owner(path) or 'just begun'}); wait for it"
        ) from error
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror or error})") from error
    had_journal = (folder / _ABOUT).exists()
    with contextlib.suppress(OSError):  # for that message alone
        path.write_text(f"{os.getpid()}\n", encoding="ascii")
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # Windows removes it when it is released
            path.unlink()
        lock.release()
        if had_journal:  # where the lock was still in the folder, `remove` could not remove that
            with contextlib.suppress(OSError):
                path.parent.rmdir()


def _owner(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return ""


def check(folder: Path) -> None:
    """Refuse a folder that holds anything else than a journal, which is removed at the end.

    Raises
    ------
    UserError
        About the first thing that does not belong to a journal.
    """
    try:
        strange = next((path for path in _within(folder) if not _own(path)), None)
    except OSError as error:
        raise UserError(f"{folder}: cannot be read ({error.strerror})") from error
    if strange is not None:
        raise UserError(
            f"{folder}: holds {strange.name}, which is not of a sweep, and what a sweep has done"
            f" goes there: move that elsewhere, or name another {option('folder')}"
        )


def remove(folder: Path) -> None:
    """Remove a journal and nothing else, and its folder if that is empty then."""
    with contextlib.suppress(OSError):
        for path in _within(folder):
            if _own(path):
                with contextlib.suppress(OSError):  # Windows keeps the lock until it is released
                    path.unlink()
        folder.rmdir()


def _within(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []


def _own(path: Path) -> bool:
    """Return True if a path is a file of a journal, or one that was not written to its end."""
    is_part = path.name.endswith(".part") and any(
        path.name.startswith(f"{known}.") for known in _KNOWN
    )
    return (path.name in _KNOWN or is_part) and path.is_file() and not path.is_symlink()


class SweepJournal:
    """Outcomes of all cases of a sweep, in a folder.

    Arrays have their whole size from the start.

    Parameters
    ----------
    folder : Path
        An existing one, which this process holds; the journal of the same sweep is continued.
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
        self.folder = folder
        self._task = task
        about = _about(task, cases, guid)
        nothing = failed(task, "")
        mode = ""
        try:
            if (folder / _ABOUT).exists():
                _refuse_other_sweep(
                    folder, json.loads((folder / _ABOUT).read_text(encoding="utf-8")), about
                )
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
                for name in (_DONE, _NUMBERS, _TRACES):  # they take room that there is not
                    (folder / name).unlink(missing_ok=True)
            raise UserError(f"{folder}: cannot be written ({error.strerror or error})") from error
        except (ValueError, TypeError, RecursionError) as error:
            raise UserError(f"{folder}: is damaged ({error}); remove it to begin anew") from error

    def _open_traces(self, mode: str, cases: int, nothing: Outcomes) -> TraceFile | None:
        if not nothing.traces.size:
            return None
        _, points, outputs = nothing.traces.shape
        return TraceFile(self.folder / _TRACES, mode, (cases, outputs, points))

    def traces(self, output: int, shape: tuple[int, ...]) -> Any:
        """Return traces of one output, over cases in a shape and time; they are read when used."""
        assert self._traces is not None
        return self._traces.traces(output, shape)

    @property
    def open_cases(self) -> list[int]:
        """Rows of the cases that are not done."""
        return [int(row) for row in np.flatnonzero(self._done == 0)]

    def write(self, rows: Sequence[int], outcomes: Outcomes) -> None:
        """Keep the outcomes of cases, which then count as done."""
        self.numbers[[*rows]] = outcomes.numbers
        try:
            if self._traces is not None:
                self._traces.write(rows, outcomes.traces)
            if outcomes.failures:
                failures = {rows[place]: why for place, why in outcomes.failures.items()}
                self.failures.update(failures)
                with (self.folder / _FAILURES).open("a", encoding="utf-8") as file:
                    file.writelines(_lines(failures))
        except OSError as error:
            raise UserError(
                f"{self.folder}: cannot be written ({error.strerror}); what is done stands there to"
                " go on with"
            ) from error
        self._done[[*rows]] = 1


def _failures(path: Path, done: Array) -> dict[int, str]:
    """Return the reasons of failed cases by row.

    Reasons of cases that are not done are removed from the file, as is an unfinished last line.
    """
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    lines = text[: text.rfind("\n") + 1].splitlines()
    reasons = [(int(row), str(reason)) for row, reason in map(json.loads, lines)]
    if any(not 0 <= row < len(done) for row, _ in reasons):
        raise ValueError(f"{path.name} is of another number of cases")
    kept = {row: reason for row, reason in reasons if done[row]}
    whole = "".join(_lines(kept))
    if whole != text:
        files.write(path, whole.encode())
    return kept


def _lines(failures: Mapping[int, str]) -> list[str]:
    return [json.dumps([row, reason]) + "\n" for row, reason in failures.items()]


def _array(path: Path, mode: str, shape: tuple[int, ...], kind: str) -> Array:
    """Map an array on disk, made anew with mode w+."""
    if 0 in shape:
        return np.empty(shape, kind)
    if mode == "r+":
        return opened(path, "r+", shape, kind)
    array = np.lib.format.open_memmap(path, "w+", np.dtype(kind), shape)
    reserve(path)
    return array


def _about(task: Task, cases: Array, guid: str) -> dict[str, str]:
    """Return digests of the parts that define a sweep."""

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


def _refuse_other_sweep(folder: Path, stored: Any, digests: Mapping[str, str]) -> None:
    """Refuse a folder whose stored digests are of another sweep.

    Raises
    ------
    ValueError
        If what is stored cannot be understood: the journal is damaged.
    UserError
        If it is of another sweep.
    """
    if not isinstance(stored, dict):
        raise ValueError(f"{_ABOUT} holds no table")
    other = [part for part, digest in digests.items() if stored.get(part) != digest]
    if other:
        raise UserError(
            f"{folder}: is of another sweep ({', '.join(other)} differ); remove it, or name another"
            f" {option('folder')}"
        )
