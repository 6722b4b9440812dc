"""Features of the leading causes that say how far they are to be trusted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import expit

from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.comparison import WEIGHTS
from orchestration.diagnosis.search import Found

_LEAST = 1e-12
_USUAL = 0.5  # logarithm of errors on what is left out over those that are fitted
_CHANCE = 3.0  # tempers of scores that a first cause may gain by chance


def features_of(found: Found, causes: Sequence[Cause]) -> dict[str, float]:
    """Return the features of some causes, of which one may be the true one.

    Parameters
    ----------
    found : Found
    causes : sequence of Cause
        At least one, the most probable first, with shares by scores for probabilities.

    Returns
    -------
    dict of str to float
        ``margin``: by which the score falls from the first cause to the best fit without any of
        them, or to no term, as a share of the gain of the first and of what chance may give,
        between -1 and 1. ``share``: of them all in the probability by scores alone. ``words``:
        prior of the words of the first, nats: what is told plainly is more often true, though in
        scores that is nothing beside a large gain. ``rise``: logarithm of the error of the first on
        what is left out, beyond uncertain parameters, over that on fitted samples; 0 up to what
        chance and another stimulus may give.
    """
    first = causes[0]
    without = _best_without(found, set().union(*(cause.members for cause in causes)))
    unseen = float(np.sqrt(np.nanmean(first.judged.beyond**2)))
    return {
        "margin": margin(first.score - without, first.comparison.gain, found.temper),
        "share": float(sum(cause.probability for cause in causes)),
        "words": first.judged.words,
        "rise": max(float(np.log(unseen / max(first.judged.fit.misfit, _LEAST))) - _USUAL, 0.0),
    }


def margin(lead: float, gain: float, temper: float) -> float:
    """Return a lead in score as a share of a gain and of what chance may give, between -1 and 1.

    Parameters
    ----------
    lead, gain : float
        Nats.
    temper : float
        Scale of scores that a probability is made of, nats.
    """
    return float(np.clip(lead / (max(gain, 0.0) + _CHANCE * temper), -1.0, 1.0))


def confidence(features: Mapping[str, float]) -> float:
    """Return the probability that the true cause is among those with these features."""
    odds = WEIGHTS.confidence["constant"]
    odds += sum(WEIGHTS.confidence[name] * value for name, value in features.items())
    return float(expit(odds))


def _best_without(found: Found, causes: set[tuple[str, str]]) -> float:
    """Return the best score of a fit without some causes; that of no term is zero."""
    others = (
        one.score
        for one in found.compared()
        if not one.comparison.is_worse
        and all(part.cause not in causes for part in one.judged.parts)
    )
    return max([0.0, *others])
