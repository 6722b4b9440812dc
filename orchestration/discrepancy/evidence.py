"""Which candidate explains the record best: leads of all at the base model, scored over any, then fits of the best."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fmus.kit import Component, Effect
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidate import Candidate, label, own_parameters
from orchestration.discrepancy.leads import Lead, innovations, leads, score
from orchestration.discrepancy.regression import Fitted, fit, normal_inverse
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]


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
    _seen: dict[type[Effect], tuple[Problem, list[Lead]]] = field(default_factory=dict, init=False)

    def nominal(self) -> Evidence:
        """Fit the model without effects."""
        candidate = Candidate((), self.base)
        problem = self._problem(candidate)
        return Evidence(candidate, problem, self._fit(problem, problem.position(problem.start), None))

    def look(self, below: Evidence, effects: Sequence[type[Effect]]) -> None:
        """Find where every effect would move a fitted model; kept, for what is laid over it later too."""

        def one(effect: type[Effect]) -> None:
            candidate = below.candidate.with_effect(effect)
            self.progress(f"looking at {label(effect)}")
            try:
                problem = self._searching(candidate, own_parameters(effect), {**self.fixed, **below.fitted.values})
                self._seen[effect] = problem, leads(problem, effect)
            except UserError as error:
                self.unjudged[label(effect)] = str(error)

        side_by_side(one, effects)

    def scores(
        self, below: Evidence, effects: Sequence[type[Effect]]
    ) -> list[tuple[float, type[Effect], dict[str, float]]]:
        """Score every effect over a fitted model, the best first, with a point to start its fit from."""
        fitted = below.fitted
        left = np.concatenate([fitted.innovation[o] for o in fitted.noise])
        whiten = innovations(fitted.noise, below.problem.present)
        project = _projection(fitted.jacobian)

        def best(effect: type[Effect]) -> tuple[float, dict[str, float]]:
            problem, found = self._seen[effect]
            scored = [score(lead, left, whiten, project, problem, own_parameters(effect)[0]) for lead in found]
            return max(scored, key=lambda row: row[0], default=(0.0, {}))

        looked = [effect for effect in effects if effect in self._seen]
        found = side_by_side(best, looked)
        ranked = [(fall, effect, start) for effect, (fall, start) in zip(looked, found, strict=True)]
        return sorted(ranked, key=lambda row: -row[0])

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


def side_by_side(work: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
    """Do the same with each of several things, on all processors: simulations and compilers hold no other up."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            return list(pool.map(work, items))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _projection(jacobian: Array) -> Callable[[Array], Array]:
    """Return the projection onto the columns of a Jacobian, by its normal equations."""
    seen, inverse = normal_inverse(jacobian)
    return lambda column: jacobian[:, seen] @ (inverse @ (jacobian[:, seen].T @ column))
