"""Candidates fitted to the estimation data: the model without effects, and with one more effect laid over it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component, Effect
from fmus.kit.errors import UserError
from fmus.kit.sensors import transport_delay
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates.candidate import Candidate, own_parameters
from orchestration.discrepancy.candidates.evidence import FittedCandidate, ScreenedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.note import Note
from orchestration.identify.method import ALIKE, FULLY, GLANCE, Method
from orchestration.identify.noise.model import Noise
from orchestration.identify.prediction_error import PRIOR_STD, FitResult, fit, fit_free_run, trusted
from orchestration.identify.problem import Problem
from orchestration.identify.simulation_error import (
    error_at,
    error_scales,
    pooled_error,
    starting_points,
)
from orchestration.records.joined import base_name, names_in

Array = NDArray[np.float64]
_BESIDE = 0.75, 1.33  # times the fitted value of a second parameter, to begin with once more
# What may come of one fit of many; the others stand.
FAILURES = UserError, ArithmeticError, np.linalg.LinAlgError
# Times the least error of the nominal model's free run, which no noise model may take a fit beyond. Fits to slow noise
# of few independent samples are that far above the least, which follows the noise itself.
STRAYED = 1.25
# Internal steps per sample that an effect may take, or this share of those that the model may take in a short record: a
# bend may become sharper than anything seen between two samples.
_EFFORT, _EASIER = 25.0, 0.2
_STRIDE = 1.0  # in searched coordinates, from the fitted model to where a fit starts


@dataclass
class Search:
    """Fits of candidates to one record, or to several with one set of parameters.

    Attributes
    ----------
    data : Dataset
    base : type[Component]
    parameters : list of str
        Of the base model, searched in every candidate; the others have their values.
    fixed : Mapping of str to float
    progress : callable
        Told what is being done.
    budget : Budget
        Time that the search may take.
    not_assessed : dict of str to Note
        Effects of which the record says nothing, or that could not be simulated over it.
    each : sequence of str
        Parameters that differ from run to run. Where states start does so anyway.
    farthest : float
        Pooled error of the free run that no candidate may pass; known once the nominal model was fitted.
    freedom : Mapping of str to float
        Of the noise of every output, the same for all that are held against each other: which distribution fits what a
        model leaves may change from one point to the next, and with it the likelihood by more than an effect is worth.
    colour : Mapping of str to ndarray
        Coefficients of the noise's autoregression, where candidates are held against each other in the same noise;
        every one has its own unless given.
    method : Method
        How far fits go.
    patience : float
        How many times as many internal steps as usual a candidate with effects may take.
    """

    data: Dataset
    base: type[Component]
    parameters: Sequence[str]
    fixed: Mapping[str, float] = field(default_factory=dict)
    progress: Callable[[str], None] = lambda text: None
    budget: Budget = field(default_factory=Budget)
    not_assessed: dict[str, Note] = field(default_factory=dict)
    each: Sequence[str] = ()
    farthest: float = np.inf
    freedom: Mapping[str, float] = field(default_factory=dict)
    colour: Mapping[str, Array] = field(default_factory=dict)
    method: Method = FULLY
    patience: float = 1.0

    def nominal(self) -> FittedCandidate:
        """Fit the model without effects, from several starts."""
        candidate = Candidate((), self.base)
        problem = self._problem(candidate)
        free_run = fit_free_run(problem, starting_points(problem), self._physical(problem))
        self.farthest = STRAYED * pooled_error(free_run.residual, error_scales(problem))
        self.freedom = problem.freedom = {o: noise.freedom for o, noise in free_run.noise.items()}
        return FittedCandidate(
            candidate, problem, self._fit(problem, free_run.q, free_run.noise), free_run
        )

    def heard(self, base: FittedCandidate) -> tuple[Search, FittedCandidate]:
        """Leave out parameters of which the fitted model shows no trace: derivatives are what a simulation costs.

        Returns
        -------
        search, base
            The same if there are none.
        """
        traced = set(map(base_name, base.problem.traced(base.fit.q)))
        if traced.issuperset(self.parameters) or traced.isdisjoint(self.parameters):
            return self, base
        search = replace(self, parameters=[name for name in self.parameters if name in traced])
        kept = search.refit(base)
        return search, replace(
            kept, free_run=fit_free_run(kept.problem, [kept.fit.q], search._physical(kept.problem))
        )

    def near_nominal(self, prior_std: float) -> FittedCandidate:
        """Fit the model without effects, its physical parameters held close to nominal."""
        candidate = Candidate((), self.base)
        problem = self._problem(candidate)
        return FittedCandidate(
            candidate, problem, self._fit(problem, problem.position(problem.start), None, prior_std)
        )

    def trusted(
        self, fitted: FittedCandidate, below: FittedCandidate | None = None
    ) -> FittedCandidate:
        """Return a candidate as it is reported: with the fit of its free run where a noise model took over too much.

        Parameters
        ----------
        fitted : FittedCandidate
        below : FittedCandidate, optional
            The model that it is laid over. It contains that one, so if its free run is farther from the record, which
            a search that ran out of time may leave it at, it is fitted from there.
        """
        problem, scales = fitted.problem, error_scales(fitted.problem)
        known = (
            [problem.position(problem.start | fitted.free_run.values)] if fitted.free_run else []
        )
        free_run = fit_free_run(problem, [fitted.fit.q, *known], self._physical(problem))
        if below is not None and pooled_error(free_run.residual, scales) > pooled_error(
            below.fit.residual, scales
        ):
            at_rest = problem.position(problem.start | below.fit.values)
            free_run = fit_free_run(problem, [at_rest], self._physical(problem))
        return replace(fitted, fit=trusted(problem, fitted.fit, free_run), free_run=free_run)

    def fit_extended(
        self, screened: ScreenedCandidate, at_rest: FittedCandidate
    ) -> FittedCandidate:
        """Fit a model with one more effect, from where it is expected to end or from a model without it.

        Parameters
        ----------
        screened : ScreenedCandidate
        at_rest : FittedCandidate
            The model without the effect; the fit begins there unless where it is expected to end is nearer.
        """
        below = screened.below
        candidate = at_rest.candidate.with_effect(screened.effect)
        if (
            self._moving and getattr(screened.effect, "made_by", None) is transport_delay
        ):  # it shows the time before
            candidate = _moved(candidate, screened.effect)
        problem = self._problem(candidate)
        stepped = below.problem.values(
            below.fit.q + np.clip(screened.predicted.step, -_STRIDE, _STRIDE)
        )
        starts = [
            problem.position(problem.start | v | screened.start)
            for v in (stepped, at_rest.fit.values)
        ]
        begin = min(map(problem.inside, starts), key=lambda q: error_at(problem, q))
        return FittedCandidate(candidate, problem, self._fit(problem, begin, None))

    def refine(self, fitted: FittedCandidate) -> FittedCandidate:
        """Fit once more from beside the optimum: a kink or a time constant has several; and not at rest."""
        candidate, effect = fitted.candidate, fitted.effect
        best = fitted
        if self.budget.spent():
            return best
        for name in own_parameters(effect)[1:]:
            for factor in _BESIDE:
                start = fitted.problem.start | fitted.fit.values
                start[name] = float(
                    np.clip(
                        start[name] * factor, effect.declared[name].min, effect.declared[name].max
                    )
                )
                best = min(best, self._again(candidate, start, fitted), key=lambda e: e.fit.bic)
        if effect.layout.states and self._moving:
            moving = _moved(candidate, effect)
            best = min(
                best,
                self._again(moving, best.problem.start | best.fit.values, best),
                key=lambda e: e.fit.bic,
            )
        return best

    def renewed(self, fitted: FittedCandidate) -> FittedCandidate:
        """Look at the noise anew, now that a model explains more of a record, and fit it once more if that changed."""
        problem = fitted.problem
        problem.freedom = {}
        freedom = {o: noise.freedom for o, noise in problem.noise(fitted.fit.residual).items()}
        problem.freedom, changed = freedom, freedom != self.freedom
        self.freedom = freedom
        return replace(fitted, fit=self._fit(problem, fitted.fit.q, None)) if changed else fitted

    def refit(self, fitted: FittedCandidate) -> FittedCandidate:
        """Fit a model that was selected on another part of the record to this one."""
        self.progress(f"fitting {fitted.candidate.name} to all of the record")
        problem = self._problem(fitted.candidate)
        q = problem.position(problem.start | fitted.fit.values)
        return FittedCandidate(
            fitted.candidate, problem, self._fit(problem, q, fitted.fit.noise), fitted.free_run
        )

    def nested(self, below: FittedCandidate, richer: FittedCandidate) -> FittedCandidate:
        """Fit a model once more, from where one that contains it stands and in its noise; the likelier of the two.

        The degrees of freedom and the colour of noise have several optima. One that only the richer model has found is
        no evidence for what it has more.
        """
        again = self._again(below.candidate, richer.fit.values, richer)
        better = again is not richer and again.fit.bic < below.fit.bic
        return replace(below, problem=again.problem, fit=again.fit) if better else below

    def in_white_noise(self) -> Search:
        """Search for simulations that are near, whatever colour what they leave has: quickly."""
        return replace(self, colour={o: np.empty(0) for o in self.data.measured}, method=GLANCE)

    def in_noise_of(self, fitted: FittedCandidate) -> Search:
        """Search in the colour of what a candidate leaves, the same for all."""
        problem = fitted.problem
        problem.colour = {}
        noise = problem.noise(fitted.fit.residual)
        return replace(self, colour={o: n.coefficients for o, n in noise.items()}, method=ALIKE)

    def problem(
        self, candidate: Candidate, names: Sequence[str], fixed: Mapping[str, float]
    ) -> Problem:
        """Output-error problem of a candidate over this record, some of its parameters being searched."""
        data = self.data
        starts = (p.name for p in candidate.cls.layout.parameters if p.starts)
        searched = names_in(data.runs, names, [*self.each, *starts])
        made = Problem(
            candidate.cls,
            data.time,
            data.inputs,
            data.measured,
            searched,
            fixed,
            data.linear or (),
            runs=data.several,
        )
        made.out_of_time, made.freedom, made.colour = self.budget.spent, self.freedom, self.colour
        if candidate.effects:
            made.effort = self.patience * max(_EFFORT, _EASIER * made.effort)
        return made

    def _problem(self, candidate: Candidate) -> Problem:
        return self.problem(
            candidate, [*self.parameters, *candidate.parameters, *candidate.starts], self.fixed
        )

    def fit_from(
        self,
        candidate: Candidate,
        around: FittedCandidate,
        start: Mapping[str, float] | None = None,
    ) -> FittedCandidate:
        """Fit a candidate from where another stands, or from a point of its own, and in the noise of the other."""
        problem = self._problem(candidate)
        q = problem.position(problem.start | dict(around.fit.values if start is None else start))
        return FittedCandidate(
            candidate, problem, self._fit(problem, q, None if self.colour else around.fit.noise)
        )

    def _again(
        self, candidate: Candidate, start: Mapping[str, float], fitted: FittedCandidate
    ) -> FittedCandidate:
        try:
            return self.fit_from(candidate, fitted, start)
        except FAILURES:
            return fitted

    def _fit(
        self,
        problem: Problem,
        q: Array,
        noise: Mapping[str, Noise] | None,
        prior_std: float = PRIOR_STD,
    ) -> FitResult:
        fitted = fit(
            problem, q, noise, self._physical(problem), prior_std, self.method, self.farthest
        )
        problem.forget()  # of many candidates few are looked at again
        return fitted

    @property
    def _moving(self) -> bool:
        """Whether it is not known where everything starts."""
        return any(name in self.base.layout.start_parameters for name in self.parameters)

    def _physical(self, problem: Problem) -> NDArray[np.bool_]:
        """Which of the searched parameters have a prior."""
        return np.array(
            [
                base_name(n) in self.parameters and not problem.declared[n].starts
                for n in problem.names
            ]
        )


def _moved(candidate: Candidate, effect: type[Effect]) -> Candidate:
    """A candidate that is not at rest: where the states of an effect start is searched, too."""
    starts = (effect.layout.start_of[state.name] for state in effect.layout.states)
    return replace(candidate, starts=tuple(dict.fromkeys((*candidate.starts, *starts))))
