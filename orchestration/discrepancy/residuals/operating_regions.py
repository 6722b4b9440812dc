"""Operating regions: the size and the mean of a residual in ranges of a signal.

That a residual is larger in some range of a signal may be the noise, which may depend on how large
a signal is. That its mean is another one there is a fault of the model: who knows the signal could
predict it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, isinf
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc, fdtri, ndtri

from fmus.kit.arrays import Array, Indices, Mask
from orchestration.discrepancy.residuals.correlation import (
    FEWEST,
    SIGNIFICANCE,
    least_lead,
)
from orchestration.discrepancy.residuals.innovations import Innovations, normal_scores
from orchestration.discrepancy.residuals.regressors import Regressor, RegressorKind
from orchestration.discrepancy.residuals.residual_test import ResidualTest
from orchestration.identify import ranks
from orchestration.identify.noise import Noise

if TYPE_CHECKING:
    from orchestration.discrepancy.residuals.output_residual import OutputResidual

BINS = 8
# probability in noise of one level of means as different; where the level jumps with the output,
# colour is not taken off cleanly
ALPHA_OF_MEANS = 1e-5
# of every range, on average: seen less often, a range is hardly more than a time, and noise may be
# slow
_VISITS = 3
# of the largest eigenvalue: together the ranges are everywhere, which says nothing
_SINGULAR = 1e-12


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

    def describe(self, output: str) -> str:
        """Return where the residual of an output is larger than elsewhere."""
        return f"{output} is {self.rms_ratio:.1f}× worse where {_describe_range(self)}"


@dataclass(frozen=True)
class ConditionalMean(ResidualTest):
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
    rms : float
        Magnitude of the mean.
    """

    rank: ClassVar[int] = 3
    needs_even_samples: ClassVar[bool] = False

    output: str
    signal: str
    low: float
    high: float
    unit: str
    mean: float
    bias: float
    p_value: float
    rms: float

    @classmethod
    def of(cls, residual: OutputResidual) -> list[ConditionalMean]:
        """Return the means in the ranges of all signals, the most telling first."""
        cleaned = residual.cleaned
        return conditional_means(
            residual.output,
            cleaned.values,
            cleaned.innovations,
            cleaned.noise,
            residual.signals,
            feedback=bool(residual.feedback),
            within=residual.data.within,
        )

    @property
    def significant(self) -> bool:
        """True if it is beyond what noise of any level does."""
        return self.p_value < ALPHA_OF_MEANS

    def describe(self, output: str) -> str:
        """Return where the mean of the residual of an output is farthest from zero."""
        return (
            f"the residual of {output} is {self.bias:+.2f} of its RMS on average where"
            f" {_describe_range(self)}"
        )


def _describe_range(item: OperatingRegion | ConditionalMean) -> str:
    """Return a range of a signal in words."""
    unit = "" if item.unit == "1" else f" {item.unit}"
    low = f"{item.low:.3g}{unit}"
    high = f"{item.high:.3g}{unit}"
    if isfinite(item.low) and isfinite(item.high):
        return f"{item.signal} is between {low} and {high}"
    if isinf(item.high):
        return f"{item.signal} is above {low}"
    return f"{item.signal} is below {high}"


class _Ranges(NamedTuple):
    """Ranges of a signal, and which of them it is in.

    Attributes
    ----------
    signal : Regressor
    ends : ndarray, shape (r + 1,)
        Infinite where a range is open.
    at : ndarray of int, shape (n,)
        Range of every sample; r where it is in none.
    """

    signal: Regressor
    ends: Array
    at: NDArray[np.int8]


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
    divided = [
        _divided(signal, present, bins, least_lead(signal, feedback))
        for signal in _without_squares(signals)
    ]
    tried = sum(ranges.ends.size - 1 for ranges in divided)
    sizes = _Sizes(residual)
    result = []
    for ranges in divided:
        size = sizes.compare(ranges.at[present], ranges.ends.size - 1)
        for k in np.flatnonzero(size.comparable):
            result.append(
                OperatingRegion(
                    output,
                    ranges.signal.name,
                    float(ranges.ends[k]),
                    float(ranges.ends[k + 1]),
                    ranges.signal.unit,
                    samples=int(size.samples[k]),
                    rms=float(size.rms[k]),
                    band=(float(size.low[k]), float(size.high[k])),
                    rms_ratio=float(size.ratio[k]),
                    p_value=min(1.0, tried * float(size.probability[k])),
                )
            )
    return sorted(result, key=lambda region: (region.p_value, -region.rms_ratio))


