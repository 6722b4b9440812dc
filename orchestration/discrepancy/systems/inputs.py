"""What a member is fed over a record: measured at the samples, held or linear between them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.systems.cut import InputSource
from orchestration.identify.noise.model import noise_std

Array = NDArray[np.float64]


class MemberInputs:
    """Inputs of a member over a record.

    Parameters
    ----------
    sources : Mapping of str to InputSource
    time : ndarray, shape (n,)
        Seconds.

    Attributes
    ----------
    constant : dict of str to float
        Inputs that stay at a value.
    names : list of str
        Measured inputs.
    columns : ndarray, shape (n, m)
        Their values.
    held : set of str
        Continuous inputs that are held between samples; the others change linearly.
    """

    def __init__(self, sources: Mapping[str, InputSource], time: Array):
        measured = {
            name: source.values for name, source in sources.items() if source.values is not None
        }
        self.constant = {
            name: source.value for name, source in sources.items() if source.value is not None
        }
        self.names = list(measured)
        self.columns = np.column_stack([np.zeros(time.size), *measured.values()])[
            :, 1:
        ]  # there may be none
        self.continuous = [name for name in measured if sources[name].continuous]
        self.held: set[str] = set()
        self._time = time

    @property
    def linear(self) -> list[str]:
        """Inputs that change between samples."""
        return [name for name in self.continuous if name not in self.held]

    @property
    def first(self) -> dict[str, float]:
        """Measured inputs at the first sample."""
        return dict(zip(self.names, self.columns[0].tolist(), strict=True))

    def at_samples(self, thinning: int = 1, noise: np.random.Generator | None = None) -> Array:
        """Values of the measured inputs at the samples.

        Parameters
        ----------
        thinning : int
            Of the samples of inputs that change between them, one in so many is used.
        noise : Generator, optional
            Adds as much noise to continuous inputs as they seem to have.

        Returns
        -------
        ndarray, shape (n, m)
        """
        values = self.columns.copy()
        for i, name in enumerate(self.names):
            if thinning > 1 and name in self.linear:
                values[:, i] = thinned(self._time, values[:, i], thinning)
        for i, name in enumerate(self.names):
            if noise is not None and name in self.continuous:
                values[:, i] += noise_std(values[:, i]) * noise.standard_normal(self._time.size)
        return values

    def changes(self, values: Array) -> Array:
        """By how much inputs (n, m) change on the way from each sample to the next, (n - 1, m); none where held."""
        return np.diff(values, axis=0) * [name in self.linear for name in self.names]


def thinned(time: Array, values: Array, thinning: int) -> Array:
    """One in so many samples, the last one too, and straight lines between them, (n,)."""
    kept = np.unique([*range(0, time.size, thinning), time.size - 1])
    return np.interp(time, time[kept], values[kept])
