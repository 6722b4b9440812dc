"""Cross-validation of candidates in long blocks that they were not fitted to.

A criterion counts on one of the models being right. Where none is, the best is the one that
predicts best (Stone, JRSS B 36, 1974), of blocks that are long, because neighbouring samples tell
of each other (Burman, Chow, Nolan, Biometrika 81, 1994). Every block counts alike: what is far out
in one of them says no more than what is a little out in all. Where a record mostly rests, blocks
are shorter where it moves: a step that is all in one block is left out as a whole, and what is
fitted to the rest says nothing of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from fmus.kit.arrays import Array, Indices
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import Dataset, ValidationData
from orchestration.discrepancy.selection.search import FAILURES, Search

_BLOCKS = 16
_FOLDS = 4  # a candidate is fitted for each without every fourth block
_LEVEL = 0.95
# of the mean movement of blocks of one length, below which one of them rests
_RESTS = 0.1


@dataclass(frozen=True)
class Blocks:
    """A record divided into blocks.

    Attributes
    ----------
    number : ndarray of int, shape (n,)
        Of the block that every sample is in; -1 where it is in none.
    count : int
    """

    number: Indices
    count: int

    @classmethod
    def of(cls, data: Dataset, each: bool, movement: Array) -> Blocks:
        """Return runs, without what tells where each starts, or stretches if there are few runs.

        Parameters
        ----------
        data : Dataset
        each : bool
            Whether parameters differ from run to run.
        movement : ndarray, shape (n,)
            Share of all that the outputs move which falls to each sample.
        """
        number = np.full(len(data.time), -1)
        if len(data.runs) >= _FOLDS:
            judged = ValidationData.separate_record(data, each).judged
            for k, run in enumerate(data.runs):
                number[run.samples] = np.where(judged[run.samples], k, -1)
            return cls(number, len(data.runs))
        within = np.flatnonzero(data.within)
        even = np.arange(within.size) * _BLOCKS // within.size
        number[within] = even
        moved = np.bincount(even, movement[within], _BLOCKS)
        if moved.min() < _RESTS * moved.mean():
            share = 0.5 / within.size + 0.5 * movement[within] / moved.sum()
            number[within] = np.minimum(np.cumsum(share) * _BLOCKS, _BLOCKS - 1).astype(int)
        return cls(number, _BLOCKS)


def movement(fitted: FittedCandidate) -> Array:
    """Return the share (n,) of a simulation's total variation that falls to each sample.

    It is the mean over outputs that move at all.
    """
    problem = fitted.problem
    shares = []
    for output, residual in fitted.fit.residual.items():
        present = problem.present[output]
        simulated = problem.measured[output][present] - residual
        steps = np.zeros(len(present))
        steps[present] = np.abs(np.diff(simulated, prepend=simulated[0]))
        if steps.any():
            shares.append(steps / steps.sum())
    return np.mean(shares, axis=0) if shares else np.full(len(problem.time), 1.0)


def cv_errors(
    search: Search, fitted: FittedCandidate, blocks: Blocks, nearest: FittedCandidate
) -> Array:
    """Return the errors of a candidate in blocks that it was not fitted to.

    Parameters
    ----------
    search : Search
        Fits start from where the candidate stands.
    fitted : FittedCandidate
    blocks : Blocks
    nearest : FittedCandidate
        Its noise tells how much a sample counts, and which error is none.

    Returns
    -------
    ndarray, shape (blocks,)
        Sum over outputs of the logarithm of the mean squared error and the noise; infinite where it
        cannot be fitted or simulated.
    """
    errors = np.zeros(blocks.count)
    noise = {output: n.deviation**2 for output, n in nearest.fit.noise.items()}
    for fold in range(_FOLDS):
        try:
            residual = _residual_without(search, fitted, blocks, fold)
        except FAILURES:
            return np.full(blocks.count, np.inf)
        finally:
            fitted.problem.forget_simulation()
        for output, e in residual.items():
            number = blocks.number[fitted.problem.present[output]]
            for block in range(fold, blocks.count, _FOLDS):
                weight = nearest.fit.weights[output] * (number == block)
                if weight.any():
                    errors[block] += np.log(np.average(e**2, weights=weight) + noise[output])
    return errors


def _residual_without(
    search: Search, fitted: FittedCandidate, blocks: Blocks, fold: int
) -> dict[str, Array]:
    """Return the residual of a candidate that is fitted without the blocks of one fold."""
    left_out = (blocks.number >= 0) & (blocks.number % _FOLDS == fold)
    kept = {o: np.where(left_out, np.nan, y) for o, y in search.data.measured.items()}
    search_in_kept = replace(search, data=replace(search.data, measured=kept))
    again = search_in_kept.fit_from(fitted.candidate, fitted)
    residual, _ = fitted.problem.evaluate(again.fit.q)
    return residual


def predicts_better(better: Array, other: Array) -> bool:
    """Return whether errors of blocks are significantly smaller, by their sum or by agreement.

    Parameters
    ----------
    better, other : ndarray, shape (blocks,)
        By `cv_errors`.
    """
    from scipy.stats import wilcoxon  # half a second to load, which few diagnoses need

    gains = other - better
    if not np.isfinite(gains).all():
        return bool(np.isfinite(better).all())
    scatter = float(np.std(gains, ddof=1)) * len(gains) ** 0.5
    agree = gains.any() and bool(wilcoxon(gains, alternative="greater").pvalue < 1.0 - _LEVEL)
    return agree or bool(gains.sum() > ndtri(_LEVEL) * scatter)
