"""Dividing a record into estimation data, which are fitted to, and validation data, which no fit sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.data.dataset import PIECE, Dataset
from orchestration.identify.metrics import normalised_rms
from orchestration.identify.noise.model import noise_std

Array = NDArray[np.float64]
HELD_OUT = 1.0 / 3.0  # of a record, its end
_RUN_IN = (
    1.0 / 6.0
)  # of a record of its own: there what is its own is estimated, and nothing is judged
_BLOCKS = (
    15  # of a record whose end is at rest, from the second on every third of which is held out
)
_STILL = (
    0.1  # of how much a signal moves in all of a record, below which it is at rest in a part of it
)
_STRETCHES, _LEAST_STRETCH = 10, 30  # of a record with other values of its own; samples in each


@dataclass(frozen=True)
class ValidationData:
    """Data to judge by, and what a simulation of them begins with.

    Attributes
    ----------
    data : Dataset
        Simulated from its first sample on.
    judged : ndarray of bool, shape (n,)
        Samples to judge by: nothing was fitted to them.
    continued : bool
        Whether they continue the estimation data, or are records of their own: what is each record's own, as its
        starting states are, is estimated on the samples of it that are not judged.
    """

    data: Dataset
    judged: NDArray[np.bool_]
    continued: bool

    @classmethod
    def split(cls, data: Dataset, each: bool = False) -> tuple[Dataset, ValidationData]:
        """Divide a record into estimation and validation data.

        Of several records the last third is held out. Of one it is its end; where nothing moves there, which tells
        nothing of any effect, it is every third of blocks spread over the record; and where that is sampled unevenly,
        and no stretch of it is like another, every third sample. The end of one with gaps begins anew.
        """
        records = list(dict.fromkeys(run.record or run.label for run in data.several))
        if len(records) > 1:
            kept = records[: len(records) - max(1, round(len(records) * HELD_OUT))]
            kept_labels = [run.label for run in data.runs if (run.record or run.label) in kept]
            other = [run.label for run in data.runs if run.label not in kept_labels]
            return data.runs_of(kept_labels), cls.separate_record(data.runs_of(other), each)
        if len(data.several) > 1:
            cut = _cut(data)
            return data.part(0, cut), cls.separate_record(data.part(cut, len(data.time)), each)
        number = np.arange(len(data.time))
        if data.even:
            validation = cls.tail(data)
            if not is_at_rest(data, validation.judged):
                return data.part(0, validation.first), validation
            number = number * _BLOCKS // len(number)
        out = number % round(1.0 / HELD_OUT) == 1
        fitted, judged = (
            {o: np.where(which, y, np.nan) for o, y in data.measured.items()}
            for which in (~out, out)
        )
        return replace(data, measured=fitted), cls(
            replace(data, measured=judged), np.ones(len(out), dtype=bool), True
        )

    @classmethod
    def tail(cls, data: Dataset) -> ValidationData:
        """Hold out the end of a record, as far as every output was measured."""
        last = min(int(np.flatnonzero(np.isfinite(y))[-1]) for y in data.measured.values())
        return cls(data, np.arange(len(data.time)) >= round((last + 1) * (1.0 - HELD_OUT)), True)

    @classmethod
    def separate_record(cls, data: Dataset, each: bool = False) -> ValidationData:
        """Hold out records of their own.

        Where a record starts is known from its first sixth. What else differs from record to record, where anything
        does (``each``), may show itself anywhere in it, so then the first sixth of every tenth of it tells both.
        """
        judged = np.zeros(len(data.time), dtype=bool)
        for run in data.runs:
            count = run.last - run.first
            stretch = max(count / _STRETCHES, _LEAST_STRETCH) if each else count
            place = np.arange(count) % stretch
            judged[run.samples] = place >= round(stretch * _RUN_IN)
        return cls(data, judged, False)

    @property
    def first(self) -> int:
        """The first sample that is judged."""
        return int(np.argmax(self.judged))

    @property
    def run_in(self) -> Dataset:
        """The data as far as what is each record's own is estimated on them: to the last sample that is not judged."""
        fitted = self.data.within & ~self.judged
        measured = {o: np.where(fitted, y, np.nan) for o, y in self.data.measured.items()}
        reached = np.zeros(len(fitted), dtype=bool)
        for run in self.data.runs:
            reached[run.first : run.first + 1 + int(np.flatnonzero(fitted[run.samples])[-1])] = True
        return replace(self.data, measured=measured).where(reached)

    @property
    def held_out(self) -> NDArray[np.bool_]:
        """Samples of what was held out: of a record of its own also those that tell where it starts."""
        return self.judged if self.continued else self.data.within

    def nrmse(self, simulated: Mapping[str, Array], part: slice = slice(None)) -> dict[str, float]:
        """Error of every output where nothing was fitted, over the spread of what was held out.

        The spread is the signal's, whatever is taken of a record to tell where it starts.

        Parameters
        ----------
        simulated : Mapping of str to ndarray, shape (n,)
            Over the whole of the data.
        part : slice
            Of the data that is looked at, such as one run; all by default.
        """
        at, counted = self.held_out[part], self.judged[part][self.held_out[part]]
        return {
            o: normalised_rms(y[part][at], simulated[o][part][at], counted)
            for o, y in self.data.measured.items()
        }


def is_at_rest(data: Dataset, part: NDArray[np.bool_]) -> bool:
    """Whether nothing moves in a part of a record: no input, and no output by more than its noise there.

    An input that does not move in the record tells nothing of rest.
    """
    moving = [v for v in data.inputs.values() if np.ptp(v[data.within]) > 0.0]
    ratios = [float(np.std(v[part]) / np.std(v[data.within])) for v in moving]
    for y in data.measured.values():
        there, everywhere = y[part & np.isfinite(y)], float(np.nanvar(y))
        moves = max(float(np.var(there)) - noise_std(there, 3) ** 2, 0.0) if there.size else 0.0
        ratios.append((moves / everywhere) ** 0.5 if everywhere > 0.0 else 0.0)
    return max(ratios) < _STILL


def _cut(data: Dataset) -> int:
    """First sample of the last third of a record with gaps, or of what is between two gaps where too little is left."""
    left = round(sum(run.last - run.first for run in data.runs) * (1.0 - HELD_OUT))
    for run in data.runs:
        count = run.last - run.first
        if left < count:
            break
        left -= count
    if left < PIECE and run is not data.runs[0]:
        return run.first
    return run.last if count - left < PIECE and run is not data.runs[-1] else run.first + left
