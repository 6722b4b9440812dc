"""Whether the mean of a residual depends on the value of a signal.

That a residual is larger in some range of a signal is no fault of a model: noise may depend on how large a signal is.
That its mean is another one there is: who knows the signal could predict it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from orchestration.discrepancy.residuals.correlation import FEWEST, filtered, first_causal
from orchestration.discrepancy.residuals.innovations import Innovations
from orchestration.discrepancy.residuals.operating_regions import BINS, delayed, fading, ranges_of
from orchestration.discrepancy.residuals.regressors import Regressor, RegressorKind
from orchestration.identify.noise.model import Noise

Array = NDArray[np.float64]
ALPHA = 1e-5  # probability in noise of one level; where it jumps with the output, colour is not taken off cleanly
_VISITS = 3  # of every range, on average: seen less often, a range is hardly more than a time, and noise may be slow
_SINGULAR = (
    1e-8  # of the largest singular value: together the ranges are everywhere, which says nothing
)


@dataclass(frozen=True)
class ConditionalMean:
    """The mean of a residual in ranges of a signal.

    Attributes
    ----------
    output, signal : str
    low, high : float
        Ends of the range in which it is furthest from zero; infinite where it is open.
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
        """Whether it is beyond what noise of any level does."""
        return self.p_value < ALPHA


def conditional_means(
    output: str,
    residual: Array,
    innovations: Innovations,
    noise: Noise,
    signals: Sequence[Regressor],
    feedback: bool = False,
    within: NDArray[np.bool_] | None = None,
    bins: int = BINS,
) -> list[ConditionalMean]:
    """Compare the means of a residual in ranges of every signal, of equally many samples each.

    The scores of its innovations are regressed on the whitened indicators of the ranges, all those of a signal together
    (an analysis of variance by scores, with the colour of the noise taken off both sides).

    Parameters
    ----------
    output : str
    residual : ndarray, shape (k,)
        At the samples of the innovations.
    innovations : Innovations
    noise : Noise
        Of the residual.
    signals : sequence of Regressor
        Squares are passed over: their ranges are those of the signals. So is what goes with time: that a residual
        wanders is the random walk test's affair.
    feedback : bool
        Whether inputs are moved by what is measured, so that a range may be a consequence of the noise in it.
    within : ndarray of bool, shape (n,), optional
        Samples of the runs that the record is made of; all of them unless given.
    bins : int

    Returns
    -------
    list of ConditionalMean
        One for every signal that is left, the most telling first.
    """
    wanted = [s for s in signals if s.kind is not RegressorKind.SQUARE]
    at, scores = innovations.at, innovations.scores
    rms = float(np.sqrt(np.mean(residual**2))) if residual.size else 0.0
    if at.size < 2 * FEWEST or not rms > 0.0:
        return []
    # innovations are not independent where samples are uneven, and no colour was taken off
    variance = float(np.mean(scores**2)) * max(1.0, 1.0 + 2.0 * float(fading(scores).sum()))
    present = np.zeros(wanted[0].values.size if wanted else 0, dtype=bool)
    present[at] = True
    result = []
    for signal in wanted:
        late = first_causal(signal, feedback)
        parts = [
            (low, high, delayed(inside, late))
            for low, high, inside in ranges_of(signal.values, present, bins)
        ]
        parts = [part for part in parts if FEWEST <= part[2][at].sum() <= at.size - FEWEST]
        if not parts:
            continue
        changes = np.count_nonzero(
            np.diff(np.array([inside[at] for _, _, inside in parts], dtype=np.int8), axis=1)
        )
        if changes < 2 * _VISITS * len(parts):
            continue
        columns = np.column_stack(
            [filtered(inside.astype(float), noise, within)[at] for _, _, inside in parts]
        )
        explained, freedom = _regressed(scores, columns)
        p = min(1.0, len(wanted) * float(chi2.sf(explained / variance, freedom)))
        means = [float(residual[inside[at]].mean()) for _, _, inside in parts]
        k = int(np.argmax(np.abs(means)))
        ends = parts[k][0], parts[k][1], signal.unit
        result.append(ConditionalMean(output, signal.name, *ends, means[k], means[k] / rms, p))
    return sorted(result, key=lambda one: (one.p_value, -abs(one.bias)))


def _regressed(scores: Array, columns: Array) -> tuple[float, int]:
    """Sum of squares that columns (k, c) explain of scores (k,), and how many of them are independent."""
    size = np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(
        columns[:, size > 0.0] / size[size > 0.0], full_matrices=False
    )
    rank = int((singular > _SINGULAR * singular.max(initial=0.0)).sum())
    return float(np.sum((left[:, :rank].T @ scores) ** 2)), rank
