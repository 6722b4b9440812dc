"""In which operating region a residual is largest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f

from orchestration.discrepancy.residuals.regressors import Regressor, RegressorKind

Array = NDArray[np.float64]
SIGNIFICANCE = 0.01  # false alarms of all lags of all signals, or of all bins of all signals, together
FEWEST = 20  # samples in a bin that says something
BINS = 8


@dataclass(frozen=True)
class OperatingRegion:
    """A range of a signal, and how large the residual is there.

    Attributes
    ----------
    output, signal : str
    low, high : float
        Ends of the range; infinite where it is open.
    unit : str
        Of the signal.
    samples : int
        Of the residual, in the range.
    rms : float
        Of the residual in the range.
    band : tuple of float
        Where 99 % of such figures lie if the residual is no different there.
    rms_ratio : float
        That rms over the rms everywhere else.
    p_value : float
        Of so large a residual in any of the ranges of any signal.
    """

    output: str
    signal: str
    low: float
    high: float
    unit: str
    samples: int
    rms: float
    band: tuple[float, float]
    rms_ratio: float
    p_value: float

    @property
    def significant(self) -> bool:
        """Whether the residual is larger there than by chance among so many ranges."""
        return self.p_value < SIGNIFICANCE


def operating_regions(
    output: str, residual: Array, present: NDArray[np.bool_], signals: Sequence[Regressor], bins: int = BINS
) -> list[OperatingRegion]:
    """Compare the residual in ranges of every signal, of equally many samples each, with the rest of the record.

    A coloured residual tells less than as many independent samples would: its square is correlated by the square of
    its own correlation, and counts for so many fewer.

    Parameters
    ----------
    output : str
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
    signals : sequence of Regressor
        Squares are passed over: their ranges are those of the signals.
    bins : int

    Returns
    -------
    list of Region
        The most telling first.
    """
    if residual.size < 2 * FEWEST:
        return []
    wanted = [s for s in signals if s.kind is not RegressorKind.SQUARE]
    square, worth = residual**2, 1.0 / _variance_inflation(residual)
    total, n = float(square.sum()), residual.size
    ranges = [(s, *part) for s in wanted for part in _ranges(s.values[present], bins)]
    ranked: list[tuple[float, OperatingRegion]] = []
    for signal, low, high, inside in ranges:
        count = int(inside.sum())
        if not FEWEST <= count <= n - FEWEST:
            continue
        within = float(square[inside].sum())
        elsewhere = (total - within) / (n - count)
        if not elsewhere > 0.0:
            continue
        ratio = within / count / elsewhere
        freedom = max(count * worth, 1.0), max((n - count) * worth, 1.0)
        surprise = float(f.logsf(ratio, *freedom)) + float(np.log(len(ranges)))
        ends = np.sqrt(elsewhere * f.ppf([0.005, 0.995], *freedom))
        p = min(1.0, float(np.exp(surprise)))
        rms, band = float(np.sqrt(within / count)), (float(ends[0]), float(ends[1]))
        ends_and_size = low, high, signal.unit, count, rms, band, float(np.sqrt(ratio)), p
        ranked.append((surprise, OperatingRegion(output, signal.name, *ends_and_size)))
    return [region for _, region in sorted(ranked, key=lambda pair: (pair[0], -pair[1].rms_ratio))]


def _ranges(values: Array, bins: int) -> list[tuple[float, float, NDArray[np.bool_]]]:
    """Ends of ranges that hold about equally many of the values, and which values lie in each."""
    inner = np.unique(np.quantile(values, np.linspace(0.0, 1.0, bins + 1)[1:-1]))
    inner = inner[inner > values.min()]
    which = np.searchsorted(inner, values, side="right")
    ends = np.concatenate([[-np.inf], inner, [np.inf]])
    return [(float(ends[k]), float(ends[k + 1]), which == k) for k in range(ends.size - 1)]


def _variance_inflation(residual: Array) -> float:
    """How many samples say as much about the size of a residual as an independent one would."""
    centred, n = residual - residual.mean(), residual.size
    power = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 4]
    if not correlation[0] > 0.0:
        return 1.0
    correlation /= correlation[0]
    faded = np.flatnonzero(np.abs(correlation) < 2.0 / np.sqrt(n))
    reach = int(faded[0]) if faded.size else correlation.size
    return 1.0 + 2.0 * float((correlation[1:reach] ** 2).sum())
