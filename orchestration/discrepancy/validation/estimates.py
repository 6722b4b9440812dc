"""What a fit says of parameters: values with intervals, and which of them differ from nominal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.identify.estimate import Estimate, significantly_different
from orchestration.records.joined import base_name

Array = NDArray[np.float64]
_IMPLAUSIBLE = (
    30.0  # times nominal: no specimen is like that, but a wrong unit or a wrong column is
)


def estimates(model: FittedCandidate, more: ArrayLike = 0.0) -> dict[str, Estimate]:
    """Searched parameters by name, with their 95 % intervals, SI; ``more`` (p,) is deviation beside that of the fit."""
    problem, fitted = model.problem, model.fit
    intervals = problem.intervals(fitted.q, np.hypot(fitted.covariance.standard_errors, more))
    return {
        name: Estimate(
            fitted.values[name], problem.start[name], interval, problem.declared[name].unit
        )
        for name, interval in intervals.items()
    }


def significantly_changed(
    model: FittedCandidate, parameters: Sequence[str], more: ArrayLike = 0.0
) -> list[str]:
    """Physical parameters that are surely and noticeably others than nominal; ``more`` as in `estimates`."""
    problem, fitted = model.problem, model.fit
    change = np.abs(fitted.q - problem.position(problem.start))
    errors = np.hypot(fitted.covariance.standard_errors, more)
    t_statistics = {
        name: x / error
        for name, x, error in zip(problem.names, change, errors, strict=True)
        if name in parameters
        and not problem.declared[name].starts
        and significantly_different(x, error)
    }
    return sorted(t_statistics, key=lambda name: -t_statistics[name])


def implausible(values: Mapping[str, Estimate], parameters: Sequence[str]) -> dict[str, float]:
    """Of some parameters, those that no specimen can have, with their ratios to nominal; in any run.

    Where the interval holds values that a specimen may have, the record does not say that it has others.
    """
    ratios = {
        n: e.value / e.nominal
        for n, e in values.items()
        if base_name(n) in parameters and e.nominal
    }
    ends = {n: sorted(end / values[n].nominal for end in values[n].interval) for n in ratios}
    return {
        n: x
        for n, x in ratios.items()
        if x > 0.0 and (ends[n][0] >= _IMPLAUSIBLE or ends[n][1] <= 1.0 / _IMPLAUSIBLE)
    }
