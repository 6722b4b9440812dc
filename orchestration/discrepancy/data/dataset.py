"""A measured record as every step of the diagnosis takes it: estimation data and validation data are such datasets."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Dataset:
    """Inputs and measured outputs over time, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs, measured : Mapping of str to ndarray, shape (n,)
        NaN in an output is a gap.
    linear : bool or collection of str, optional
        Inputs that go linearly from sample to sample, all or those named; others are held until the next. None leaves
        it to the diagnosis.
    """

    time: Array
    inputs: Mapping[str, Array]
    measured: Mapping[str, Array]
    linear: bool | Collection[str] | None = None

    def only(self, outputs: Sequence[str]) -> Dataset:
        """Some of the outputs."""
        return replace(self, measured={o: y for o, y in self.measured.items() if o in outputs})

    def part(self, first: int, last: int) -> Dataset:
        """Samples from one to before another."""
        return self.where(slice(first, last))

    def where(self, cut: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Dataset:
        """Some of the samples."""
        inputs, measured = ({n: v[cut] for n, v in group.items()} for group in (self.inputs, self.measured))
        return replace(self, time=self.time[cut], inputs=inputs, measured=measured)
