"""Journal of a sweep: numbers, traces and failures of its cases."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fmus.kit import UserError, files
from fmus.kit.arrays import Array
from orchestration.journal import FAILURES, TRACES, WorkJournal, digest
from orchestration.sweeps.storage.traces import TraceFile
from orchestration.sweeps.task import Outcomes, Task, failed


class SweepJournal(WorkJournal):
    """Outcomes of all cases of a sweep, in a folder.

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

    failures: dict[int, str]

    def __init__(self, folder: Path, task: Task, cases: Array, guid: str):
        self._cases = len(cases)
        self._nothing = failed(task, "")
        self._traces: TraceFile | None = None
        numbers = self._nothing.numbers.shape[1:]
        super().__init__(folder, "sweep", _about(task, cases, guid), (len(cases), *numbers))

    def begin(self, mode: str) -> None:
        """Begin or continue traces and failures."""
        if mode == "w+":
            (self.folder / FAILURES).unlink(missing_ok=True)
        if self._nothing.traces.size:
            _, points, outputs = self._nothing.traces.shape
            shape = (self._cases, outputs, points)
            self._traces = TraceFile(self.folder / TRACES, mode, shape)
        self.failures = self._read_failures()

    def traces(self, output: int, shape: tuple[int, ...]) -> Any:
        """Return traces of one output, over cases in a shape and time; they are read when used."""
        assert self._traces is not None
        return self._traces.traces(output, shape)

    def write(self, rows: Sequence[int], outcomes: Outcomes) -> None:
        """Keep the outcomes of cases, which then count as done."""
        try:
            if self._traces is not None:
                self._traces.write(rows, outcomes.traces)
            if outcomes.failures:
                failures = {rows[place]: why for place, why in outcomes.failures.items()}
                self.failures.update(failures)
                with (self.folder / FAILURES).open("a", encoding="utf-8") as file:
                    file.writelines(_lines(failures))
        except OSError as error:
            raise UserError(
                f"{self.folder}: cannot be written ({error.strerror}); what is done stands there to"
                " go on with"
            ) from error
        self.keep([*rows], outcomes.numbers)

    def _read_failures(self) -> dict[int, str]:
        """Return the reasons of failed cases by row.

        Reasons of cases that are not done are removed from the file, as is an unfinished last line.
        """
        path = self.folder / FAILURES
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        lines = text[: text.rfind("\n") + 1].splitlines()
        reasons = [(int(row), str(reason)) for row, reason in map(json.loads, lines)]
        if any(not 0 <= row < self._cases for row, _ in reasons):
            raise ValueError(f"{path.name} is of another number of cases")
        kept = {row: reason for row, reason in reasons if self.is_done(row)}
        whole = "".join(_lines(kept))
        if whole != text:
            files.write(path, whole.encode())
        return kept


def _lines(failures: Mapping[int, str]) -> list[str]:
    return [json.dumps([row, reason]) + "\n" for row, reason in failures.items()]


def _about(task: Task, cases: Array, guid: str) -> dict[str, str]:
    """Return digests of the parts that define a sweep."""
    return {
        "the FMU": guid,
        "the cases": digest(task.names, cases),
        "settings and inputs": digest(
            sorted(task.settings.items()), task.time, sorted(task.inputs), *task.inputs.values()
        ),
        "what is kept": digest(task.outputs, task.keep, "traces by outputs"),
        "the engine": task.engine,
    }
