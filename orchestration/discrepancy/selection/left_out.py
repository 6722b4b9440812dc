"""What candidates foretell of blocks that they were not fitted to.

A criterion counts on one of the models being right. Where none is, the best is the one that foretells best (Stone, JRSS
B 36, 1974), of blocks that are long, because neighbouring samples tell of each other (Burman, Chow, Nolan, Biometrika
81, 1994). Every block counts alike: what is far out in one of them says no more than what is a little out in all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, wilcoxon

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import ValidationData
from orchestration.discrepancy.selection.search import FAILURES, Search

Array = NDArray[np.float64]
_BLOCKS = 16
_TIMES = 4  # that a candidate is fitted, each time without every fourth block
_LEVEL = 0.95


@dataclass(frozen=True)
class Blocks:
    """A record divided into blocks.

    Attributes
    ----------
    number : ndarray of int, shape (n,)
        Of the block that every sample is in; -1 where it is in none.
    count : int
    """

    number: NDArray[np.intp]
    count: int

    @classmethod
    def of(cls, data: Dataset, each: bool) -> Blocks:
        """Runs, without what tells of each where it starts; or stretches of the same length, if there are few runs."""
        number = np.full(len(data.time), -1)
        if len(data.runs) >= _TIMES:
            judged = ValidationData.separate_record(data, each).judged
            for k, run in enumerate(data.runs):
                number[run.samples] = np.where(judged[run.samples], k, -1)
            return cls(number, len(data.runs))
        within = np.flatnonzero(data.within)
        number[within] = np.arange(within.size) * _BLOCKS // within.size
        return cls(number, _BLOCKS)


def foretold(
    search: Search, fitted: FittedCandidate, blocks: Blocks, nearest: FittedCandidate
) -> Array:
    """Errors of a candidate in blocks that it was not fitted to.

    Parameters
    ----------
    search : Search
        Fits start from where the candidate stands.
    fitted : FittedCandidate
    blocks : Blocks
    nearest : FittedCandidate
        Whose noise tells how much a sample counts, and which error is none.

    Returns
    -------
    ndarray, shape (blocks,)
        Sum over outputs of the logarithm of the mean squared error and the noise; infinite where it cannot be fitted or
        simulated.
    """
    errors = np.zeros(blocks.count)
    noise = {o: n.deviation**2 for o, n in nearest.fit.noise.items()}
    for time in range(_TIMES):
        out = (blocks.number >= 0) & (blocks.number % _TIMES == time)
        rest = {o: np.where(out, np.nan, y) for o, y in search.data.measured.items()}
        try:
            again = replace(search, data=replace(search.data, measured=rest)).fit_from(
                fitted.candidate, fitted
            )
            residual, _ = fitted.problem.evaluate(again.fit.q)
        except FAILURES:
            return np.full(blocks.count, np.inf)
        finally:
            fitted.problem.forget()
        for o, e in residual.items():
            number = blocks.number[fitted.problem.present[o]]
            for block in range(time, blocks.count, _TIMES):
                if (weight := nearest.fit.weights[o] * (number == block)).any():
                    errors[block] += np.log(np.average(e**2, weights=weight) + noise[o])
    return errors


def foretells_better(better: Array, other: Array) -> bool:
    """Whether errors of blocks surely are the smaller ones: by their sum, or because so many blocks agree."""
    gains = other - better
    if not np.isfinite(gains).all():
        return bool(np.isfinite(better).all())
    scatter = float(np.std(gains, ddof=1)) * len(gains) ** 0.5
    agree = gains.any() and bool(wilcoxon(gains, alternative="greater").pvalue < 1.0 - _LEVEL)
    return agree or bool(gains.sum() > norm.ppf(_LEVEL) * scatter)
