"""A graphical estimate: a number with its unit and its confidence interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

_LEVEL = 0.975  # of a two-sided interval of 95 %


@dataclass(frozen=True)
class GraphicalEstimate:
    """A number with its unit and its confidence interval.

    Attributes
    ----------
    value : float
    interval : tuple of float
        95 % confidence interval; infinite for a single measurement.
    unit : str
    """

    value: float
    interval: tuple[float, float]
    unit: str

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:.4g} {self.unit} (95 % interval {low:.4g} to {high:.4g})"


def quantity(value: float, standard_error: float, repetitions: int, unit: str) -> GraphicalEstimate:
    """Return an estimate with Student's interval.

    Parameters
    ----------
    value, standard_error : float
    repetitions : int
        Number of independent measurements behind the standard error; for a single one the interval
        is infinite.
    unit : str
    """
    half = float("inf")
    if repetitions > 1:
        half = float(stdtrit(repetitions - 1, _LEVEL)) * standard_error
    return GraphicalEstimate(value, (value - half, value + half), unit)


def mean(values: ArrayLike, unit: str) -> GraphicalEstimate:
    """Return the mean of repeated measurements, (n,), with Student's interval."""
    repeated = np.asarray(values, dtype=float)
    error = float("inf")
    if repeated.size > 1:
        error = float(np.std(repeated, ddof=1) / np.sqrt(repeated.size))
    return quantity(float(np.mean(repeated)), error, repeated.size, unit)
