"""Entries of the map of what a model's laws lack: a law over a signal, with the curve that would explain most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fmus.kit.corrections import family
from orchestration.discrepancy.laws.evidence import Basis, Curve
from orchestration.discrepancy.laws.signals import Signal

Array = NDArray[np.float64]
SAME = 1.0 - 1e-6  # correlation of what two corrections do, above which they are one
ALIKE = 0.99  # correlation of what two corrections do, above which a record cannot tell them apart


@dataclass(frozen=True)
class Entry:
    """A correction of a law by a curve of a signal.

    Attributes
    ----------
    driven : str
        Law whose free course it was found along, which does the same to the outputs.
    law : str
    signal : Signal
    kind : {"add", "multiply"}
    basis : Basis
    curve : Curve
    direction : ndarray, shape (m,)
        What it does to the whitened outputs, of unit length.
    step : ndarray, shape (p,)
        Of the model's own searched coordinates, beside the free course.
    visited : ndarray, shape (v,)
        Quantiles of the signal, evenly spaced: where the record has been.
    """

    driven: str
    law: str
    signal: Signal
    kind: str
    basis: Basis
    curve: Curve
    direction: Array
    step: Array
    visited: Array

    @property
    def what(self) -> tuple[str, str, str, str]:
        """Law, signal, memory and kind, whatever the lag, which a fit finds."""
        return self.law, self.signal.name, self.signal.memory, self.kind

    @property
    def family(self) -> str:
        """The same as that of an effect of this law and signal."""
        return family(self.law, self.signal.name, self.signal.memory)

    @property
    def label(self) -> str:
        """For people."""
        return f"{self.law}{' x' if self.kind == 'multiply' else ''} over {self.signal.label}"


def alike(one: Entry, other: Entry) -> bool:
    """Whether a record cannot tell two corrections apart: they do the same to the outputs."""
    return abs(float(one.direction @ other.direction)) >= ALIKE


def same(one: Entry, other: Entry) -> bool:
    """Whether two corrections are one in this record, and not only as far as it is known what they do."""
    return abs(float(one.direction @ other.direction)) >= SAME
