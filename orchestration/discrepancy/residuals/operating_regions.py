"""In which operating region a residual is largest: of a wrong model, or of noise that depends on a signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, fdtri
from scipy.stats import norm, rankdata

from orchestration.discrepancy.residuals.correlation import FEWEST, SIGNIFICANCE, first_causal
from orchestration.discrepancy.residuals.innovations import normal_scores
from orchestration.discrepancy.residuals.regressors import Regressor, RegressorKind

Array = NDArray[np.float64]
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
        Of so large a residual in any of the ranges of any signal, by its ranks.
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
    output: str,
    residual: Array,
    present: NDArray[np.bool_],
    signals: Sequence[Regressor],
    feedback: bool = False,
    bins: int = BINS,
) -> list[OperatingRegion]:
    """Compare the residual in ranges of every signal, of equally many samples each, with the rest of the record.

    Its size is compared by ranks (Klotz). A coloured residual tells less of its size than as many
    independent samples would: its square is correlated by the square of its own correlation, and counts for so many
    fewer.

    Parameters
    ----------
    output : str
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
    signals : sequence of Regressor
        Squares are passed over: their ranges are those of the signals.
    feedback : bool
        Whether inputs are moved by what is measured, so that a range may be a consequence of the noise in it.
    bins : int

    Returns
    -------
    list of Region
        The most telling first.
    """
    if residual.size < 2 * FEWEST:
        return []
    wanted = [s for s in signals if s.kind is not RegressorKind.SQUARE]
    where, n = np.flatnonzero(present), residual.size
    square = residual**2
    scores = (
        norm.ppf(0.5 + 0.5 * rankdata(np.abs(residual)) / (n + 1.0)) ** 2
    )  # as squares of normal variables
    worth = 1.0 / _variance_inflation(normal_scores(residual))
    ranges = [(s, *part) for s in wanted for part in ranges_of(s.values, present, bins)]
    total, result = float(square.sum()), []
    for signal, low, high, everywhere in ranges:
        inside = delayed(everywhere, first_causal(signal, feedback))[where]
        count = int(inside.sum())
        if not FEWEST <= count <= n - FEWEST:
            continue
        within = float(square[inside].sum())
        elsewhere = (total - within) / (n - count)
        if not elsewhere > 0.0:
            continue
        freedom = max(count * worth, 1.0), max((n - count) * worth, 1.0)
        ends = np.sqrt(elsewhere * fdtri(*freedom, [0.005, 0.995]))
        rms, band = float(np.sqrt(within / count)), (float(ends[0]), float(ends[1]))
        scored = float(scores[inside].mean() / scores[~inside].mean())
        p = len(ranges) * float(fdtrc(*freedom, scored))
        ends_and_size = (
            low,
            high,
            signal.unit,
            count,
            rms,
            band,
            float(np.sqrt(within / count / elsewhere)),
        )
        result.append(OperatingRegion(output, signal.name, *ends_and_size, min(1.0, p)))
    return sorted(result, key=lambda region: (region.p_value, -region.rms_ratio))


def ranges_of(
    values: Array, present: NDArray[np.bool_], bins: int
) -> list[tuple[float, float, NDArray[np.bool_]]]:
    """Ends of ranges that hold about equally many of the values that are present, and which values lie in each."""
    inner = np.unique(np.quantile(values[present], np.linspace(0.0, 1.0, bins + 1)[1:-1]))
    inner = inner[inner > values[present].min()]
    which = np.searchsorted(inner, values, side="right")
    ends = np.concatenate([[-np.inf], inner, [np.inf]])
    return [(float(ends[k]), float(ends[k + 1]), which == k) for k in range(ends.size - 1)]


def delayed(inside: NDArray[np.bool_], late: int) -> NDArray[np.bool_]:
    """Where a signal was in a range so many samples ago."""
    return np.concatenate([np.zeros(late, dtype=bool), inside[: inside.size - late]])


def _variance_inflation(residual: Array) -> float:
    """How many samples say as much about the size of a residual as an independent one would."""
    return 1.0 + 2.0 * float((fading(residual) ** 2).sum())


def fading(values: Array) -> Array:
    """Autocorrelation from the first lag on, until it is lost in what there is of it without any."""
    centred, n = values - values.mean(), values.size
    power = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 4]
    if not correlation.size or not correlation[0] > 0.0:
        return np.empty(0)
    correlation /= correlation[0]
    faded = np.flatnonzero(np.abs(correlation) < 2.0 / np.sqrt(n))
    return np.asarray(correlation[1 : int(faded[0]) if faded.size else correlation.size])
