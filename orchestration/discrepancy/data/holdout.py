"""Dividing a record into estimation data, which are fitted to, and validation data, which no fit sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.identify.metrics import normalised_rms
from orchestration.records.clock import evenly_sampled

Array = NDArray[np.float64]
HELD_OUT = 1.0 / 3.0  # of a record, its end
_RUN_IN = 1.0 / 6.0  # of a record of its own: there the states at its start are estimated, and nothing is judged


@dataclass(frozen=True)
class ValidationData:
    """Data to judge by, and what a simulation of them begins with.

    Attributes
    ----------
    data : Dataset
        Simulated from its first sample on.
    first : int
        The sample from which on nothing was fitted to.
    continued : bool
        Whether it continues the estimation data, or is a record of its own, whose starting states are estimated on
        the samples before ``first``.
    """

    data: Dataset
    first: int
    continued: bool

    @classmethod
    def split(cls, data: Dataset) -> tuple[Dataset, ValidationData]:
        """Divide a record into estimation and validation data.

        Held out is its end, or where it is sampled unevenly, and no stretch of it is like another, every third sample.
        """
        if evenly_sampled(data.time):
            validation = cls.tail(data)
            return data.part(0, validation.first), validation
        out = np.arange(len(data.time)) % round(1.0 / HELD_OUT) == 1
        fitted, judged = ({o: np.where(which, y, np.nan) for o, y in data.measured.items()} for which in (~out, out))
        return replace(data, measured=fitted), cls(replace(data, measured=judged), 0, True)

    @classmethod
    def tail(cls, data: Dataset) -> ValidationData:
        """Hold out the end of a record, as far as every output was measured."""
        last = min(int(np.flatnonzero(np.isfinite(y))[-1]) for y in data.measured.values())
        return cls(data, round((last + 1) * (1.0 - HELD_OUT)), True)

    @classmethod
    def separate_record(cls, data: Dataset) -> ValidationData:
        """Hold out a record of its own."""
        return cls(data, round(len(data.time) * _RUN_IN), False)

    def nrmse(self, simulated: Mapping[str, Array]) -> dict[str, float]:
        """Normalised RMS error of every output, where nothing was fitted.

        Parameters
        ----------
        simulated : Mapping of str to ndarray, shape (n,)
            Over the whole of the data.
        """
        return {o: normalised_rms(y[self.first :], simulated[o][self.first :]) for o, y in self.data.measured.items()}
