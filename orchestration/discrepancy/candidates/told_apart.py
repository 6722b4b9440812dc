"""Whether a record tells two models apart of which neither contains the other (Vuong, Econometrica 57, 1989).

The criterion of one is always the lower. Where neither model has quite the form of the truth, what it is lower by may
come from a few stretches of the record while others say the opposite. Blocks tell how sure it is: their sum stands
out of their scatter, or so many of them agree that chance does not do it (Wilcoxon, Biometrics Bulletin 1, 1945). And
where the other's free run is nearer, it hangs on the colour that the noise is given which of them is likelier.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm, wilcoxon

from orchestration.discrepancy.candidates.evidence import FittedCandidate

_BLOCKS = 16
_LEVEL = 0.95


def told_apart(better: FittedCandidate, other: FittedCandidate) -> bool:
    """Whether a record is surely likelier by one fitted model than by another, in whatever noise."""
    if other.is_nearer_than(better):
        return False
    present, pairs, samples = better.problem.present, [], []
    for output, noise in better.fit.noise.items():
        both = np.array([noise.whiten(f.fit.residual[output], present[output]) for f in (better, other)])
        nearest = np.abs(both).min(axis=0)  # what is far out for both counts little, and as little for one as the other
        pairs.append(both * np.sqrt(noise.weights(nearest)))
        samples.append(np.flatnonzero(present[output]))
    rank = np.unique(np.concatenate(samples), return_inverse=True)[1]
    blocks = rank * min(_BLOCKS, int(rank.max()) + 1) // (int(rank.max()) + 1)
    values = np.hstack(pairs)
    gains = np.bincount(blocks, 0.5 * (values[1] ** 2 - values[0] ** 2))
    scatter = float(np.std(gains, ddof=1)) * len(gains) ** 0.5 if len(gains) > 1 else np.inf
    agree = len(gains) > 1 and bool(wilcoxon(gains, alternative="greater").pvalue < 1.0 - _LEVEL)
    return agree or bool(gains.sum() > norm.ppf(_LEVEL) * scatter)
