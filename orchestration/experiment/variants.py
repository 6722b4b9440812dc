"""Variants of an experiment that are kept as they come, so that an interrupted one goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit.arrays import Array
from orchestration.experiment.model import Experiment
from orchestration.experiment.preparation import Preparation
from orchestration.journal import WorkJournal, check, digest, locked_folder

if TYPE_CHECKING:
    from orchestration.experiment.results import ExperimentResult

Compute = Callable[[], "ExperimentResult"]
Restore = Callable[[Mapping[str, Array], float], "ExperimentResult"]  # of signals, and seconds
Keeper = Callable[[Preparation, Compute, Restore], "ExperimentResult"]


def compute_anew(prepared: Preparation, compute: Compute, restore: Restore) -> ExperimentResult:
    """Return a result where none is kept."""
    return compute()


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

    def find(
        self, row: int, prepared: Preparation, compute: Compute, restore: Restore
    ) -> ExperimentResult:
        """Return the result of a variant, which is computed unless the journal has it.

        Raises
        ------
        UserError
            If the folder is of another experiment.
        """
        journal = self._opened(prepared)
        if journal.is_done(row):
            *signals, seconds = np.array(journal.numbers[row])
            values = np.reshape(signals, (len(prepared.signals), -1))
            return restore(dict(zip(prepared.signals, values, strict=True)), float(seconds))
        result = compute()
        if result.attrs["complete"]:
            signals = [result[name].values for name in prepared.signals]
            journal.keep(row, np.concatenate([*signals, [result.attrs["wall_time"]]]))
        return result

    def _opened(self, prepared: Preparation) -> WorkJournal:
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
        return WorkJournal(self._folder, "experiment", about, shape)


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
