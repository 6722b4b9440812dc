"""Whether a record tells two models apart of which neither contains the other (Vuong, Econometrica 57, 1989).

The criterion of one is always the lower, and where neither model has quite the form of the truth, what it is lower by
comes from a few stretches of the record. How sure it is comes from how it changes from block to block.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.candidates.paired_score import Innovations, paired_score

_BLOCKS = 16
_SURE = float(norm.ppf(0.95))  # standard errors


def told_apart(better: FittedCandidate, other: FittedCandidate) -> bool:
    """Whether a record is surely likelier by one fitted model than by another, in the noise of the better one."""
    present, pairs, samples = better.problem.present, [], []
    for output, noise in better.fit.noise.items():
        both = np.array([noise.whiten(f.fit.residual[output], present[output]) for f in (better, other)])
        nearest = np.abs(both).min(axis=0)  # what is far out for both counts little, and as little for one as the other
        pairs.append(both * np.sqrt(noise.weights(nearest)))
        samples.append(np.flatnonzero(present[output]))
    rank = np.unique(np.concatenate(samples), return_inverse=True)[1]
    blocks = rank * min(_BLOCKS, int(rank.max()) + 1) // (int(rank.max()) + 1)
    values = np.hstack(pairs)
    # as fitted: what is open of parameters is in the criterion already
    nothing = np.zeros((values.shape[1], 0)), np.zeros((0, 0))
    score = paired_score(Innovations(values[1], *nothing), Innovations(values[0], *nothing), blocks)
    return score.gain > _SURE * score.standard_error
