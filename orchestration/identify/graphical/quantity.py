"""A number with its unit and its confidence interval, as repeated measurements give it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import t as student

from orchestration.identify.metrics import number

_LEVEL = 0.975  # of a two-sided interval of 95 %


@dataclass(frozen=True)
class Quantity:
    """A measured number.

    Attributes
    ----------
    value : float
    interval : tuple of float
        95 % confidence interval; infinite where nothing was repeated.
    unit : str
    """

    value: float
    interval: tuple[float, float]
    unit: str

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:.4g} {self.unit} (95 % interval {low:.4g} to {high:.4g})"

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON: ``value``, ``ci95`` (None for an open end) and ``unit``."""
        return {
            "value": self.value,
            "ci95": [number(end) for end in self.interval],
            "unit": self.unit,
        }


def quantity(value: float, standard_error: float, repetitions: int, unit: str) -> Quantity:
    """Return a number with Student's interval.

    Parameters
    ----------
    value, standard_error : float
    repetitions : int
        Independent ones that the standard error is of; a single one tells nothing of it.
    unit : str
    """
    half = float("inf")
    if repetitions > 1:
        half = float(student.ppf(_LEVEL, repetitions - 1)) * standard_error
    return Quantity(value, (value - half, value + half), unit)


def mean(values: ArrayLike, unit: str) -> Quantity:
    """Return the mean of repeated measurements, (n,), with Student's interval."""
    repeated = np.asarray(values, dtype=float)
    error = (
        float(np.std(repeated, ddof=1) / np.sqrt(repeated.size))
        if repeated.size > 1
        else float("inf")
    )
    return quantity(float(np.mean(repeated)), error, repeated.size, unit)