class _Comparison(NamedTuple):
    """Sizes of a residual in ranges (r,), compared with the rest of it; see `OperatingRegion`."""

    comparable: Mask
    samples: Indices
    rms: Array
    low: Array
    high: Array
    ratio: Array
    probability: Array


class _Sizes:
    """The size of a residual (m,), compared between some of its samples and the others."""

    def __init__(self, residual: Array):
        self._square = residual**2
        # ranks scored to go like the squares of normal variables
        shares = ranks(np.abs(residual)) / (residual.size + 1.0)
        self._scores = ndtri(0.5 + 0.5 * shares) ** 2
        self._worth = 1.0 / _variance_inflation(normal_scores(residual))

    def compare(self, range_of: NDArray[np.int8], ranges: int) -> _Comparison:
        """Compare the samples (m,) in each of so many ranges with all others."""
        count = np.bincount(range_of, minlength=ranges)[:ranges]
        others = self._square.size - count
        power = np.bincount(range_of, self._square, minlength=ranges)[:ranges]
        score = np.bincount(range_of, self._scores, minlength=ranges)[:ranges]
        freedom = (np.maximum(count * self._worth, 1.0), np.maximum(others * self._worth, 1.0))
        with np.errstate(divide="ignore", invalid="ignore"):  # not comparable
            rms = np.sqrt(power / count)
            elsewhere = (self._square.sum() - power) / others
            score_ratio = score / count / ((self._scores.sum() - score) / others)
            return _Comparison(
                (np.minimum(count, others) >= FEWEST) & (elsewhere > 0.0),
                count,
                rms,
                low=np.sqrt(elsewhere * fdtri(*freedom, 0.005)),
                high=np.sqrt(elsewhere * fdtri(*freedom, 0.995)),
                ratio=rms / np.sqrt(elsewhere),
                probability=fdtrc(*freedom, score_ratio),
            )


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
    if not compared or at.size < 2 * FEWEST or not np.mean(residual**2) > 0.0:
        return []
    present = np.zeros(compared[0].values.size, dtype=bool)
    present[at] = True
    if within is None:
        within = np.ones(present.size, dtype=bool)
    means = _Means(output, residual, innovations, noise, within)
    result = []
    for signal in compared:
        ranges = _divided(signal, present, bins, least_lead(signal, feedback))
        most = means.furthest(ranges, len(compared))
        if most is not None:
            result.append(most)
    return sorted(result, key=lambda one: (one.p_value, -abs(one.bias)))


class _Means:
    """The means of a residual in ranges of signals; see `conditional_means`."""

    def __init__(
        self,
        output: str,
        residual: Array,
        innovations: Innovations,
        noise: Noise,
        within: Mask,
    ):
        self._output = output
        self._residual = residual
        self._at = innovations.at
        self._noise = noise
        self._within = within
        self._present = np.zeros(within.size, dtype=bool)
        self._present[self._at] = True
        self._scores = np.zeros(within.size)
        self._scores[self._at] = innovations.scores
        self._rms = float(np.sqrt(np.mean(residual**2)))
        self._variance = _long_run_variance(innovations.scores)

    def furthest(self, ranges: _Ranges, tried: int) -> ConditionalMean | None:
        """Return the mean that is furthest from zero; None if the ranges say nothing."""
        range_of = ranges.at[self._at]
        samples = np.bincount(range_of, minlength=ranges.ends.size)
        judged = (samples >= FEWEST) & (samples <= self._at.size - FEWEST)
        judged[-1] = False
        kept = np.flatnonzero(judged)
        if not kept.size or not _often_visited(range_of, judged):
            return None
        patterns = _whitened(ranges, self._noise, self._within)
        explained, freedom = _explained(patterns, kept, self._scores, self._present)
        sums = np.bincount(range_of, self._residual, minlength=ranges.ends.size)
        means = sums[kept] / samples[kept]
        k = int(np.argmax(np.abs(means)))
        mean = float(means[k])
        return ConditionalMean(
            self._output,
            ranges.signal.name,
            float(ranges.ends[kept[k]]),
            float(ranges.ends[kept[k] + 1]),
            ranges.signal.unit,
            mean=mean,
            bias=mean / self._rms,
            p_value=min(1.0, tried * float(chdtrc(freedom, explained / self._variance))),
            rms=abs(mean),
        )


