"""What changed between two records of one specimen: which parameters are others after than before.

Both records are simulated with one set of parameters, and one parameter after the other is let go in the second record,
as long as that makes the simulation fit noticeably better (forward selection by the error of the free run). A change is
claimed where it is surely and noticeably none of chance, in the colour and the changing level of the noise of both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestration.discrepancy.candidates.candidate import Candidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.parallel import side_by_side
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.estimate import significantly_different
from orchestration.identify.metrics import number
from orchestration.identify.prediction_error import FitResult, fit_free_run
from orchestration.identify.problem import Problem
from orchestration.identify.simulation_error import error_scales, pooled_error
from orchestration.records.joined import base_name

Array = NDArray[np.float64]
BEFORE, AFTER = "before", "after"
# Of what letting go of all parameters gains, in squared error, below which letting go of one more explains nothing: no
# model is quite right, and what is wrong with it bends every parameter a little.
RELEVANT = 0.05


@dataclass(frozen=True)
class Change:
    """One parameter in both records, SI.

    Attributes
    ----------
    name, unit : str
    before, after : float
    before_interval, after_interval : tuple of float
        95 % confidence intervals.
    changed : bool
        Whether it is claimed to be another after than before.
    gain : float
        Of the squared error that is gained by letting go of all parameters, the share that letting go of this one
        gained when it was its turn; of one that is not claimed, what it would gain beside those that are.
    """

    name: str
    unit: str
    before: float
    after: float
    before_interval: tuple[float, float]
    after_interval: tuple[float, float]
    changed: bool
    gain: float

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        records = ((self.before, self.before_interval), (self.after, self.after_interval))
        before, after = ({"value": value, "ci95": [number(end) for end in ends]} for value, ends in records)
        about = {"parameter": self.name, "unit": self.unit, "changed": self.changed, "gain": self.gain}
        return {**about, "before": before, "after": after}


@dataclass(frozen=True)
class _Fit:
    """The two records fitted with some parameters let go in the second."""

    free: tuple[str, ...]
    problem: Problem
    fit: FitResult
    error: float  # mean of the squared errors, over the noise


def changes(
    candidate: Candidate, data: Dataset, parameters: Sequence[str], starts: Sequence[str],
    fixed: Mapping[str, float], progress: Callable[[str], None] = lambda text: None,
) -> list[Change]:  # fmt: skip
    """Tell which parameters changed.

    Parameters
    ----------
    candidate : Candidate
        The model.
    data : Dataset
        Both records, joined, under the labels `BEFORE` and `AFTER`.
    parameters : sequence of str
        That may have changed.
    starts : sequence of str
        Start values that are estimated, in each record by itself.
    fixed : Mapping of str to float
        Where the search starts, and other values.

    Returns
    -------
    list of Change
        Those that are claimed first, in the order of what they explain.

    Raises
    ------
    UserError
        If the model cannot be simulated over the records.
    """
    search = Search(data, candidate.cls, [*parameters, *starts], fixed, progress)
    progress("fitting both records alike")
    shared = _fitted(search, candidate, (), [search.nominal().fit.values])
    alone = replace(search, data=data.runs_of([AFTER])).nominal().fit.values
    progress("fitting each record by itself")
    apart = {f"{n}@{AFTER}": alone[n] for n in parameters} | {n: v for n, v in alone.items() if base_name(n) != n}
    everything = _fitted(search, candidate, tuple(parameters), [shared.fit.values | apart, shared.fit.values])
    total = shared.error - everything.error
    best, gains, rest = shared, dict[str, float](), list(parameters)
    while rest and total > 0.0:
        progress(f"letting go of {', '.join(rest)}")
        origins = [best.fit.values, best.fit.values | everything.fit.values]
        tried = side_by_side(partial(_let_go, search, candidate, best.free, origins), rest)
        left = {n: (best.error - one.error) / total for n, one in zip(rest, tried, strict=True)}
        order = sorted(zip(rest, tried, strict=True), key=lambda pair: pair[1].error)
        name, one = order[0]
        if left[name] < RELEVANT or not _surely(one, name):
            gains |= left
            break
        best, gains[name] = one, left[name]
        rest.remove(name)
    reported = _fitted(search, candidate, tuple(parameters), [best.fit.values | everything.fit.values])
    return [_change(best, reported, name, gains.get(name, 0.0)) for name in (*best.free, *rest)]


def _let_go(
    search: Search, candidate: Candidate, free: tuple[str, ...], origins: Sequence[Mapping[str, float]], name: str
) -> _Fit:
    return _fitted(search, candidate, (*free, name), origins)


def _fitted(
    search: Search, candidate: Candidate, free: tuple[str, ...], origins: Sequence[Mapping[str, float]]
) -> _Fit:
    problem = search.problem(candidate, [*search.parameters, *(f"{n}@{AFTER}" for n in free)], search.fixed)
    starts = []
    for origin in origins:
        there = {name: origin.get(name, origin.get(base_name(name), problem.start[name])) for name in problem.names}
        starts.append(problem.inside(problem.position(there)))
    fit = fit_free_run(problem, starts)
    return _Fit(free, problem, fit, pooled_error(fit.residual, error_scales(problem)) ** 2)


def _difference(one: _Fit, name: str) -> tuple[float, float]:
    """By how much a parameter that was let go differs, in its searched coordinate, and the standard error of that."""
    i, j = one.problem.names.index(name), one.problem.names.index(f"{name}@{AFTER}")
    spread = one.fit.covariance.matrix
    variance = spread[i, i] + spread[j, j] - 2.0 * spread[i, j]
    known = not one.fit.covariance.unidentifiable[[i, j]].any()
    return float(one.fit.q[j] - one.fit.q[i]), float(np.sqrt(max(variance, 0.0))) if known else np.inf


def _surely(one: _Fit, name: str) -> bool:
    return significantly_different(*_difference(one, name))


def _change(best: _Fit, everything: _Fit, name: str, gain: float) -> Change:
    """What is to be said of a parameter: as it was claimed, or as each record by itself has it."""
    changed = name in best.free
    shown = best if changed else everything
    intervals = shown.problem.intervals(shown.fit.q, shown.fit.covariance.standard_errors)
    later, values = f"{name}@{AFTER}", shown.fit.values
    unit = shown.problem.declared[name].unit
    return Change(name, unit, values[name], values[later], intervals[name], intervals[later], changed, gain)
