"""Which candidate explains the record best: leads of all at the base model, scored over any, then fits of the best."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fmus.kit import Component, Effect
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.candidate import Candidate, label, own_parameters
from orchestration.discrepancy.candidates.outlook import Linearised, Outlook
from orchestration.discrepancy.candidates.score_test import Lead, amounts, leads
from orchestration.identify.noise import Noise
from orchestration.identify.prediction_error import BELIEF, Fitted, fit
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
PROMISING = 8  # effects that are fitted, if they are worth it
WORTH = 5.0  # fall that is expected of a fit, below which it cannot come to what is accepted
_BESIDE = 0.75, 1.33  # times what was found of a second parameter, to begin with once more
_ALIKE = 1e-6  # share of what an effect does, in power, below which other parameters do the same
_STRIDE = 1.0  # in searched coordinates, from the fitted model to where a fit starts


@dataclass(frozen=True)
class Data:
    """A record for the diagnosis, SI.

    Attributes
    ----------
    time : ndarray, shape (n,)
    inputs, measured : Mapping of str to ndarray, shape (n,)
        NaN in an output is a gap.
    linear : bool
        Whether inputs go linearly from sample to sample; else each is held until the next.
    """

    time: Array
    inputs: Mapping[str, Array]
    measured: Mapping[str, Array]
    linear: bool = False

    def only(self, outputs: Sequence[str]) -> Data:
        """Some of the outputs."""
        return replace(self, measured={o: y for o, y in self.measured.items() if o in outputs})

    def part(self, first: int, last: int) -> Data:
        """Samples from one to before another."""
        return self.where(slice(first, last))

    def where(self, cut: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Data:
        """Some of the samples."""
        inputs, measured = ({n: v[cut] for n, v in group.items()} for group in (self.inputs, self.measured))
        return replace(self, time=self.time[cut], inputs=inputs, measured=measured)


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

    @property
    def effect(self) -> type[Effect]:
        """The effect that was laid over the model last."""
        return self.candidate.effects[-1]

    @property
    def last(self) -> str:
        """Its name."""
        return label(self.effect)

    def over(self, base: Evidence, tried: int) -> float:
        """How much better than another by BIC, less what looking at many costs: twice the logarithm of their number."""
        extra = len(self.candidate.effects) - len(base.candidate.effects)
        return base.fitted.bic - self.fitted.bic - 2.0 * extra * float(np.log(max(tried, 1)))

    def p_value(self, base: Evidence, tried: int) -> float:
        """Probability of such a likelihood ratio without the effect, times the number of candidates."""
        ratio = base.fitted.deviance - self.fitted.deviance
        freedom = max(self.fitted.parameters - base.fitted.parameters, 1)
        return float(min(1.0, tried * chi2.sf(max(ratio, 0.0), freedom)))


@dataclass(frozen=True)
class Origin:
    """A fitted model, and where effects would move it.

    Attributes
    ----------
    evidence : Evidence
    seen : dict of type[Effect] to tuple of Problem and list of Lead
    """

    evidence: Evidence
    seen: dict[type[Effect], tuple[Problem, list[Lead]]]


@dataclass(frozen=True)
class Prospect:
    """An effect that may be worth a fit.

    Attributes
    ----------
    over : Evidence
        The model that it is laid over, from which the fit starts.
    effect : type[Effect]
    start : dict of str to float
        Its parameters where the fit starts, SI.
    outlook : Outlook
    """

    over: Evidence
    effect: type[Effect]
    start: dict[str, float]
    outlook: Outlook


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

    def nominal(self, belief: float = BELIEF) -> Evidence:
        """Fit the model without effects."""
        candidate = Candidate((), self.base)
        problem = self._problem(candidate)
        return Evidence(candidate, problem, self._fit(problem, problem.position(problem.start), None, belief))

    def look(self, below: Evidence, effects: Sequence[type[Effect]]) -> Origin:
        """Find where every effect would move a fitted model; it serves for what is laid over that model later, too."""
        seen: dict[type[Effect], tuple[Problem, list[Lead]]] = {}

        def one(effect: type[Effect]) -> None:
            candidate = below.candidate.with_effect(effect)
            self.progress(f"looking at {label(effect)}")
            try:
                problem = self._searching(candidate, own_parameters(effect), {**self.fixed, **below.fitted.values})
                seen[effect] = problem, leads(problem, effect)
                problem.forget()
            except UserError as error:
                self.unjudged[label(effect)] = str(error)

        side_by_side(one, effects)
        return Origin(below, seen)

    def silent(self, origin: Origin) -> dict[str, str]:
        """Effects that a record says nothing of, whatever they do, and why."""
        model = Linearised(origin.evidence.problem, origin.evidence.fitted)
        found = {}
        for effect, (_, seen) in origin.seen.items():
            if not any(column.any() for lead in seen for column in lead.columns.values()):
                found[label(effect)] = "it leaves no trace in what was measured"
            elif all(model.own(lead.columns) < _ALIKE for lead in seen):
                found[label(effect)] = "on this record other parameters do the same"
        return found

    def alike(self, origin: Origin, effect: type[Effect], others: Sequence[type[Effect]]) -> dict[str, float]:
        """Share of what an effect does, beyond the model it is laid over, that each of others does too."""
        model = Linearised(origin.evidence.problem, origin.evidence.fitted)
        seen = origin.seen[effect][1]
        share = model.alike(max(seen, key=lambda lead: model.falls(lead.columns, lead.least, lead.most)[1]).columns)
        looked = [other for other in others if other in origin.seen]

        def most(other: type[Effect]) -> float:
            # a little of it only: what a lot does may look like anything
            return max((share(seen.columns) for seen in origin.seen[other][1] if seen.least <= 0.0), default=0.0)

        return dict(zip(map(label, looked), side_by_side(most, looked), strict=True))

    def prospects(self, origin: Origin, effects: Sequence[type[Effect]]) -> list[Prospect]:
        """Effects that may be worth a fit over a fitted model, the most promising first."""
        model = Linearised(origin.evidence.problem, origin.evidence.fitted)
        looked = [effect for effect in effects if effect in origin.seen]
        falls = side_by_side(
            lambda effect: [model.falls(lead.columns, lead.least, lead.most) for lead in origin.seen[effect][1]], looked
        )
        # the noise as it was found may have swallowed a slow effect, and white noise knows nothing of colour: ask both
        chosen: dict[tuple[type[Effect], int], Lead] = {}
        for view in range(2):
            best = [
                (max(f[view] for f in found), effect, found)
                for effect, found in zip(looked, falls, strict=True)
                if found
            ]
            for _, effect, found in sorted(best, key=lambda row: -row[0])[:PROMISING]:
                k = max(range(len(found)), key=lambda k: found[k][view])
                chosen[effect, k] = origin.seen[effect][1][k]

        def expected(item: tuple[tuple[type[Effect], int], Lead]) -> Prospect:
            (effect, _), lead = item
            outlook = model.outlook(lead.columns, lead.least, lead.most)
            problem = origin.seen[effect][0]
            start = amounts(lead, problem, own_parameters(effect)[0], outlook.amount)
            return Prospect(origin.evidence, effect, start, outlook)

        result: dict[type[Effect], Prospect] = {}
        for prospect in sorted(side_by_side(expected, list(chosen.items())), key=lambda p: -p.outlook.fall):
            if prospect.outlook.fall > WORTH:
                result.setdefault(prospect.effect, prospect)
        return list(result.values())[:PROMISING]

    def extended(self, prospect: Prospect) -> Evidence:
        """Fit a model with one more effect."""
        below = prospect.over
        candidate = below.candidate.with_effect(prospect.effect)
        self.progress(f"fitting {candidate.name}")
        problem = self._problem(candidate)
        beside = below.problem.values(below.fitted.q + np.clip(prospect.outlook.step, -_STRIDE, _STRIDE))
        q = problem.position(problem.start | beside | prospect.start)
        return Evidence(candidate, problem, self._fit(problem, q, prospect.outlook.noise))

    def surer(self, found: Evidence) -> Evidence:
        """Fit once more from beside what was found: a kink or a time constant has several bests; and not at rest."""
        candidate, effect = found.candidate, found.effect
        best = found
        for name in own_parameters(effect)[1:]:
            for factor in _BESIDE:
                start = found.problem.start | found.fitted.values
                start[name] = float(np.clip(start[name] * factor, effect.declared[name].min, effect.declared[name].max))
                best = min(best, self._again(candidate, start, found), key=lambda e: e.fitted.bic)
        settled = not any(name.endswith("_start") for name in self.parameters)  # it is known where everything starts
        if not effect.output and effect.layout.states and not settled:
            starts = (*candidate.starts, *(f"{state.name}_start" for state in effect.layout.states))
            moving = replace(candidate, starts=starts)
            best = min(
                best, self._again(moving, best.problem.start | best.fitted.values, best), key=lambda e: e.fitted.bic
            )
        return best

    def _again(self, candidate: Candidate, start: Mapping[str, float], found: Evidence) -> Evidence:
        problem = self._problem(candidate)
        try:
            return Evidence(candidate, problem, self._fit(problem, problem.position(start), found.fitted.noise))
        except UserError:
            return found

    def refitted(self, found: Evidence) -> Evidence:
        """Fit a model that was found on another part of the record to this one."""
        self.progress(f"fitting {found.candidate.name} to all of the record")
        problem = self._problem(found.candidate)
        q = problem.position(problem.start | found.fitted.values)
        return Evidence(found.candidate, problem, self._fit(problem, q, found.fitted.noise))

    def _fit(self, problem: Problem, q: Array, noise: Mapping[str, Noise] | None, belief: float = BELIEF) -> Fitted:
        physical = np.array([name in self.parameters and not name.endswith("_start") for name in problem.names])
        return fit(problem, q, noise, physical, belief)

    def _problem(self, candidate: Candidate) -> Problem:
        return self._searching(candidate, [*self.parameters, *candidate.parameters, *candidate.starts], self.fixed)

    def _searching(self, candidate: Candidate, names: Sequence[str], fixed: Mapping[str, float]) -> Problem:
        data = self.data
        return Problem(candidate.cls, data.time, data.inputs, data.measured, names, fixed, data.linear)


def side_by_side(work: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
    """Do the same with each of several things, on all processors: simulations and compilers hold no other up."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            return list(pool.map(work, items))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
