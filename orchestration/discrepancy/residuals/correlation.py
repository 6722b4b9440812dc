"""Cross-correlation of a residual with signals.

Both the residual and the signals are filtered by what makes the residual white before they are correlated: two slow
signals that have nothing to do with each other look alike, two white ones do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from orchestration.discrepancy.residuals.operating_regions import FEWEST, SIGNIFICANCE
from orchestration.discrepancy.residuals.regressors import Regressor
from orchestration.identify.noise import Noise

Array = NDArray[np.float64]
LAGS = 25  # samples, either way


@dataclass(frozen=True)
class CrossCorrelation:
    """Cross-correlation of the innovations of an output with a signal.

    Attributes
    ----------
    output, signal : str
    lags : ndarray, shape (l,)
        Seconds by which the signal comes before the residual.
    correlation : ndarray, shape (l,)
    band : float
        99 % of the correlations of one lag lie within it, either way, where there is nothing.
    lag, strength : float
        Where the correlation is strongest, and the correlation there, with its sign.
    p_value : float
        Of so strong a correlation at any lag of any of the signals.
    """

    output: str
    signal: str
    lags: Array
    correlation: Array
    band: float
    lag: float
    strength: float
    p_value: float

    @property
    def significant(self) -> bool:
        """Whether it is more than chance among so many."""
        return self.p_value < SIGNIFICANCE


def cross_correlations(
    output: str, residual: Array, present: NDArray[np.bool_], noise: Noise, signals: Sequence[Regressor],
    step: float, lags: int = LAGS, within: NDArray[np.bool_] | None = None,
) -> list[CrossCorrelation]:  # fmt: skip
    """Correlate the innovations of an output with signals.

    Parameters
    ----------
    output : str
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
        Where there is one.
    noise : Noise
        Of the residual.
    signals : sequence of Regressor
    step : float
        Seconds between samples.
    lags : int
        Samples that are looked at, either way.
    within : ndarray of bool, shape (n,), optional
        Samples of the runs that the record is made of; all of them unless given.

    Returns
    -------
    list of Association
        The strongest first.
    """
    n, kept = present.size, np.flatnonzero(present)
    within = np.ones(n, dtype=bool) if within is None else within
    max_lag = min(lags, n // 20)
    if kept.size < FEWEST or max_lag < 1:
        return []
    innovation, seen = np.zeros(n), np.zeros(n)
    innovation[kept], seen[kept] = noise.whiten(residual, present), 1.0
    power = float(innovation @ innovation) / kept.size
    shifts = np.arange(-max_lag, max_lag + 1)
    result = []
    for signal in signals:
        filtered, white = noise.whiten(signal.values[within], within), np.zeros(n)
        white[within] = filtered - filtered.mean()
        # sums over the samples at which there are both, for every shift
        together = np.array([_overlap(innovation, white, int(k)) for k in shifts])
        energy = np.array([_overlap(seen, white**2, int(k)) for k in shifts])
        pairs = np.maximum(np.array([_overlap(seen, within.astype(float), int(k)) for k in shifts]), 1.0)
        size = np.sqrt(power * energy)
        score = np.divide(together, size, out=np.zeros(size.size), where=size > 0.0)  # normal where there is nothing
        at = int(np.argmax(np.abs(score)))
        p = min(1.0, 2.0 * float(norm.sf(np.abs(score[at]))) * shifts.size * len(signals))
        r, band = np.asarray(score / np.sqrt(pairs)), float(norm.ppf(0.995) / np.sqrt(kept.size))
        result.append(
            CrossCorrelation(
                output,
                signal.name,
                np.asarray(shifts * step, dtype=np.float64),
                r,
                band,
                float(shifts[at] * step),
                float(r[at]),
                p,
            )
        )
    return sorted(result, key=lambda a: -abs(a.strength))


def _overlap(residual: Array, signal: Array, shift: int) -> float:
    """Sum of ``residual[k] * signal[k - shift]``."""
    n = residual.size
    return float(residual[max(shift, 0) : n + min(shift, 0)] @ signal[max(-shift, 0) : n - max(shift, 0)])
