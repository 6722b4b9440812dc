"""Journal of the finished variants of an experiment, with which an interrupted one is resumed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
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


class KeptVariants:
    """Results of the variants of an experiment, in a journal.

    Parameters
    ----------
    folder : Path
        Folder of the journal, locked by this process.
    experiment : Experiment
        Experiment with variants.
    """

    def __init__(self, folder: Path, experiment: Experiment):
        self._folder = folder
        self._experiment = experiment

    def find(self, row: int, prepared: Preparation, compute: Compute, restore: Restore) -> Remarked:
        """Return the result of a variant and the remarks on it, from the journal or computed.

        Raises
        ------
        UserError
            If the journal is of another experiment.
        """
        journal = self._open_journal(prepared)
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

    def _open_journal(self, prepared: Preparation) -> _VariantJournal:
        """Open the journal; its width is known when a variant is prepared."""
        inputs, noise = prepared.inputs, prepared.noise
        about = {
            "the experiment": digest(self._experiment.model_dump_json(exclude_none=True)),
            "the FMUs": digest(json.dumps(dict(prepared.subject.guids), sort_keys=True)),
            "inputs and noise": digest(
                sorted(inputs), *inputs.values(), sorted(noise), *noise.values()
            ),
        }
        width = len(prepared.signals) * prepared.time.size + 1
        shape = (len(self._experiment.variants), width)
        return _VariantJournal(self._folder, "experiment", about, shape)


@contextmanager
def kept_variants(folder: Path | None, experiment: Experiment) -> Iterator[KeptVariants | None]:
    """Lock the folder of a journal and yield its results; None without a folder.

    Raises
    ------
    UserError
        If another process uses the folder, or it has other files.
    """
    if folder is None:
        yield None
        return
    check(folder)
    with locked_folder(folder):
        yield KeptVariants(folder, experiment)