def _without_squares(signals: Sequence[Regressor]) -> list[Regressor]:
    return [s for s in signals if s.kind is not RegressorKind.SQUARE]


def _divided(signal: Regressor, present: Mask, bins: int, late: int) -> _Ranges:
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
    known = values[present]
    inner = np.unique(np.quantile(known, np.linspace(0.0, 1.0, bins + 1)[1:-1]))
    inner = inner[inner > known.min()]
    at = np.full(values.size, inner.size + 1, dtype=np.int8)
    at[late:] = np.searchsorted(inner, values[: values.size - late], side="right")
    return _Ranges(signal, np.concatenate([[-np.inf], inner, [np.inf]]), at)


def _often_visited(range_of: NDArray[np.int8], judged: Mask) -> bool:
    """Return True if a signal enters and leaves its ranges often enough to tell them from times."""
    moves = np.flatnonzero(np.diff(range_of))
    changes = judged[range_of[moves]].sum() + judged[range_of[moves + 1]].sum()
    return bool(changes >= 2 * _VISITS * judged.sum())


class _Patterns(NamedTuple):
    """Whitened indicators of ranges, of which there are few different ones.

    A signal mostly stays where it is, so that few patterns of ranges come one after the other.

    Attributes
    ----------
    of_sample : ndarray of int, shape (k,)
        Pattern that ends at each sample.
    at : ndarray of int, shape (k,)
        Those samples: where whitening has begun.
    rows : ndarray, shape (q, r + 1)
        Whitened indicators at the end of each pattern, without their means.
    """

    of_sample: Indices
    at: Indices
    rows: Array


def _whitened(ranges: _Ranges, noise: Noise, within: Mask) -> _Patterns:
    """Whiten the indicators of ranges as whitens the residual, without their means."""
    lags = noise.coefficients.size
    begun = within.copy()
    for lag in range(1, lags + 1):
        begun[lag:] &= within[:-lag]
        begun[:lag] = False
    at = np.flatnonzero(begun)
    base = ranges.ends.size
    code = np.zeros(at.size, dtype=np.intp)
    for lag in range(lags + 1):
        code += base**lag * ranges.at[at - lag].astype(np.intp)
    count = np.bincount(code)
    seen = np.flatnonzero(count)
    rows = np.zeros((seen.size, base))
    for lag, weight in enumerate([1.0, *-noise.coefficients]):
        rows[np.arange(seen.size), seen // base**lag % base] += weight
    rows -= count[seen] @ rows / max(at.size, 1)
    number = np.zeros(count.size, dtype=np.intp)
    number[seen] = np.arange(seen.size)
    return _Patterns(number[code], at, rows)


def _explained(
    patterns: _Patterns, kept: Indices, scores: Array, present: Mask
) -> tuple[float, int]:
    """Regress scores (n,) where they are present on the whitened indicators of some ranges.

    Returns
    -------
    explained : float
        Sum of squares that the indicators explain.
    rank : int
        Indicators that are independent.
    """
    rows = patterns.rows[:, kept]
    of_sample = patterns.of_sample
    count = np.bincount(of_sample, present[patterns.at], minlength=len(rows))
    total = np.bincount(of_sample, scores[patterns.at], minlength=len(rows))
    weighted = rows * np.sqrt(count)[:, np.newaxis]
    size = np.linalg.norm(weighted, axis=0)
    rows = rows[:, size > 0.0] / size[size > 0.0]
    values, directions = np.linalg.eigh((rows * count[:, np.newaxis]).T @ rows)
    independent = values > _SINGULAR * values.max(initial=0.0)
    along = directions[:, independent].T @ (total @ rows)
    return float(np.sum(along**2 / values[independent])), int(independent.sum())


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
