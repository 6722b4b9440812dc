"""A graphical estimate: a number with its unit and its confidence interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from fmus.kit import UserError
from fmus.kit.arrays import Array

_LEVEL = 0.975  # of a two-sided interval of 95 %
_RESAMPLES = 200  # of a residual, by which the ends of an interval are known to some 5 %


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


def resampled(
    read: Callable[[Array], Sequence[float]],
    draw: Callable[[Sequence[float]], Array],
    measured: Array,
    units: Sequence[str],
) -> list[GraphicalEstimate]:
    """Return what is read off a measured curve, with intervals by resampling its noise.

    The residual is resampled in blocks, so that its colour counts (Kuensch, Ann. Statist. 17,
    1989). A method that reads other numbers off a curve than it was drawn with is biased: the
    interval reaches from that of the noise to where it is without the bias (Efron and Tibshirani,
    An Introduction to the Bootstrap, 1993, chapter 10).

    Parameters
    ----------
    read : callable
        Returns the numbers that are read off a signal (n,); a UserError leaves a sample out.
    draw : callable
        Returns the smooth curve (n,) that has such numbers.
    measured : ndarray, shape (n,)
    units : sequence of str
        Of the numbers.
    """
    random = np.random.default_rng(0)
    values = read(measured)
    curve = draw(values)
    residual = measured - curve
    residual -= residual.mean()
    size = residual.size
    length = int(np.ceil(size ** (1.0 / 3.0)))
    drawn = []
    for _ in range(_RESAMPLES):
        first = random.integers(0, size - length + 1, (-(-size // length), 1))
        noise = residual[(first + np.arange(length)).ravel()[:size]]
        with suppress(UserError):
            drawn.append(read(curve + noise))
    ends = np.full((2, len(values)), [[-np.inf], [np.inf]])
    if drawn:
        again = np.asarray(read(curve))
        bias = again - values
        ends = values + np.quantile(drawn, [1.0 - _LEVEL, _LEVEL], axis=0) - again
        ends -= [np.maximum(bias, 0.0), np.minimum(bias, 0.0)]
    return [
        GraphicalEstimate(value, (float(low), float(high)), unit)
        for value, low, high, unit in zip(values, *ends, units, strict=True)
    ]
