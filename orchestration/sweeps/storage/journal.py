"""Journal of a sweep: numbers, traces and failures of its cases."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fmus.kit.arrays import Array
from orchestration.journal import (
    FAILURES,
    TRACES,
    RowTexts,
    WorkJournal,
    digest,
    no_longer_writable,
)
from orchestration.sweeps.storage.traces import TraceFile
from orchestration.sweeps.task import Outcomes, Task, failed_case


class SweepJournal(WorkJournal):
    """Outcomes of all cases of a sweep, in a folder.

    Parameters
    ----------
    folder : Path
        An existing folder that this process has locked; a journal of the same sweep is continued.
    task : Task
    cases : ndarray, shape (n, p)
    guid : str
        GUID of the FMU.

    Raises
    ------
    UserError
        If the folder belongs to another sweep, or cannot be written.
    """

    def __init__(self, folder: Path, task: Task, cases: Array, guid: str):
        self._cases = len(cases)
        self._blank = failed_case(task, "")
        self._traces: TraceFile | None = None
        numbers = self._blank.numbers.shape[1:]
        super().__init__(folder, "sweep", _about(task, cases, guid), (len(cases), *numbers))

    def begin(self, mode: str) -> None:
        """Open the files of traces and failures, new ones or those of the same sweep."""
        if self._blank.traces.size:
            _, points, outputs = self._blank.traces.shape
            shape = (self._cases, outputs, points)
            self._traces = TraceFile(self.folder / TRACES, mode, shape)
        self._failures = RowTexts(self, FAILURES, mode)

    @property
    def failures(self) -> dict[int, str]:
        """Reasons of failed cases by row."""
        return dict(self._failures.pairs)

    def traces(self, output: int, shape: tuple[int, ...]) -> Any:
        """Return the traces of one output, shape (*shape, n), which are read lazily."""
        assert self._traces is not None
        return self._traces.traces(output, shape)

    def write(self, rows: Sequence[int], outcomes: Outcomes) -> None:
        """Write the outcomes of cases, which then count as finished."""
        try:
            if self._traces is not None:
                self._traces.write(rows, outcomes.traces)
            self._failures.append([(rows[k], why) for k, why in outcomes.failures.items()])
        except OSError as error:
            raise no_longer_writable(self.folder, error) from error
        self.keep([*rows], outcomes.numbers)


def _about(task: Task, cases: Array, guid: str) -> dict[str, str]:
    """Return digests of the parts that define a sweep, by name."""
    return {
        "the FMU": guid,
        "the cases": digest(task.names, cases),
        "settings and inputs": digest(
            sorted(task.settings.items()), task.time, sorted(task.inputs), *task.inputs.values()
        ),
        "what is kept": digest(task.outputs, task.keep, "traces by outputs"),
        "the engine": task.engine,
    }
