"""What changed between two records of one specimen: which parameters and effects are others after than before.

Both records are simulated with one set of parameters, and one parameter after the other is let go in the second record,
as long as that makes the simulation fit noticeably better (forward selection by the error of the free run). An effect
that is in one record only is no special case: the model has it in both, and its strength is what is let go.

A change is claimed where it is surely none of chance, neither in the colour and the changing level of the noise of both
records nor by how much single stretches of them disagree. The latter is what tells a change from an error of the model:
no model is quite right, and what is wrong with it bends every parameter, here more and there less.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm
from scipy.stats import t as student

from fmus.kit.declare import ParameterDeclaration
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates.candidate import Candidate, label, own_parameters
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.parallel import side_by_side
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.covariance import Covariance, clustered, covariance
from orchestration.identify.estimate import significantly_different
from orchestration.identify.metrics import number
from orchestration.identify.prediction_error import FitResult, fit_free_run
from orchestration.identify.problem import Problem
from orchestration.identify.simulation_error import error_scales, pooled_error, starting_points
from orchestration.records.joined import base_name

Array = NDArray[np.float64]
BEFORE, AFTER = "before", "after"
# Of what letting go of all parameters gains, in squared error, below which letting go of one more explains nothing: no
# model is quite right, and what is wrong with it bends every parameter a little.
RELEVANT = 0.02
_PERHAPS = 2.0  # standard errors from which on it is let go, so that it does not bend others, but not claimed
STRETCHES = 10  # of each record, that must agree about a change
ALPHA = 0.01  # that anything is claimed by chance, of all parameters together


@dataclass(frozen=True)
class Change:
    """One parameter in both records, SI.

    Attributes
    ----------
    name : str
    before, after : float
    before_interval, after_interval : tuple of float
        95 % confidence intervals.
    changed : bool
        Whether it is claimed to be another after than before.
    uncertain : bool
        Whether it surely is by the noise, but stretches of the records do not agree about it.
    gain : float
        Of the squared error that is gained by letting go of all parameters, the share that letting go of this one
        gained when it was its turn; of one that is not needed, what it would gain beside those that are. None where
        letting go of all gains no more than chance makes.
    declaration : ParameterDeclaration
        Its unit and range.
    effect : str
        Of which it is a parameter; empty for those of the model.
    neutral : float or None
        Value at which that effect does nothing, if this is its strength.
    """

    name: str
    before: float
    after: float
    before_interval: tuple[float, float]
    after_interval: tuple[float, float]
    changed: bool
    uncertain: bool
    gain: float | None
    declaration: ParameterDeclaration
    effect: str = ""
    neutral: float | None = None

    @property
    def unit(self) -> str:
        """Its SI unit."""
        return self.declaration.unit

    @property
    def lacking(self) -> tuple[bool, bool]:
        """Whether the record before, and the one after, may do without the effect that this is the strength of."""
        ends, value = (self.before_interval, self.after_interval), self.neutral
        none = [value is not None and low <= value <= high for low, high in ends]
        return none[0], none[1]

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        records = ((self.before, self.before_interval), (self.after, self.after_interval))
        before, after = (
            {"value": value, "ci95": [number(end) for end in ends]} for value, ends in records
        )
        about: dict[str, Any] = {"parameter": self.name, "unit": self.unit, "changed": self.changed}
        about |= {"uncertain": self.uncertain, "gain": self.gain}
        return {
            **about,
            **({"effect": self.effect} if self.effect else {}),
            "before": before,
            "after": after,
        }


@dataclass(frozen=True)
class _Fit:
    """The two records fitted with some parameters let go in the second."""

    free: tuple[str, ...]
    problem: Problem
    fit: FitResult
    error: float  # mean of the squared errors, over the noise


def changes(
    candidate: Candidate,
    data: Dataset,
    parameters: Sequence[str],
    own: Sequence[str],
    fixed: Mapping[str, float],
    progress: Callable[[str], None] = lambda text: None,
    budget: Budget | None = None,
) -> list[Change]:
    """Tell which parameters changed.

    Parameters
    ----------
    candidate : Candidate
        The model, with every effect that is in either record.
    data : Dataset
        All records, joined: the later one under the label `AFTER`, one or more from before under others.
    parameters : sequence of str
        That may have changed. Those of which neither record says anything are left out.
    own : sequence of str
        Start values, and what else is estimated in each record by itself.
    fixed : Mapping of str to float
        Where the search starts, and other values.
    progress : callable
    budget : Budget, optional
        Time that it may take; when it is spent, what was not tried is not claimed.

    Returns
    -------
    list of Change
        Those that are claimed first, in the order of what they explain.

    Raises
    ------
    UserError
        If the model cannot be simulated over the records.
    """
    # whether an effect is there at all is asked about where it is none, and not of the logarithm of its strength
    switches = {effect.neutral for effect in candidate.effects}
    neutral = {
        p.name: float(p.start) for p in candidate.cls.layout.parameters if p.name in switches
    }
    search = Search(
        data,
        candidate.cls,
        [*parameters, *own],
        dict(fixed) | neutral,
        progress,
        budget or Budget(),
        each=own,
    )
    told = _with_trace(search, candidate, parameters, fixed)
    search = replace(search, parameters=[*told, *own])
    progress("fitting both records alike")
    shared = _fitted(search, candidate, (), [fixed])
    progress("fitting each record by itself")
    one = replace(search, data=data.runs_of([AFTER]))
    alone = _fitted(one, candidate, (), [shared.fit.values, fixed], anywhere=True).fit.values
    apart = {f"{n}@{AFTER}": alone[n] for n in told} | {
        n: v for n, v in alone.items() if base_name(n) != n
    }
    everything = _fitted(
        search, candidate, tuple(told), [shared.fit.values | apart, shared.fit.values]
    )
    best, gains, rest = shared, dict[str, float](), list(told)
    total = shared.error - everything.error
    real = total > _by_chance(shared, len(told))
    while rest and total > 0.0:
        if search.budget.spent():
            search.budget.leave(rest)
            break
        progress(f"letting go of {', '.join(rest)}")
        origins = [best.fit.values, best.fit.values | everything.fit.values]
        tried = side_by_side(partial(_let_go, search, candidate, best.free, origins), rest)
        left = {n: (best.error - one.error) / total for n, one in zip(rest, tried, strict=True)}
        name, nearest = min(zip(rest, tried, strict=True), key=lambda pair: pair[1].error)
        difference, error = _difference(nearest, name)
        if left[name] < RELEVANT or abs(difference) < _PERHAPS * error:
            gains |= left
            break
        best, gains[name] = nearest, left[name]
        rest.remove(name)
    reported = _fitted(search, candidate, tuple(told), [best.fit.values | everything.fit.values])
    sure = [name for name in best.free if significantly_different(*_difference(best, name))]
    agreed = [name for name in sure if _agreed(best, name, len(told))]
    order = [*agreed, *(name for name in (*best.free, *rest) if name not in agreed)]
    owner = {name: label(effect) for effect in candidate.effects for name in own_parameters(effect)}
    found = [
        _change(
            best if n in agreed else reported, n, n in agreed, gains.get(n, 0.0) if real else None
        )
        for n in order
    ]
    return [
        replace(
            c,
            uncertain=c.name in sure and not c.changed,
            effect=owner.get(c.name, ""),
            neutral=neutral.get(c.name),
        )
        for c in found
    ]


def _by_chance(shared: _Fit, parameters: int) -> float:
    """What letting go of so many parameters takes off the mean of the squared errors where nothing changed (Wilks)."""
    samples = sum(len(e) for e in shared.fit.residual.values())
    return shared.error * float(chi2.isf(ALPHA, max(parameters, 1))) / samples


def _with_trace(
    search: Search, candidate: Candidate, parameters: Sequence[str], values: Mapping[str, float]
) -> list[str]:
    """Parameters that move anything that was measured; those of an effect do where it is at work."""
    problem = search.problem(candidate, parameters, values)
    return problem.traced(problem.inside(problem.position(problem.start)))


def _let_go(
    search: Search,
    candidate: Candidate,
    free: tuple[str, ...],
    origins: Sequence[Mapping[str, float]],
    name: str,
) -> _Fit:
    return _fitted(search, candidate, (*free, name), origins)


def _fitted(
    search: Search,
    candidate: Candidate,
    free: tuple[str, ...],
    origins: Sequence[Mapping[str, float]],
    anywhere: bool = False,
) -> _Fit:
    """Fit with some parameters let go, from given points, and from points a decade about nominal too if asked."""
    problem = search.problem(
        candidate, [*search.parameters, *(f"{n}@{AFTER}" for n in free)], search.fixed
    )
    starts = []
    for origin in origins:
        there = {
            name: origin.get(name, origin.get(base_name(name), problem.start[name]))
            for name in problem.names
        }
        starts.append(problem.inside(problem.position(there)))
    fit = fit_free_run(problem, [*starts, *(starting_points(problem) if anywhere else [])])
    return _Fit(free, problem, fit, pooled_error(fit.residual, error_scales(problem)) ** 2)


def _difference(one: _Fit, name: str, spread: Covariance | None = None) -> tuple[float, float]:
    """By how much a parameter that was let go differs, in its searched coordinate, and the standard error of that."""
    i, j = one.problem.names.index(name), one.problem.names.index(f"{name}@{AFTER}")
    known = spread or one.fit.covariance
    variance = known.matrix[i, i] + known.matrix[j, j] - 2.0 * known.matrix[i, j]
    sure = not known.unidentifiable[[i, j]].any()
    return float(one.fit.q[j] - one.fit.q[i]), float(
        np.sqrt(max(variance, 0.0))
    ) if sure else np.inf


def _agreed(one: _Fit, name: str, tried: int) -> bool:
    """Whether the stretches of both records agree about a difference.

    Their number is small, so Student's distribution tells how far off chance takes them; the threshold is for all
    parameters together.
    """
    difference, error = _difference(one, name, _between_stretches(one))
    threshold = float(student.isf(ALPHA / (2.0 * tried), STRETCHES - 1))
    return abs(difference) > threshold * error


def _between_stretches(one: _Fit) -> Covariance:
    """Covariance of a fit by how much stretches of its records disagree."""
    problem, scales = one.problem, error_scales(one.problem)
    number_of = np.zeros(len(problem.time), dtype=np.intp)
    for k, run in enumerate(problem.runs):
        count = run.last - run.first
        number_of[run.samples] = k * STRETCHES + np.arange(count) * STRETCHES // count
    residual, slopes = problem.evaluate(one.fit.q)
    jacobian = np.vstack([slopes[o] / scales[o] for o in slopes])
    errors = np.concatenate([residual[o] / scales[o] for o in slopes])
    stretches = np.concatenate([number_of[problem.present[o]] for o in slopes])
    return clustered(covariance(jacobian.T @ jacobian), jacobian, errors, stretches)


def _change(one: _Fit, name: str, changed: bool, gain: float | None) -> Change:
    """What is to be said of a parameter: as it was claimed, or as each record by itself has it."""
    few = float(student.ppf(0.975, STRETCHES - 1) / norm.ppf(0.975))
    errors = np.maximum(
        one.fit.covariance.standard_errors, few * _between_stretches(one).standard_errors
    )
    intervals = one.problem.intervals(one.fit.q, errors)
    later, values = f"{name}@{AFTER}", one.fit.values
    declared = one.problem.declared[name]
    return Change(
        name,
        values[name],
        values[later],
        intervals[name],
        intervals[later],
        changed,
        False,
        gain,
        declared,
    )
