"""Which candidate explains the record best: scores of all at the base model, then fits of the promising ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fmus.kit import Component, Effect
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidate import Candidate, label, own_parameters
from orchestration.discrepancy.regression import Fitted, fit, normal_inverse
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
GRID = (0.2, 1.0, 5.0)  # times the default of an effect's second parameter, where its score is looked at
PROMISING = 8  # candidates that are fitted
_FLAT = 1e-10


@dataclass(frozen=True)
class Data:
    """A record for the diagnosis, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs, measured : Mapping of str to ndarray, shape (n,)
        NaN in an output is a gap.
    """

    time: Array
    inputs: Mapping[str, Array]
    measured: Mapping[str, Array]

    def part(self, first: int, last: int) -> Data:
        """Samples from one to before another."""
        cut = slice(first, last)
        inputs, measured = ({n: v[cut] for n, v in group.items()} for group in (self.inputs, self.measured))
        return Data(self.time[cut], inputs, measured)


@dataclass(frozen=True)
class Evidence:
    """A candidate with what the record says of it.

    Attributes
    ----------
    candidate : Candidate
    problem : Problem
    fitted : Fitted
    """

    candidate: Candidate
    problem: Problem
    fitted: Fitted

    def over(self, base: Evidence, tried: int) -> float:
        """How much better than another by BIC, less what looking at many costs: twice the logarithm of their number."""
        extra = len(self.candidate.effects) - len(base.candidate.effects)
        return base.fitted.bic - self.fitted.bic - 2.0 * extra * float(np.log(max(tried, 1)))

    def p_value(self, base: Evidence, tried: int) -> float:
        """Probability of such a likelihood ratio without the effect, times the number of candidates."""
        ratio = base.fitted.deviance - self.fitted.deviance
        freedom = max(self.fitted.parameters - base.fitted.parameters, 1)
        return float(min(1.0, tried * chi2.sf(max(ratio, 0.0), freedom)))


@dataclass
class Search:
    """Candidates over one record.

    Attributes
    ----------
    data : Data
    base : type[Component]
    parameters : list of str
        Of the base model, searched in every candidate; the others have their values.
    fixed : Mapping of str to float
    progress : callable
        Told what is being done.
    unjudged : dict of str to str
        Effects that could not be simulated over the record, and why.
    """

    data: Data
    base: type[Component]
    parameters: Sequence[str]
    fixed: Mapping[str, float] = field(default_factory=dict)
    progress: Callable[[str], None] = lambda text: None
    unjudged: dict[str, str] = field(default_factory=dict)

    def nominal(self) -> Evidence:
        """Fit the model without effects."""
        candidate = Candidate((), self.base)
        problem = self._problem(candidate)
        return Evidence(candidate, problem, self._fit(problem, problem.position(problem.start), None))

    def scores(
        self, below: Evidence, effects: Sequence[type[Effect]]
    ) -> list[tuple[float, type[Effect], dict[str, float]]]:
        """Score of every effect over a fitted model, the best first, with a point to start its fit from.

        The score is what the cost would fall by if the effect were small and everything linear (Rao's test): one
        simulation at the neutral value for each value of a second parameter.
        """
        found, project = [], _projection(below.fitted.jacobian)
        for effect in effects:
            self.progress(f"looking at {effect.id}")
            try:
                score, start = self._score(below, project, below.candidate.with_effect(effect), own_parameters(effect))
            except UserError as error:
                self.unjudged[label(effect)] = str(error)
                continue
            found.append((score, effect, start))
        return sorted(found, key=lambda row: -row[0])

    def extended(self, below: Evidence, effect: type[Effect], start: Mapping[str, float]) -> Evidence:
        """Fit a model with one more effect."""
        candidate = below.candidate.with_effect(effect)
        self.progress(f"fitting {candidate.name}")
        problem = self._problem(candidate)
        q = problem.position(problem.start | below.fitted.values | dict(start))
        return Evidence(candidate, problem, self._fit(problem, q, below))

    def _fit(self, problem: Problem, q: Array, below: Evidence | None) -> Fitted:
        physical = np.array([name in self.parameters and not name.endswith("_start") for name in problem.names])
        return fit(problem, q, below.fitted.noise if below else None, physical)

    def _problem(self, candidate: Candidate) -> Problem:
        return self._searching(candidate, [*self.parameters, *candidate.parameters], self.fixed)

    def _searching(self, candidate: Candidate, names: Sequence[str], fixed: Mapping[str, float]) -> Problem:
        return Problem(candidate.cls, self.data.time, self.data.inputs, self.data.measured, names, fixed)

    def _score(
        self, below: Evidence, project: Callable[[Array], Array], candidate: Candidate, own: Sequence[str]
    ) -> tuple[float, dict[str, float]]:
        switch, *others = own
        fitted = below.fitted
        problem = self._searching(candidate, own, {**self.fixed, **fitted.values})  # no other derivatives are needed
        at = problem.names.index(switch)
        left = np.concatenate([fitted.innovation[o] for o in fitted.innovation])
        best, where = -1.0, dict[str, float]()
        for values in _grid(others, problem.declared):
            q = problem.position(problem.start | values)
            jacobian = problem.evaluate(q)[1]
            column = np.concatenate([fitted.noise[o].whiten(j[:, at], problem.present[o]) for o, j in jacobian.items()])
            new = column - project(column)
            power = float(new @ new)
            if power <= _FLAT * float(column @ column):
                continue
            step = -float(new @ left) / power
            declared = problem.declared[switch]
            scale = problem.scales[at]
            value = float(np.clip(scale.value(step + scale.position(declared.start)), declared.min, declared.max))
            score = float(new @ left) ** 2 / power
            if value == declared.start:
                score = 0.0  # it would have to be on the other side of its range
            if score > best:
                best, where = score, values | {switch: value}
        return best, where


def _projection(jacobian: Array) -> Callable[[Array], Array]:
    """Return the projection onto the columns of a Jacobian, by its normal equations."""
    seen, inverse = normal_inverse(jacobian)
    return lambda column: jacobian[:, seen] @ (inverse @ (jacobian[:, seen].T @ column))


def _grid(names: Sequence[str], declared: Mapping[str, Any]) -> list[dict[str, float]]:
    """Points at which an effect's score is looked at: its second parameters at some multiples of their defaults."""
    points = [dict[str, float]()]
    for name in names:
        p = declared[name]
        values = sorted({float(np.clip(p.start * factor, p.min, p.max)) for factor in GRID})
        points = [point | {name: value} for point in points for value in values]
    return points
