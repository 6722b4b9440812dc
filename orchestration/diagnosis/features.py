"""Features of a conclusion that say how far its first cause is to be trusted."""

from __future__ import annotations

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.comparison import Comparison, Judged
from orchestration.diagnosis.conclude import Conclusion
from orchestration.diagnosis.fitting import effective_samples
from orchestration.diagnosis.search import Found
from orchestration.diagnosis.terms import Memory, Term

_LEAST = 1e-12


def features_of(found: Found, conclusion: Conclusion) -> dict[str, float]:
    """Return the features of the first cause of a conclusion.

    Parameters
    ----------
    found : Found
    conclusion : Conclusion

    Returns
    -------
    dict of str to float
        Empty without a cause. ``left_out_gain``: logarithm of 1 nat and the gain on what is left
        out. ``margin``: by which the score falls to the best fit without the first cause, as a
        share of the gain of the set, between -1 and 1. ``alone``: gain of the first cause alone, as
        a share of that of the set. ``removed``: share of the mean square on what is left out that
        is removed. ``widths``: logarithm of the error on what is left out over the noise.
        ``independence``: logarithm of the share of independent samples in what is left. ``terms``,
        ``words``: number of parts, and their prior, nats. ``memory``, ``rate``, ``time``,
        ``factor``: whether the first term has a memory, is a fading one, is over time, is in
        proportion to a law. ``share``: probability of the first cause by scores alone.
    """
    if not conclusion.causes:
        return {}
    cause = conclusion.causes[0]
    compared = found.compared()
    first = cause.parts[0]
    gain = max(cause.comparison.gain, _LEAST)
    score = next(s for one, _, s in compared if one is cause.judged)
    without = _best_without(compared, cause.law, cause.signal)
    errors, base = cause.judged.choosing, found.base.choosing
    return {
        "left_out_gain": float(np.log1p(max(cause.comparison.left_out, 0.0))),
        "margin": float(np.clip((score - without) / gain, -1.0, 1.0)),
        "alone": float(np.clip(_gain_alone(compared, cause.law, cause.signal) / gain, 0.0, 1.0)),
        "removed": 1.0 - float(np.nanmean(errors**2) / np.nanmean(base**2)),
        "widths": float(np.log(np.sqrt(np.nanmean(errors**2)) / _noise(cause.judged))),
        "independence": float(np.mean([np.log(_independent(e)) for e in errors.T])),
        "terms": float(len(cause.parts)),
        "words": cause.judged.words,
        "memory": float(isinstance(first, Term) and first.memory is not Memory.NONE),
        "rate": float(isinstance(first, Term) and first.memory is Memory.FADING),
        "time": float(isinstance(first, Term) and first.signal == "time"),
        "factor": float(isinstance(first, Term) and bool(first.factor)),
        "share": cause.probability,
    }


def _best_without(compared: list[tuple[Judged, Comparison, float]], law: str, signal: str) -> float:
    """Return the best score of a fit without a cause; that of no term is zero."""
    others = (
        score
        for one, comparison, score in compared
        if not comparison.is_worse and all(t.cause != (law, signal) for t in one.parts)
    )
    return max(others, default=0.0)


def _gain_alone(compared: list[tuple[Judged, Comparison, float]], law: str, signal: str) -> float:
    """Return the largest gain of fits whose terms are all of one cause."""
    alone = (
        comparison.gain
        for one, comparison, _ in compared
        if one.parts and all(t.cause == (law, signal) for t in one.parts)
    )
    return max(alone, default=0.0)


def _noise(judged: Judged) -> float:
    """Return the noise of a fit's residuals in spreads, by their second differences.

    These see what is independent from sample to sample (Rice: Bandwidth choice for nonparametric
    regression, Annals of Statistics 12, 1984): a lower bound where noise is correlated.
    """
    squares = [np.diff(e, 2, axis=0) ** 2 / 6.0 for e in judged.fit.errors]
    return float(max(np.sqrt(np.nanmean(np.concatenate(squares))), _LEAST))


def _independent(error: Array) -> float:
    """Return the share of independent samples."""
    present = np.isfinite(error).sum()
    return effective_samples(error) / max(float(present), 1.0)
