"""Misused records: drawn clean, with noise of a data logger, and spoilt."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studies.clean import Case, CleanRecord, draw
from studies.misuse.kinds import KINDS, Columns

_STIMULI = ("square", "multisine", "PRBS")


@dataclass(frozen=True)
class MisuseCase:
    """A record to draw: kind of misuse, plant, stimulus and seed."""

    kind: str
    plant: str
    stimulus: str
    seed: int

    def __str__(self) -> str:
        """Return the case as a line of text."""
        return ", ".join([self.kind, self.plant, self.stimulus, str(self.seed)])


def cases(each: int, seed: int, stimuli: tuple[str, ...] = _STIMULI) -> list[MisuseCase]:
    """Draw so many records of every kind, of different plants where it has several."""
    rng = np.random.default_rng(seed)
    drawn = []
    for number, (name, kind) in enumerate(KINDS.items()):
        plants = rng.permutation(np.array(kind.plants))
        for k in range(each):
            stimulus = stimuli[rng.integers(len(stimuli))]
            own = 100_000 * seed + 100 * number + k
            drawn.append(MisuseCase(name, str(plants[k % len(plants)]), stimulus, own))
    return drawn


def draw_misused(case: MisuseCase) -> tuple[CleanRecord, Columns]:
    """Draw a record; return it as it was, and its columns spoilt."""
    clean = Case(case.plant, case.stimulus, "Gaussian", case.seed)
    right = draw(clean)
    # a square wave is the same in every run, and with it nothing would be spoilt
    stimulus = _STIMULI[_STIMULI.index(case.stimulus) - 1]
    other = draw(replace(clean, stimulus=stimulus, seed=case.seed + 50))
    return right, KINDS[case.kind].spoil(_columns(right), _columns(other))


def _columns(drawn: CleanRecord) -> Columns:
    return Columns(drawn.time, drawn.inputs, drawn.outputs)


def write(drawn: CleanRecord, columns: Columns, path: Path) -> Path:
    """Write a file with the units that the right record has."""
    units = {n: r.unit for n, r in drawn.plant.inputs.items()} | dict(drawn.plant.outputs)
    header = ",".join(f"{n} [{units.get(n, 's')}]" for n in columns.everything)
    table = np.column_stack(list(columns.everything.values()))
    np.savetxt(path, table, "%.9g", ",", header=header, comments="")
    return path
