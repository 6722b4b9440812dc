"""Operating regions: the size and the mean of a residual in ranges of a signal.

That a residual is larger in some range of a signal may be the noise, which may depend on how large
a signal is. That its mean is another one there is a fault of the model: who knows the signal could
predict it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, fdtrc, fdtri, ndtri

from fmus.kit.arrays import Array, Mask
from orchestration.discrepancy.residuals.correlation import (
    FEWEST,
    SIGNIFICANCE,
    least_lead,
    prewhiten,
)
from orchestration.discrepancy.residuals.innovations import Innovations, normal_scores
from orchestration.discrepancy.residuals.regressors import Regressor, RegressorKind
from orchestration.identify import ranks
from orchestration.identify.noise import Noise

BINS = 8
# probability in noise of one level of means as different; where the level jumps with the output,
# colour is not taken off cleanly
ALPHA_OF_MEANS = 1e-5
# of every range, on average: seen less often, a range is hardly more than a time, and noise may be
# slow
_VISITS = 3
# of the largest singular value: together the ranges are everywhere, which says nothing
_SINGULAR = 1e-8


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
        """True if the residual is larger there than by chance among so many ranges."""
        return self.p_value < SIGNIFICANCE


@dataclass(frozen=True)
class ConditionalMean:
    """The mean of a residual in the range of a signal in which it is furthest from zero.

    Attributes
    ----------
    output, signal : str
    low, high : float
        Ends of that range; infinite where it is open.
    unit : str
        Of the signal.
    mean : float
        Of the residual there, in the unit of the output.
    bias : float
        That mean over the RMS of the residual everywhere.
    p_value : float
        Of means so different in the ranges of any of the signals.
    """

    output: str
    signal: str
    low: float
    high: float
    unit: str
    mean: float
    bias: float
    p_value: float

    @property
    def significant(self) -> bool:
        """True if it is beyond what noise of any level does."""
        return self.p_value < ALPHA_OF_MEANS


@dataclass(frozen=True)
class _Range:
    """A range of a signal, and the samples (n,) at which the signal is in it."""

    low: float
    high: float
    inside: Mask


def find_operating_regions(
    output: str,
    residual: Array,
    present: Mask,
    signals: Sequence[Regressor],
    feedback: bool = False,
    bins: int = BINS,
) -> list[OperatingRegion]:
    """Compare the size of a residual in ranges of every signal with that in the rest of the record.

    The ranges of a signal have equally many samples each. The size is compared by ranks (Klotz). A
    coloured residual determines its size less than as many independent samples would: its square is
    correlated by the square of its own correlation, and counts for so many fewer.

    Parameters
    ----------
    output : str
    residual : ndarray, shape (m,)
    present : ndarray of bool, shape (n,)
        Where there is one.
    signals : sequence of Regressor
        Squares are passed over: their ranges are those of the signals.
    feedback : bool
        Whether inputs are moved by what is measured, so that a range may be a consequence of the
        noise in it.
    bins : int

    Returns
    -------
    list of OperatingRegion
        The most telling first.
    """
    if residual.size < 2 * FEWEST:
        return []
    compared = [
        (signal, part)
        for signal in _without_squares(signals)
        for part in _ranges(signal, present, bins, least_lead(signal, feedback))
    ]
    at = np.flatnonzero(present)
    sizes = _Sizes(residual)
    result = []
    for signal, part in compared:
        inside = part.inside[at]
        count = int(inside.sum())
        if not FEWEST <= count <= residual.size - FEWEST:
            continue
        size = sizes.compare(inside, count, len(compared))
        if size is not None:
            result.append(
                OperatingRegion(
                    output,
                    signal.name,
                    part.low,
                    part.high,
                    signal.unit,
                    samples=count,
                    rms=size.rms,
                    band=size.band,
                    rms_ratio=size.ratio,
                    p_value=size.p_value,
                )
            )
    return sorted(result, key=lambda region: (region.p_value, -region.rms_ratio))


class _Comparison(NamedTuple):
    """Size of a residual at some samples, compared with the others; see `OperatingRegion`."""

    rms: float
    band: tuple[float, float]
    ratio: float
    p_value: float


class _Sizes:
    """The size of a residual (m,), compared between some of its samples and the others."""

    def __init__(self, residual: Array):
        self._square = residual**2
        self._total = float(self._square.sum())
        # ranks scored to go like the squares of normal variables
        shares = ranks(np.abs(residual)) / (residual.size + 1.0)
        self._scores = ndtri(0.5 + 0.5 * shares) ** 2
        self._worth = 1.0 / _variance_inflation(normal_scores(residual))

    def compare(self, inside: Mask, count: int, tried: int) -> _Comparison | None:
        """Compare so many samples with the others, as one of so many comparisons.

        None if the others are zero.
        """
        others = self._square.size - count
        power = float(self._square[inside].sum())
        elsewhere = (self._total - power) / others
        if not elsewhere > 0.0:
            return None
        freedom = (max(count * self._worth, 1.0), max(others * self._worth, 1.0))
        low, high = np.sqrt(elsewhere * fdtri(*freedom, [0.005, 0.995]))
        score_ratio = float(self._scores[inside].mean() / self._scores[~inside].mean())
        p_value = min(1.0, tried * float(fdtrc(*freedom, score_ratio)))
        ratio = float(np.sqrt(power / count / elsewhere))
        return _Comparison(float(np.sqrt(power / count)), (float(low), float(high)), ratio, p_value)


def conditional_means(
    output: str,
    residual: Array,
    innovations: Innovations,
    noise: Noise,
    signals: Sequence[Regressor],
    *,
    feedback: bool = False,
    within: Mask | None = None,
    bins: int = BINS,
) -> list[ConditionalMean]:
    """Compare the means of a residual in ranges of every signal, of equally many samples each.

    The scores of its innovations are regressed on the whitened indicators of the ranges, all those
    of a signal together (an analysis of variance by scores, with the colour of the noise taken off
    both sides).

    Parameters
    ----------
    output : str
    residual : ndarray, shape (k,)
        At the samples of the innovations.
    innovations : Innovations
    noise : Noise
        Of the residual.
    signals : sequence of Regressor
        Squares are passed over: their ranges are those of the signals. So is what goes with time:
        that a residual wanders is the random walk test's affair.
    feedback : bool
        Whether inputs are moved by what is measured, so that a range may be a consequence of the
        noise in it.
    within : ndarray of bool, shape (n,), optional
        Samples of the runs that the record is made of; all of them unless given.
    bins : int

    Returns
    -------
    list of ConditionalMean
        One for every signal that is left, the most telling first.
    """
    compared = _without_squares(signals)
    at = innovations.at
    rms = float(np.sqrt(np.mean(residual**2))) if residual.size else 0.0
    if at.size < 2 * FEWEST or not rms > 0.0:
        return []
    present = np.zeros(compared[0].values.size if compared else 0, dtype=bool)
    present[at] = True
    variance = _long_run_variance(innovations.scores)
    result = []
    for signal in compared:
        ranges = [
            part
            for part in _ranges(signal, present, bins, least_lead(signal, feedback))
            if FEWEST <= part.inside[at].sum() <= at.size - FEWEST
        ]
        if not ranges or not _often_visited([part.inside[at] for part in ranges]):
            continue
        indicators = [prewhiten(part.inside.astype(float), noise, within)[at] for part in ranges]
        explained, freedom = _explained(innovations.scores, np.column_stack(indicators))
        p_value = min(1.0, len(compared) * float(chdtrc(freedom, explained / variance)))
        means = [float(residual[part.inside[at]].mean()) for part in ranges]
        k = int(np.argmax(np.abs(means)))
        result.append(
            ConditionalMean(
                output,
                signal.name,
                ranges[k].low,
                ranges[k].high,
                signal.unit,
                mean=means[k],
                bias=means[k] / rms,
                p_value=p_value,
            )
        )
    return sorted(result, key=lambda one: (one.p_value, -abs(one.bias)))


def _without_squares(signals: Sequence[Regressor]) -> list[Regressor]:
    return [s for s in signals if s.kind is not RegressorKind.SQUARE]


def _ranges(signal: Regressor, present: Mask, bins: int, late: int) -> list[_Range]:
    """Divide a signal into ranges of about equally many of the samples that are present.

    Parameters
    ----------
    signal : Regressor
    present : ndarray of bool, shape (n,)
    bins : int
        Ranges at most.
    late : int
        Samples by which the signal is delayed.
    """
    values = signal.values
    inner = np.unique(np.quantile(values[present], np.linspace(0.0, 1.0, bins + 1)[1:-1]))
    inner = inner[inner > values[present].min()]
    range_of = np.searchsorted(inner, values, side="right")
    ends = np.concatenate([[-np.inf], inner, [np.inf]])
    return [
        _Range(float(ends[k]), float(ends[k + 1]), _delayed(range_of == k, late))
        for k in range(ends.size - 1)
    ]


def _delayed(inside: Mask, late: int) -> Mask:
    return np.concatenate([np.zeros(late, dtype=bool), inside[: inside.size - late]])


def _often_visited(inside: Sequence[Mask]) -> bool:
    """Return True if a signal enters and leaves its ranges often enough to tell them from times."""
    changes = np.count_nonzero(np.diff(np.array(inside, dtype=np.int8), axis=1))
    return bool(changes >= 2 * _VISITS * len(inside))


def _explained(scores: Array, columns: Array) -> tuple[float, int]:
    """Regress scores (k,) on columns (k, c).

    Returns
    -------
    explained : float
        Sum of squares that the columns explain.
    rank : int
        Columns that are independent.
    """
    size = np.linalg.norm(columns, axis=0)
    directions, singular, _ = np.linalg.svd(
        columns[:, size > 0.0] / size[size > 0.0], full_matrices=False
    )
    rank = int((singular > _SINGULAR * singular.max(initial=0.0)).sum())
    return float(np.sum((directions[:, :rank].T @ scores) ** 2)), rank


def _long_run_variance(scores: Array) -> float:
    """Return the variance of scores that counts for their mean.

    They are not independent where samples are uneven, and no colour was taken off.
    """
    return float(np.mean(scores**2)) * max(1.0, 1.0 + 2.0 * float(_autocorrelation(scores).sum()))


def _variance_inflation(residual: Array) -> float:
    """Return how many samples say as much of the size of a residual as an independent one."""
    return 1.0 + 2.0 * float((_autocorrelation(residual) ** 2).sum())


def _autocorrelation(values: Array) -> Array:
    """Return the autocorrelation from the first lag on, until it is lost in that of white noise."""
    n = values.size
    centred = values - values.mean()
    power = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 4]
    if not correlation.size or not correlation[0] > 0.0:
        return np.empty(0)
    correlation /= correlation[0]
    faded = np.flatnonzero(np.abs(correlation) < 2.0 / np.sqrt(n))
    return np.asarray(correlation[1 : int(faded[0]) if faded.size else correlation.size])
