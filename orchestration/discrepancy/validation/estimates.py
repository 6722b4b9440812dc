"""What a fit says of parameters: values with intervals, and which of them differ from nominal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.identify.estimate import Estimate

Array = NDArray[np.float64]
_SIGNIFICANT = 5.0  # standard errors by which a parameter counts as another than nominal
_NOTICEABLE = 0.02  # relative difference below which that is not worth a word
_IMPLAUSIBLE = 30.0  # times nominal: no specimen is like that, but a wrong unit or a wrong column is


def estimates(model: FittedCandidate) -> dict[str, Estimate]:
    """Searched parameters by name, with their 95 % intervals, SI."""
    problem, fitted = model.problem, model.fit
    half = float(norm.ppf(0.975)) * model.fit.covariance.standard_errors
    result = {}
    for name, scale, q, h in zip(problem.names, problem.scales, fitted.q, half, strict=True):
        ends = (scale.value(q - h), scale.value(q + h))
        result[name] = Estimate(fitted.values[name], problem.start[name], ends, problem.declared[name].unit)
    return result


def significantly_changed(model: FittedCandidate, parameters: Sequence[str]) -> list[str]:
    """Physical parameters that are surely and noticeably others than nominal."""
    problem, fitted = model.problem, model.fit
    nominal = problem.position(problem.start)
    surely = np.abs(fitted.q - nominal) / fitted.covariance.standard_errors
    chosen = {
        name: float(surely[i])
        for i, name in enumerate(problem.names)
        if name in parameters and not problem.declared[name].starts and surely[i] > _SIGNIFICANT
        and abs(fitted.q[i] - nominal[i]) > _NOTICEABLE
    }  # fmt: skip
    return sorted(chosen, key=lambda name: -chosen[name])


def implausible(values: Mapping[str, Estimate], parameters: Sequence[str]) -> dict[str, float]:
    """Of some parameters, those that no specimen can have, with their ratios to nominal."""
    ratios = {n: values[n].value / values[n].nominal for n in parameters if values[n].nominal}
    return {n: x for n, x in ratios.items() if x > 0.0 and not 1.0 / _IMPLAUSIBLE < x < _IMPLAUSIBLE}
