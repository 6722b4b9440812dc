"""A line and a line with a cubic term, fitted by least squares, and what they leave of data drawn
anew.
"""

from __future__ import annotations

import numpy as np

from orchestration.discrepancy.candidates.paired_scores import PairedInnovations, paired_score

COUNT, PER_BLOCK = 240, 24
BLOCKS = np.arange(COUNT) // PER_BLOCK


def regression(seed, strength, fitted=300):
    """Line and line with a cubic term, fitted by least squares in unit noise, and what they leave
    of new data.
    """
    rng = np.random.default_rng(seed)

    def drawn(count):
        x = rng.uniform(-1.0, 1.0, count)
        columns = np.column_stack([np.ones(count), x, x**3])
        return columns, columns @ [1.0, 2.0, strength] + rng.normal(size=count)

    (a, y), (new, unseen) = drawn(fitted), drawn(COUNT)
    models = []
    for k in (2, 3):
        spread = np.linalg.inv(a[:, :k].T @ a[:, :k])
        left = unseen - new[:, :k] @ (spread @ a[:, :k].T @ y)
        models.append(PairedInnovations(left, -new[:, :k], spread))
    return models


def drawn_scores(strength, seeds):
    return [paired_score(*regression(seed, strength), BLOCKS) for seed in seeds]
