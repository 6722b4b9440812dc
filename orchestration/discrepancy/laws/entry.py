"""Entries of the law map: a law over a signal, with the curve that would explain most."""

from __future__ import annotations

from dataclasses import dataclass

from fmus.kit.arrays import Array
from fmus.kit.corrections import effect_family
from orchestration.discrepancy.laws.evidence import Basis, Curve
from orchestration.discrepancy.laws.signals import LawSignal

# correlation of the effects of two corrections, above which they are one
IDENTICAL = 1.0 - 1e-6
# the same, above which a record cannot tell them apart
INDISTINGUISHABLE = 0.99


@dataclass(frozen=True)
class Entry:
    """A correction of a law by a curve of a signal.

    Attributes
    ----------
    driven : str
        Law along whose unknown input it was scored, which does the same to the outputs.
    law : str
    signal : LawSignal
    kind : {"add", "multiply"}
    basis : Basis
    curve : Curve
    direction : ndarray, shape (m,)
        Its effect on the whitened outputs, of unit length.
    step : ndarray, shape (p,)
        Of the model's own searched coordinates, beside the unknown input.
    left : float
        Squares that it leaves to first order, in units of the noise; unlike gains, these compare
        along different unknown inputs.
    visited : ndarray, shape (v,)
        Quantiles of the signal, evenly spaced: where the record has been.
    """

    driven: str
    law: str
    signal: LawSignal
    kind: str
    basis: Basis
    curve: Curve
    direction: Array
    step: Array
    left: float
    visited: Array

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Law, signal, memory and kind, whatever the lag, which a fit finds."""
        return self.law, self.signal.name, self.signal.memory, self.kind

    @property
    def family(self) -> str:
        """Family of the effects of this law and signal."""
        return effect_family(self.law, self.signal.name, self.signal.memory)

    @property
    def label(self) -> str:
        """Name for people."""
        return f"{self.law}{' x' if self.kind == 'multiply' else ''} over {self.signal.label}"


def indistinguishable(one: Entry, other: Entry) -> bool:
    """Return whether a record cannot tell two corrections apart, by their effect on the outputs."""
    return abs(float(one.direction @ other.direction)) >= INDISTINGUISHABLE


def identical(one: Entry, other: Entry) -> bool:
    """Return whether two corrections have the same effect in this record, but for rounding."""
    return abs(float(one.direction @ other.direction)) >= IDENTICAL
