"""Journal of the finished variants of an experiment, with which an interrupted one is resumed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit.arrays import Array, Signals
from orchestration.experiment.model import Experiment
from orchestration.experiment.preparation import Preparation
from orchestration.journal import (
    REMARKS,
    RowTexts,
    WorkJournal,
    check,
    digest,
    locked_folder,
    no_longer_writable,
)

if TYPE_CHECKING:
    from orchestration.experiment.results import ExperimentResult

Remarked = tuple["ExperimentResult", list[str]]  # with remarks on the run
Compute = Callable[[], Remarked]
Restore = Callable[[Signals, float], "ExperimentResult"]  # from signals and wall time
Obtain = Callable[[Preparation, Compute, Restore], Remarked]


def compute_anew(prepared: Preparation, compute: Compute, restore: Restore) -> Remarked:
    """Return the result of `compute`: the `Obtain` without a journal."""
    return compute()


class _VariantJournal(WorkJournal):
    """Journal with the signals of each variant and the remarks on it."""

    def begin(self, mode: str) -> None:
        """Open the file of remarks, in a mode of `open`."""
        self._remarks = RowTexts(self, REMARKS, mode)

    def remarks(self, row: int) -> list[str]:
        """Return the remarks on a finished variant."""
        return [remark for other, remark in self._remarks.pairs if other == row]

    def keep_remarked(self, row: int, numbers: Array, remarks: Sequence[str]) -> None:
        """Write the numbers of a variant and the remarks on it."""
        try:
            self._remarks.append([(row, remark) for remark in remarks])
        except OSError as error:
            raise no_longer_writable(self.folder, error) from error
        self.keep(row, numbers)


def _find(
    folder: Path,
    experiment: Experiment,
    row: int,
    prepared: Preparation,
    compute: Compute,
    restore: Restore,
) -> Remarked:
    """Return the result of a variant and the remarks on it, from the journal or computed."""
    journal = _open_journal(folder, experiment, prepared)
    if journal.is_done(row):
        *signals, seconds = np.array(journal.numbers[row])
        values = np.reshape(signals, (len(prepared.signals), -1))
        result = restore(dict(zip(prepared.signals, values, strict=True)), float(seconds))
        return result, journal.remarks(row)
    result, remarks = compute()
    if result.attrs["complete"]:
        signals = [result[name].values for name in prepared.signals]
        numbers = np.concatenate([*signals, [result.attrs["wall_time"]]])
        journal.keep_remarked(row, numbers, remarks)
    return result, remarks


def _open_journal(folder: Path, experiment: Experiment, prepared: Preparation) -> _VariantJournal:
    """Open the journal; its width is known when a variant is prepared."""
    inputs, noise = prepared.inputs, prepared.noise
    about = {
        "the experiment": digest(experiment.model_dump_json(exclude_none=True)),
        "the FMUs": digest(json.dumps(dict(prepared.subject.guids), sort_keys=True)),
        "inputs and noise": digest(
            sorted(inputs), *inputs.values(), sorted(noise), *noise.values()
        ),
    }
    width = len(prepared.signals) * prepared.time.size + 1
    return _VariantJournal(folder, "experiment", about, (len(experiment.variants), width))


@contextmanager
def kept_variants(folder: Path | None, experiment: Experiment) -> Iterator[Callable[[int], Obtain]]:
    """Lock the folder of a journal, and yield the `Obtain` of each variant, by its number.

    Without a folder all are computed. It raises UserError if the journal is of another experiment.

    Raises
    ------
    UserError
        If another process uses the folder, or it has other files.
    """
    if folder is None:
        yield lambda row: compute_anew
        return
    check(folder)
    with locked_folder(folder):
        yield lambda row: partial(_find, folder, experiment, row)
