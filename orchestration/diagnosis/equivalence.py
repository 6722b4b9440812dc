"""Equivalent causes: terms with which a model answers any input alike are one cause.

Two lags in series are two in parallel with other amounts, and a lag of a current is one of the
charge that has passed. No experiment tells such terms apart: they are one model in other parameters
(Ljung: System Identification, section 4.5). Each is fitted to the answer of the other to an input
that neither was fitted to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.conclude import Pairs
from orchestration.diagnosis.fitting import Fit, Point, Problem, fit
from orchestration.diagnosis.runs import Record, step_of
from orchestration.diagnosis.terms import Term
from orchestration.experiment.waveforms import multilevel

# of the power that a term adds to the answer, in which equivalent models may differ
_ALIKE = 1e-3
_NEAR = 0.3  # of what two causes explain, by which their predictions differ at most
_LEVELS = 25  # of every input, over its range in the record
_STAYS = (1 / 600.0, 1 / 150.0, 1 / 40.0, 1 / 10.0)  # of the trial, rising from part to part
_SAMPLES = 1000  # of the trial at most
_EXACT = 1e6  # weight of squared errors, beside which priors are nothing
_STEPS = 40


def equivalent_pairs(causes: Sequence[Cause], unexplained: Array) -> Pairs:
    """Return the pairs of causes, by their keys, that are one model in other parameters.

    A fault of a sensor is another cause than a law that acts like it: a sensor can be tested alone.

    Parameters
    ----------
    causes : sequence of Cause
    unexplained : ndarray, shape (n, ny)
        Errors of the model without terms, where causes are chosen.
    """
    of_laws = [cause for cause in causes if cause.is_of_a_law]
    return {
        frozenset((one.key, other.key))
        for one, other in combinations(of_laws, 2)
        if _are_near(one, other, unexplained)
        and _reproduces(one, other)
        and _reproduces(other, one)
    }


def _are_near(one: Cause, other: Cause, unexplained: Array) -> bool:
    """Return whether predictions by two causes are near beside what they explain."""
    apart = np.nanmean((one.judged.choosing - other.judged.choosing) ** 2)
    explained = np.nanmean((one.judged.choosing - unexplained) ** 2)
    return bool(apart < _NEAR**2 * explained)


def _reproduces(cause: Cause, other: Cause) -> bool:
    """Return whether a model answers as another, if its first term takes the place of the other's.

    But for a share of the power that the other's first term adds.
    """
    truth = other.judged.fit
    lead, own = _lead(other), _lead(cause)
    companions = tuple(term for term in truth.terms if term != lead and term.source != own.source)
    trial = _answer(truth)
    if trial is None:
        return False
    others = np.concatenate([np.zeros(0), *(truth.values_of(term) for term in companions)])
    fitted = cause.judged.fit
    values = np.append(others, fitted.values_of(own))
    with_own = _fitted(trial, (*companions, own), values, (truth, fitted))
    without = _fitted(trial, companions, others, (truth,))
    return with_own < _ALIKE * without


def _lead(cause: Cause) -> Term:
    term = cause.parts[0]
    assert isinstance(term, Term)
    return term


def _answer(truth: Fit) -> Problem | None:
    """Return the problem of fitting a model to another's answer to a trial input."""
    problem = truth.problem
    first = problem.records[0]
    step = step_of(first.time)
    time = first.time[0] + step * np.arange(min(len(first.time), _SAMPLES))
    seen = np.concatenate([record.inputs for record in problem.records])
    levels = [_levels(time - time[0], values, seed) for seed, values in enumerate(seen.T)]
    inputs = np.ascontiguousarray(np.array(levels).T.reshape(len(time), -1))
    inputs[0] = first.inputs[0]  # in equilibrium with which memories begin
    unknown = np.full((len(time), len(problem.spread)), np.nan)
    trial = Record(time, inputs, unknown, first.smooth, begin=first.begin, group=first.group)
    course = problem.run(trial, truth.point, truth.terms, truth.point.starts[0], sensitive=False)
    if course is None or not np.isfinite(course.outputs).all():
        return None
    measured = np.where(first.measured, course.outputs, np.nan)
    return replace(problem, records=(replace(trial, outputs=measured),), starts=problem.starts[:1])


def _levels(time: Array, values: Array, seed: int) -> Array:
    """Return random levels over the range of an input, with ever longer stays."""
    low, high = float(values.min()), float(values.max())
    if not low < high:
        return np.full(len(time), low)
    levels = np.linspace(low, high, _LEVELS).tolist()
    parts = []
    for number, part in enumerate(np.array_split(time, len(_STAYS))):
        stay = max(_STAYS[number] * float(time[-1]), float(time[1]))
        parts.append(multilevel(part, levels, (stay, 3.0 * stay), (seed, number)))
    return np.concatenate(parts)


def _fitted(trial: Problem, terms: Sequence[Term], values: Array, nearby: Sequence[Fit]) -> float:
    """Return the mean square that terms leave of an answer, from the parameters of nearby fits."""
    weights = [np.full(len(trial.spread), _EXACT)]
    points = [Point(one.point.q, values, one.point.starts[:1]) for one in nearby]
    fits = [fit(trial, terms, [point], weights, _STEPS) for point in points]
    return min((found.misfit**2 for found in fits if found is not None), default=np.inf)
