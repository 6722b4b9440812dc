"""The residual of one output, with all that its tests need to know of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array, Mask
from orchestration.discrepancy.data import Dataset
from orchestration.discrepancy.residuals.correlation import (
    CrossCorrelation,
    Feedback,
    cross_correlations,
)
from orchestration.discrepancy.residuals.innovations import (
    Innovations,
    local_level,
    score_innovations,
)
from orchestration.discrepancy.residuals.lines import SpectralLine, spectral_lines
from orchestration.discrepancy.residuals.outliers import (
    LevelShift,
    find_outliers,
    interpolate_over,
    level_shifts,
)
from orchestration.discrepancy.residuals.regressors import Regressor
from orchestration.identify.noise import ORDER, Noise, estimate_noise, segments
from orchestration.records.quality import resolution_of

_ENOUGH = 3.2  # steps of noise, with which nothing is left of the error of rounding


class OutputResidual:
    """The residual of one output; what tests need of it is made as it is wanted.

    Parameters
    ----------
    output, residual, noise, data, signals, even
        As in :func:`.analysis.analyse`.

    Attributes
    ----------
    whole, cleaned : Residual
        As it is, and interpolated over outliers.
    outliers : ndarray of bool, shape (m,)
        None where samples are uneven.
    """

    def __init__(
        self,
        output: str,
        residual: Array,
        noise: Noise,
        data: Dataset,
        signals: Sequence[Regressor],
        even: bool,
    ):
        self.output = output
        self.data = data
        self.signals = signals
        self.even = even
        self.step = float(np.median(np.diff(data.time)))
        self.whole = _residual_of(data.measured[output], residual, noise)
        self._inputs = {name: values[self.whole.present] for name, values in data.inputs.items()}
        self.outliers = np.zeros(residual.size, dtype=bool)
        self.cleaned = self.whole
        if even:
            self.outliers = find_outliers(residual, self._inputs, self.whole.resolution)
        if self.outliers.any():  # they hide the colour of the noise
            self.cleaned = _interpolated(self.whole, self.outliers)

    @property
    def lines(self) -> list[SpectralLine]:
        """Spectral lines; none if samples are uneven: they say nothing of frequencies."""
        if not self.even:
            return []
        return _lines(self.cleaned, self.data.measured[self.output], self.step)

    @property
    def level_shifts(self) -> list[LevelShift]:
        """Level shifts; none if samples are uneven: they say nothing of what is sudden."""
        if not self.even:
            return []
        time = self.data.time[self.cleaned.present]
        return level_shifts(self.cleaned.values, time, self._inputs, self.cleaned.resolution)

    @cached_property
    def _correlated(self) -> tuple[list[CrossCorrelation], list[Feedback]]:
        return cross_correlations(
            self.output,
            self.cleaned.innovations,
            self.cleaned.noise,
            self.signals,
            self.step,
            inputs=list(self.data.inputs),
            within=self.data.within,
        )

    @property
    def correlations(self) -> list[CrossCorrelation]:
        """Cross-correlations with all signals, the strongest first."""
        return self._correlated[0]

    @property
    def feedback(self) -> list[Feedback]:
        """Inputs that follow what was measured, the strongest first."""
        return self._correlated[1]

    @cached_property
    def levelled_innovations(self) -> Innovations:
        """Innovations of the residual divided by its local level before it is whitened."""
        return _levelled_innovations(self.whole, self.even)


@dataclass(frozen=True)
class Residual:
    """A residual with its noise.

    Attributes
    ----------
    values : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
        Where there is one.
    noise : Noise
        Of the residual.
    simulated : ndarray, shape (n,)
        The output; zero where there is no residual.
    resolution : float
        Of the measurement.
    """

    values: Array
    present: Mask
    noise: Noise
    simulated: Array
    resolution: float

    @cached_property
    def innovations(self) -> Innovations:
        """Scored innovations."""
        return score_innovations(
            self.values, self.present, self.noise, self.simulated, self.resolution
        )

    @cached_property
    def bounded(self) -> Array:
        """The residual (m,) as it would be if no single innovation were far out."""
        return self.innovations.bounded(self.values, self.present, self.noise)

    @property
    def rounding(self) -> float:
        """Largest mean error that the steps of a converter can leave."""
        return rounding_error(self.resolution, self.noise.deviation)

    @property
    def whitened_rounding(self) -> float:
        """Standard deviation of independent errors of rounding, over that of the innovations."""
        gain = float(np.sqrt(1.0 + np.sum(self.noise.coefficients**2))) / self.noise.deviation
        return gain * self.resolution / np.sqrt(12.0)


def _residual_of(measured: Array, residual: Array, noise: Noise) -> Residual:
    present = np.isfinite(measured)
    simulated = np.zeros(measured.size)
    simulated[present] = measured[present] - residual
    return Residual(residual, present, noise, simulated, resolution_of(measured))


def _interpolated(whole: Residual, outliers: Mask) -> Residual:
    """Interpolate a residual over its outliers, and estimate its noise anew."""
    values = interpolate_over(whole.values, outliers)
    return replace(whole, values=values, noise=estimate_noise(values, whole.present))


def _levelled_innovations(whole: Residual, even: bool) -> Innovations:
    """Divide a residual by its local level before it is whitened, not after."""
    levelled = whole.values / local_level(whole.values, whole.simulated[whole.present])
    noise = estimate_noise(levelled, whole.present, ORDER if even else 0)
    return score_innovations(levelled, whole.present, noise, whole.simulated)


def _lines(residual: Residual, measured: Array, step: float) -> list[SpectralLine]:
    """Find spectral lines in the longest part of a residual without a gap."""
    first, last = max(segments(residual.present), key=lambda ends: ends[1] - ends[0])
    output = measured[residual.present][first:last]
    return spectral_lines(residual.bounded[first:last], step, output, residual.rounding)


def rounding_error(step: float, deviation: float) -> float:
    """Return the largest mean error that rounding leaves where a signal passes again and again.

    Noise of the deviation s before the converter leaves ``step / pi * exp(-2 (pi s / step)^2)`` of
    it and less (Widrow and Kollár: Quantization Noise, 2008, chapter 4); without any it is half a
    step. Both are bounded by half a step times that exponential, which from half a step of noise on
    is next to nothing.

    Parameters
    ----------
    step : float
        Of the converter; 0 if there is none.
    deviation : float
        Standard deviation of the innovations after the converter, in the same unit. Rounding is in
        it.

    Returns
    -------
    float
        In the same unit.
    """
    if not step > 0.0:
        return 0.0
    steps = min(deviation, _ENOUGH * step) / step  # the square of more may be no number
    before = max(steps**2 - 1.0 / 12.0, 0.0)
    return 0.5 * step * float(np.exp(-2.0 * np.pi**2 * before))
