"""Division of a record into estimation data, which are fitted to, and validation data, held out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fmus.kit.arrays import Array, Mask
from orchestration.discrepancy.data.dataset import PIECE, Dataset
from orchestration.identify import normalised_rms
from orchestration.identify.noise import noise_std

HELD_OUT = 1.0 / 3.0  # of a record, its end
# of a record of its own: there what is its own is estimated, and nothing is judged
_RUN_IN = 1.0 / 6.0
_START = 0.1  # of a record: what nothing drives after it is a free response
# of a record whose end tells little, from the second on every third of which is held out
_BLOCKS = 15
# of how much a signal moves in all of a record, below which it is at rest in a part of it
_STILL = 0.1
_STRETCHES = 10  # of a record with other values of its own
_LEAST_STRETCH = 30  # samples in each


@dataclass(frozen=True)
class ValidationData:
    """Data to judge by, which no fit sees.

    Attributes
    ----------
    data : Dataset
        Simulated from its first sample on.
    judged : ndarray of bool, shape (n,)
        Samples to judge by: nothing was fitted to them.
    continued : bool
        Whether they continue the estimation data, or are records of their own: what is each
        record's own, as its starting states are, is estimated on the samples of it that are not
        judged.
    """

    data: Dataset
    judged: Mask
    continued: bool

    @classmethod
    def split(cls, data: Dataset, each: bool = False) -> tuple[Dataset, ValidationData]:
        """Divide a record into estimation and validation data.

        Of several records the last third is held out. Of one it is its end. Where nothing moves
        there, and where no input moves but at the start, it is every third of blocks spread over
        the record: of what settles the end tells little, and every part tells of something else.
        Where that is sampled unevenly, and no stretch of it is like another, it is every third
        sample. The end of one with gaps begins anew.
        """
        records = list(dict.fromkeys(run.record or run.label for run in data.several))
        if len(records) > 1:
            kept = records[: len(records) - max(1, round(len(records) * HELD_OUT))]
            kept_labels = [run.label for run in data.runs if (run.record or run.label) in kept]
            other = [run.label for run in data.runs if run.label not in kept_labels]
            return data.runs_of(kept_labels), cls.separate_record(data.runs_of(other), each)
        if len(data.several) > 1:
            cut = _end_of_estimation(data)
            return data.part(0, cut), cls.separate_record(data.part(cut, len(data.time)), each)
        number = np.arange(len(data.time))
        if data.even:
            validation = cls.tail(data)
            is_free = not is_driven(data, number > _START * len(number))
            if not (is_free or is_at_rest(data, validation.judged)):
                return data.part(0, validation.first), validation
            number = number * _BLOCKS // len(number)
        out = number % round(1.0 / HELD_OUT) == 1
        estimation = replace(data, measured=_only_at(data.measured, ~out))
        validation_data = replace(data, measured=_only_at(data.measured, out))
        return estimation, cls(validation_data, np.ones(len(out), dtype=bool), True)

    @classmethod
    def tail(cls, data: Dataset) -> ValidationData:
        """Hold out the end of a record, as far as every output was measured."""
        last = min(int(np.flatnonzero(np.isfinite(y))[-1]) for y in data.measured.values())
        return cls(data, np.arange(len(data.time)) >= round((last + 1) * (1.0 - HELD_OUT)), True)

    @classmethod
    def separate_record(cls, data: Dataset, each: bool = False) -> ValidationData:
        """Hold out records of their own.

        Where a record starts is known from its first sixth. What else differs from record to
        record, where anything does (``each``), may show itself anywhere in it, so then the first
        sixth of every tenth of it is used for both.
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
        """The data to the last sample that is not judged, for estimates of each record's own."""
        fitted = self.data.within & ~self.judged
        reached = np.zeros(len(fitted), dtype=bool)
        for run in self.data.runs:
            last = run.first + int(np.flatnonzero(fitted[run.samples])[-1])
            reached[run.first : last + 1] = True
        measured = _only_at(self.data.measured, fitted)
        return replace(self.data, measured=measured).where(reached)

    @property
    def held_out(self) -> Mask:
        """Mask of all samples held out, also of those that show where a record starts."""
        return self.judged if self.continued else self.data.within

    def nrmse(self, simulated: Mapping[str, Array], part: slice = slice(None)) -> dict[str, float]:
        """Return the error of every output where nothing was fitted, over its spread.

        The spread is that of the signal in all that was held out, also in samples of a record that
        show where it starts.

        Parameters
        ----------
        simulated : Mapping of str to ndarray, shape (n,)
            Over the whole of the data.
        part : slice
            Of the data that is looked at, such as one run; all by default.
        """
        at = self.held_out[part]
        counted = self.judged[part][at]
        return {
            o: normalised_rms(y[part][at], simulated[o][part][at], counted)
            for o, y in self.data.measured.items()
        }


def is_driven(data: Dataset, part: Mask) -> bool:
    """Return True if any input moves in a part of a record, beside how it moves in all of it."""
    moving = [v for v in data.inputs.values() if np.ptp(v[data.within]) > 0.0]
    return any(np.std(v[part]) >= _STILL * np.std(v[data.within]) for v in moving)


def is_at_rest(data: Dataset, part: Mask) -> bool:
    """Return True if no input moves in a part of a record, and no output by more than its noise."""
    if is_driven(data, part):
        return False
    ratios = []
    for y in data.measured.values():
        values = y[part & np.isfinite(y)]
        variance = 0.0  # beyond that of the noise
        if values.size:
            variance = max(float(np.var(values)) - noise_std(values, 3) ** 2, 0.0)
        whole = float(np.nanvar(y))
        ratios.append((variance / whole) ** 0.5 if whole > 0.0 else 0.0)
    return max(ratios) < _STILL


def _only_at(measured: Mapping[str, Array], mask: Mask) -> dict[str, Array]:
    """Return outputs with gaps everywhere but at some samples."""
    return {o: np.where(mask, y, np.nan) for o, y in measured.items()}


def _end_of_estimation(data: Dataset) -> int:
    """Return the first sample of the last third of a record with gaps.

    Where that would leave too little of what is between two gaps, the cut is at the gap.
    """
    remaining = round(sum(run.last - run.first for run in data.runs) * (1.0 - HELD_OUT))
    for run in data.runs:
        count = run.last - run.first
        if remaining < count:
            break
        remaining -= count
    if remaining < PIECE and run is not data.runs[0]:
        return run.first
    if count - remaining < PIECE and run is not data.runs[-1]:
        return run.last
    return run.first + remaining
