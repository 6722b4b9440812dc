"""A model at given parameters as if it had been fitted, and changes of its residual made by hand.

No search is made, so that noise, weights and priors are what a test says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmus.kit import Component
from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates.candidate import Candidate
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.candidates.score_test import ScoreDirection, ScoreDirections
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.identify.fitting import FitResult, Problem
from orchestration.identify.noise import Noise
from orchestration.identify.uncertainty import Covariance
from tests.support.regression_model import OFFSET


def at(
    cls: type[Component],
    data: Dataset,
    names: Sequence[str] = (),
    fixed: Mapping[str, float] | None = None,
    *,
    q: Array | None = None,
    noise: Mapping[str, Noise] | None = None,
    prior: Sequence[float] | None = None,
    weights: Mapping[str, Array] | None = None,
) -> FittedCandidate:
    """Return a model where a search starts, or at other searched coordinates."""
    problem = Problem(
        cls,
        data.time,
        data.inputs,
        data.measured,
        names,
        fixed or {},
        linear=data.linear or (),
        runs=data.several,
    )
    here = problem.position(problem.start) if q is None else q
    size = len(names)
    counts = {o: int(present.sum()) for o, present in problem.present.items()}
    fit = FitResult(
        q=here,
        values=problem.values(here),
        noise=dict(noise or {o: Noise(np.empty(0), 1.0) for o in counts}),
        residual={},
        innovation={},
        weights=dict(weights or {o: np.ones(n) for o, n in counts.items()}),
        information=np.zeros((size, size)),
        prior_precision=np.zeros(size) if prior is None else np.array(prior),
        deviance=0.0,
        parameters=size,
        samples=problem.samples,
        converged=True,
        covariance=Covariance(np.zeros((size, size)), np.zeros(size, dtype=bool)),
        excess_variance=np.ones(size),
    )
    return FittedCandidate(Candidate((), cls), problem, fit)


def directions(
    columns: Mapping[str, Any], least: float = -1e9, most: float = 1e9, effect: Any = OFFSET
) -> ScoreDirections:
    """Return changes (m, k) of residuals, all within the same bounds."""
    gradient = {o: np.asarray(c, dtype=np.float32) for o, c in columns.items()}
    count = next(iter(gradient.values())).shape[1]
    return ScoreDirections(effect, [ScoreDirection({}, least, most)] * count, gradient)
