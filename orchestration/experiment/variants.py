"""Variants of an experiment that are kept as they come, so that an interrupted one goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit.arrays import Array
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

Remarked = tuple["ExperimentResult", list[str]]  # with remarks on how it came about
Compute = Callable[[], Remarked]
Restore = Callable[[Mapping[str, Array], float], "ExperimentResult"]  # of signals, and seconds
Keeper = Callable[[Preparation, Compute, Restore], Remarked]


def compute_anew(prepared: Preparation, compute: Compute, restore: Restore) -> Remarked:
    """Return a result where none is kept."""
    return compute()


class _VariantJournal(WorkJournal):
    """Signals of variants, and the remarks on them."""

    def begin(self, mode: str) -> None:
        """Begin or continue the remarks."""
        self._remarks = RowTexts(self, REMARKS, mode)

    def remarks(self, row: int) -> list[str]:
        """Return the remarks on a variant that is done."""
        return [remark for of, remark in self._remarks.pairs if of == row]

    def keep_remarked(self, row: int, numbers: Array, remarks: Sequence[str]) -> None:
        """Keep the numbers of a variant and the remarks on it."""
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
        That this process holds.
    experiment : Experiment
        With its variants.
    """

    def __init__(self, folder: Path, experiment: Experiment):
        self._folder = folder
        self._experiment = experiment

    def find(self, row: int, prepared: Preparation, compute: Compute, restore: Restore) -> Remarked:
        """Return a variant's result and the remarks on it, computed unless the journal has them.

        Raises
        ------
        UserError
            If the folder is of another experiment.
        """
        journal = self._opened(prepared)
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

    def _opened(self, prepared: Preparation) -> _VariantJournal:
        """Return the journal, whose signals are known once a variant is prepared."""
        inputs, noise = prepared.inputs, prepared.noise
        about = {
            "the experiment": digest(self._experiment.model_dump_json(exclude_none=True)),
            "the FMUs": digest(json.dumps(dict(prepared.on.guids), sort_keys=True)),
            "inputs and noise": digest(
                sorted(inputs), *inputs.values(), sorted(noise), *noise.values()
            ),
        }
        width = len(prepared.signals) * prepared.time.size + 1
        shape = (len(self._experiment.variants), width)
        return _VariantJournal(self._folder, "experiment", about, shape)


@contextmanager
def kept_variants(folder: Path | None, experiment: Experiment) -> Iterator[KeptVariants | None]:
    """Hold the folder that keeps variants, if there is one.

    Raises
    ------
    UserError
        If another process works on it, or it holds something else.
    """
    if folder is None:
        yield None
        return
    check(folder)
    with locked_folder(folder):
        yield KeptVariants(folder, experiment)
