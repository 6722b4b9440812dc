"""Fits of candidates to the estimation data: the model without effects, and with one more."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fmus.kit import Component, Effect, UserError
from fmus.kit.arrays import Array, Mask
from fmus.kit.effects import made_with
from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.candidates import (
    Candidate,
    FittedCandidate,
    ScreenedCandidate,
    own_parameters,
)
from orchestration.discrepancy.data import OVER_RECORD, Dataset, telling_of_simulation
from orchestration.discrepancy.note import Note
from orchestration.discrepancy.selection.known_fits import KnownFits, fit_key
from orchestration.identify.fitting import (
    EVALUATE,
    FIXED_COLOUR,
    FULL,
    PRIOR_STD,
    SCREEN,
    FitResult,
    Method,
    Problem,
    choose_credible_fit,
    error_at,
    error_scales,
    fit_free_run,
    fit_prediction_error,
    nearest_free_run,
    pooled_error,
    starting_points,
)
from orchestration.identify.noise import Noise
from orchestration.records.runs import base_name, names_in

_BESIDE = 0.75, 1.33  # times the fitted value of a second parameter, to start from once more
# Errors that end one fit of many; the others stand.
_STEEPEST = 1e100  # of a derivative, by a parameter that may be small; its square is a number
_RUNAWAY = 1e30  # of a signal, as nothing measured is that large; its powers are still numbers
FAILURES = UserError, ArithmeticError, np.linalg.LinAlgError
# Times the least error of the nominal model's free run, which no noise model may take a fit beyond.
# Fits to slow noise of few independent samples are that far above the least, which follows the
# noise itself.
STRAYED = 1.25
# Internal steps per sample that an effect may take, or this share of those that the model may take
# in a short record: a bend may become sharper than anything seen between two samples. In a free
# response it may take all of them, as dry friction does that holds a plant.
_EFFORT = 25.0
_EASIER = 0.2
# Accuracy of internal steps: a thousandth of the noise of a good record. It costs less than half of
# what the accuracy of an FMU does where a model bends sharply.
_TOLERANCE = 1e-6
_BEHIND = 6.0  # of BIC, after its first steps, behind which a fit from beside an optimum ends
# of the way between two samples at a typical velocity, in which a slide has given: by less, it is
# friction that changes sign at once, at the price of ever shorter internal steps
_AT_ONCE = 0.1
# of BIC, a sample, by which two simulations of one model may differ: that is a two-hundredth of the
# deviation of the noise, which internal steps of their own make where noise is small
_ROUNDING = 0.01
_LOG = logging.getLogger(__name__)
_LOG.addHandler(logging.NullHandler())  # a fault of ours, which users do not see on their screens
_STRIDE = 1.0  # in searched coordinates, from the fitted model to where a fit starts
# Of every run, the beginnings that a free response is fitted to one after the other: from about a
# period of what swings 30 times, and by no more at once than its period is known for by then.
_BEGINNINGS = 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2
_FEWEST = 30  # samples of such a beginning
_MISSED = 2.0  # times the noise, from which on a simulation may be out of step with a record


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
        Pooled error of the free run that no candidate may pass; known once the nominal model was
        fitted.
    freedom : Mapping of str to float
        Of the noise of every output, the same for all that are held against each other: which
        distribution fits what a model leaves may change from one point to the next, and with it the
        likelihood by more than an effect is worth.
    colour : Mapping of str to ndarray
        Coefficients of the noise's autoregression, where candidates are held against each other in
        the same noise; every one has its own unless given.
    method : Method
        Effort of the fits.
    patience : float
        Factor on the internal steps that a candidate with effects may take.
    shortest_lag : float
        Time constant of a memory, s, from which on down a search steps back: the lag is none.
    free : bool
        Whether the record is a free response, which nothing keeps in step with a simulation.
    known : KnownFits
        Fits made so far, over this record and over others.
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
    method: Method = FULL
    patience: float = 1.0
    shortest_lag: float = 0.0
    free: bool = False
    known: KnownFits = field(default_factory=KnownFits)

    def nominal(self, near: Mapping[str, float] | None = None) -> FittedCandidate:
        """Fit the model without effects, from several starts, or from near where it should end."""
        candidate = Candidate((), self.base)
        problem = self._problem(candidate)
        if near is None:
            starts = starting_points(problem)
            if self.free:
                starts = [*self._from_beginnings(candidate, starts[0]), *starts]
        else:
            starts = [problem.inside(problem.position(problem.start | dict(near)))]
        method = FULL if near is None else self.method
        with telling_of_simulation(self.base, OVER_RECORD):
            free_run = fit_free_run(problem, starts, self._has_prior(problem), method=method)
            _refuse_runaway(problem, free_run)
        self.farthest = STRAYED * pooled_error(free_run.residual, error_scales(problem))
        self.freedom = problem.freedom = {o: noise.freedom for o, noise in free_run.noise.items()}
        fit = self._fit(candidate, problem, free_run.q, free_run.noise)
        return FittedCandidate(candidate, problem, fit, free_run)

    def free_run(self) -> tuple[Problem, FitResult]:
        """Fit the free run of the model without effects quickly, from nominal alone."""
        problem = self._problem(Candidate((), self.base))
        start = problem.inside(problem.position(problem.start))
        return problem, fit_free_run(problem, [start], self._has_prior(problem), method=SCREEN)

    def drop_insensitive(self, base: FittedCandidate) -> tuple[Search, FittedCandidate]:
        """Drop parameters without effect on what was measured, as derivatives are expensive.

        Returns
        -------
        search, base
            The same if there are none.
        """
        sensitive = set(map(base_name, base.problem.sensitive_parameters(base.fit.q)))
        if sensitive.issuperset(self.parameters) or sensitive.isdisjoint(self.parameters):
            return self, base
        search = replace(self, parameters=[name for name in self.parameters if name in sensitive])
        kept = search.refit(base)
        has_prior = search._has_prior(kept.problem)
        free_run = fit_free_run(kept.problem, [kept.fit.q], has_prior)
        return search, replace(kept, free_run=free_run)

    def near_nominal(self, prior_std: float) -> FittedCandidate:
        """Fit the model without effects, its physical parameters held close to nominal."""
        candidate = Candidate((), self.base)
        problem = self._problem(candidate)
        fit = self._fit(candidate, problem, problem.position(problem.start), None, prior_std)
        return FittedCandidate(candidate, problem, fit)

    def trusted(
        self, fitted: FittedCandidate, below: FittedCandidate | None = None
    ) -> FittedCandidate:
        """Return a candidate with the fit of its free run, if the noise model took over too much.

        Parameters
        ----------
        fitted : FittedCandidate
        below : FittedCandidate, optional
            The model that it is laid over. It contains that one, so if its free run is farther from
            the record, which a search that ran out of time may leave it at, it is fitted from
            there.
        """
        problem = fitted.problem
        scales = error_scales(problem)
        if self.method.near and fitted.free_run and _are_of_one_record(fitted.free_run, fitted.fit):
            chosen = choose_credible_fit(problem, fitted.fit, fitted.free_run)
            return replace(fitted, fit=chosen)
        starts = [fitted.fit.q]
        if fitted.free_run:
            starts.append(problem.position(problem.start | fitted.free_run.values))
        free_run = fit_free_run(problem, starts, self._has_prior(problem))
        if below is not None:
            error_below = pooled_error(below.fit.residual, scales)
            if pooled_error(free_run.residual, scales) > error_below:
                at_rest = problem.position(problem.start | below.fit.values)
                free_run = fit_free_run(problem, [at_rest], self._has_prior(problem))
        problem.forget_simulation()
        return replace(
            fitted, fit=choose_credible_fit(problem, fitted.fit, free_run), free_run=free_run
        )

    def fit_extended(
        self, screened: ScreenedCandidate, at_rest: FittedCandidate
    ) -> FittedCandidate:
        """Fit a model with one more effect, from its predicted parameters or the model scored.

        Parameters
        ----------
        screened : ScreenedCandidate
            The fit starts at the model that it was scored at, unless the predicted parameters are
            nearer to the record.
        at_rest : FittedCandidate
            The model without the effect.
        """
        below = screened.below
        candidate = at_rest.candidate.with_effect(screened.effect)
        if self._starts_unknown:  # where the model moves at the start, so does what it lacks
            candidate = _with_free_starts(candidate, screened.effect)
        problem = self._problem(candidate)
        step = np.clip(screened.predicted.step, -_STRIDE, _STRIDE)
        predicted = below.problem.values(below.fit.q + step)
        starts = [
            problem.inside(problem.position(problem.start | values | screened.start))
            for values in (predicted, below.fit.values)
        ]
        nearest = min(starts, key=lambda q: error_at(problem, q))
        if self.loses_step(at_rest):
            neutral = problem.inside(problem.position(problem.start | screened.start))
            starts = [nearest, *self._from_beginnings(candidate, neutral)]
            nearest = min(starts, key=lambda q: error_at(problem, q))
        return FittedCandidate(candidate, problem, self._fit(candidate, problem, nearest, None))

    def loses_step(self, fitted: FittedCandidate) -> bool:
        """Return whether a model may be out of step with a free response, far off as it is.

        What effects do to it there tells nothing of what they do to the plant.
        """
        if not self.free:
            return False
        return pooled_error(fitted.fit.residual, error_scales(fitted.problem)) > _MISSED

    def refine(self, fitted: FittedCandidate) -> FittedCandidate:
        """Fit once more from beside the optimum, where there may be others, and from rest."""
        candidate = fitted.candidate
        effect = fitted.effect
        best = fitted
        if self.budget.spent():
            return best
        for name in own_parameters(effect)[1:]:
            for factor in _BESIDE:
                start = fitted.parameters
                declared = effect.declared[name]
                start[name] = float(np.clip(start[name] * factor, declared.min, declared.max))
                begun = replace(self, method=SCREEN)._again(candidate, start, fitted)
                if begun.fit.bic > best.fit.bic + _BEHIND:
                    continue
                again = self._again(candidate, begun.parameters, begun)
                best = min(best, again, key=lambda e: e.fit.bic)
        if effect.layout.states and self._starts_unknown:
            resting = _without_free_starts(candidate, effect)
            again = self._again(resting, best.parameters, best)
            best = min(best, again, key=lambda e: e.fit.bic)
        return best

    def renewed(self, fitted: FittedCandidate) -> FittedCandidate:
        """Estimate the tails of the noise anew, and fit the model once more if they changed."""
        problem = fitted.problem
        problem.freedom = {}
        freedom = {o: noise.freedom for o, noise in problem.noise(fitted.fit.residual).items()}
        problem.freedom = freedom
        is_same = freedom == self.freedom
        self.freedom = freedom
        if is_same:
            return fitted
        fit = self._fit(fitted.candidate, problem, fitted.fit.q, None)
        return replace(fitted, fit=fit)

    def refit(self, fitted: FittedCandidate) -> FittedCandidate:
        """Fit a model that was selected on another part of the record to this one."""
        self.progress(f"fitting {fitted.candidate.name} to all of the record")
        problem = self._problem(fitted.candidate)
        q = problem.position(problem.start | fitted.fit.values)
        fit = self._fit(fitted.candidate, problem, q, fitted.fit.noise)
        return FittedCandidate(fitted.candidate, problem, fit, fitted.free_run)

    def refit_over(self, fitted: FittedCandidate, below: FittedCandidate) -> FittedCandidate:
        """Fit a model that was selected on a part of the record to all of it.

        The fit starts where that of the part ended, or with what the model below it has there
        instead, which may be nearer: a part does not tell every parameter.
        """
        self.progress(f"fitting {fitted.candidate.name} to all of the record")
        problem = self._problem(fitted.candidate)
        starts = [
            problem.inside(problem.position(problem.start | fitted.fit.values | dict(values)))
            for values in ({}, below.fit.values)
        ]
        nearest = min(starts, key=lambda q: error_at(problem, q))
        fit = self._fit(fitted.candidate, problem, nearest, None)
        return FittedCandidate(fitted.candidate, problem, fit)

    def nested(self, below: FittedCandidate, richer: FittedCandidate) -> FittedCandidate:
        """Fit a model once more from one that contains it, and return the likelier of the two fits.

        The degrees of freedom and the colour of noise have several optima. One that only the richer
        model has found is no evidence for what it has more.
        """
        again = self._again(below.candidate, richer.fit.values, richer)
        if again is richer or not again.fit.bic < below.fit.bic:
            return below
        return replace(below, problem=again.problem, fit=again.fit)

    def containing(self, fitted: FittedCandidate, below: FittedCandidate) -> FittedCandidate:
        """Return a fit of an extended model that scores as well as the model below it, at least.

        It contains that one, so that it is as likely with its effect at rest, and costs no more
        than its parameters. Where it ended in a worse optimum, it is fitted from there. It is a
        fault of the search, and logged, if that is no better.

        Parameters
        ----------
        fitted, below : FittedCandidate
            The latter is evaluated in noise of its own where its colour was that of another model:
            one is no likelier than the other because it stands in other noise.
        """
        if below.problem.colour and not self.colour:
            as_it_stands = replace(self, method=EVALUATE)
            below = as_it_stands._again(below.candidate, below.fit.values, below)
        extra = len(fitted.problem.names) - len(below.problem.names)
        samples = fitted.fit.samples
        least = below.fit.bic + extra * float(np.log(samples)) + _ROUNDING * samples
        if fitted.fit.bic <= least:
            return fitted
        again = self._again(fitted.candidate, below.fit.values, below)
        if again is below:  # it cannot be simulated at rest
            return fitted
        best = min(fitted, replace(again, free_run=fitted.free_run), key=lambda one: one.fit.bic)
        if best.fit.bic > least:
            excess = best.fit.bic - least
            _LOG.warning("%s scores %.3g below its base", best.candidate.name, excess)
        return best

    def in_white_noise(self) -> Search:
        """Return a quick search for near simulations, whatever the colour of their residual."""
        return replace(self, colour={o: np.empty(0) for o in self.data.measured}, method=SCREEN)

    def in_noise_of(self, fitted: FittedCandidate) -> Search:
        """Return a search in the colour of a candidate's residual, the same for all."""
        problem = fitted.problem
        problem.colour = {}
        noise = problem.noise(fitted.fit.residual)
        return replace(
            self, colour={o: n.coefficients for o, n in noise.items()}, method=FIXED_COLOUR
        )

    def problem(
        self, candidate: Candidate, names: Sequence[str], fixed: Mapping[str, float]
    ) -> Problem:
        """Return the output-error problem of a candidate over this record.

        Parameters
        ----------
        candidate : Candidate
        names : sequence of str
            Parameters that are searched.
        fixed : Mapping of str to float
            Values of others.
        """
        data = self.data
        starts = (p.name for p in candidate.cls.layout.parameters if p.starts)
        searched = names_in(data.runs, names, [*self.each, *starts])
        problem = Problem(
            candidate.cls,
            data.time,
            data.inputs,
            data.measured,
            searched,
            fixed,
            linear=data.linear or (),
            runs=data.several,
        )
        problem.out_of_time = self.budget.spent
        problem.freedom = self.freedom
        problem.colour = self.colour
        problem.tolerance = problem.model.fitted_tolerance = _TOLERANCE
        # a constant as long as the record makes an offset of any state that does not begin at rest
        longest = float(data.time[-1] - data.time[0])
        problem.largest = dict.fromkeys(_time_constants(candidate), longest)
        if candidate.effects and not self.free:
            problem.effort = self.patience * max(_EFFORT, _EASIER * problem.effort)
        problem.smallest = dict(_shortest_ways(candidate, float(np.median(np.diff(data.time)))))
        if self.shortest_lag:
            lags = (name for name in searched if name.endswith("_memory_constant"))
            problem.least = dict.fromkeys(lags, self.shortest_lag)
        return problem

    def _problem(self, candidate: Candidate) -> Problem:
        names = [*self.parameters, *candidate.parameters, *candidate.starts]
        return self.problem(candidate, names, self.fixed)

    def _from_beginnings(self, candidate: Candidate, start: Array) -> list[Array]:
        """Return where a fit to more and more of a free response ends; nothing where it fails.

        A simulation that swings at another frequency than the record is out of step with it after a
        few periods, and no nearer for a frequency that is a little better. The beginning of a
        record tells the frequency well enough for the next part of it.

        Parameters
        ----------
        candidate : Candidate
        start : ndarray, shape (p,)
            Point to begin at.
        """
        q = start
        for share in _BEGINNINGS:
            data = self.data.beginning(share)
            if any(np.isfinite(y).sum() < _FEWEST * len(data.runs) for y in data.measured.values()):
                continue
            problem = replace(self, data=data)._problem(candidate)
            try:
                q = nearest_free_run(problem, q, self._has_prior(problem))
            except FAILURES:
                return []
        return [q]

    def fit_from(
        self,
        candidate: Candidate,
        around: FittedCandidate,
        start: Mapping[str, float] | None = None,
    ) -> FittedCandidate:
        """Fit a candidate from another fit, or a start of its own, in the noise of the other."""
        problem = self._problem(candidate)
        q = problem.position(problem.start | dict(around.fit.values if start is None else start))
        fit = self._fit(candidate, problem, q, None if self.colour else around.fit.noise)
        return FittedCandidate(candidate, problem, fit)

    def fit_with(
        self,
        effects: Sequence[type[Effect]],
        around: FittedCandidate,
        start: Mapping[str, float] | None = None,
    ) -> FittedCandidate | None:
        """Fit a model with some of another's effects, in its noise.

        Parameters
        ----------
        effects : sequence of type[Effect]
        around : FittedCandidate
            The other.
        start : Mapping of str to float, optional
            Values to start from, others nominal; by default from the other model.

        Returns
        -------
        FittedCandidate or None
            None where that fails.
        """
        starts = {
            effect.layout.start_of[state.name]
            for effect in effects
            for state in effect.layout.states
        }
        free_starts = tuple(name for name in around.candidate.starts if name in starts)
        candidate = Candidate((), self.base, free_starts)
        for effect in effects:
            candidate = candidate.with_effect(effect)
        try:
            return self.fit_from(candidate, around, start)
        except FAILURES:
            return None

    def fit_without(self, fitted: FittedCandidate, effect: type[Effect]) -> FittedCandidate | None:
        """Fit a model without one of its effects; None where that fails."""
        return self.fit_with([e for e in fitted.candidate.effects if e is not effect], fitted)

    def _again(
        self, candidate: Candidate, start: Mapping[str, float], fitted: FittedCandidate
    ) -> FittedCandidate:
        """Fit a candidate from a start of its own; return the former fit where that fails."""
        try:
            return self.fit_from(candidate, fitted, start)
        except FAILURES:
            return fitted

    def _fit(
        self,
        candidate: Candidate,
        problem: Problem,
        q: Array,
        noise: Mapping[str, Noise] | None,
        prior_std: float = PRIOR_STD,
    ) -> FitResult:
        def made() -> FitResult:
            fitted = fit_prediction_error(
                problem,
                q,
                noise,
                self._has_prior(problem),
                prior_std,
                self.method,
                farthest=self.farthest,
            )
            problem.forget_simulation()  # of many candidates few are looked at again
            return fitted

        if self.budget.spent():
            return made()  # at its first point, which is none to be known by
        own = (self.base, prior_std, self.method, self.farthest, self.shortest_lag)
        key = (fit_key(candidate, problem, q, noise), own)
        return self.known.get(key, self.data, problem.samples, made)

    @property
    def _starts_unknown(self) -> bool:
        """True if any start value is searched."""
        return any(name in self.base.layout.start_parameters for name in self.parameters)

    def _has_prior(self, problem: Problem) -> Mask:
        """Return for every searched parameter whether it has a prior, a mask of shape (p,)."""
        return np.array(
            [
                base_name(name) in self.parameters and not problem.declared[name].starts
                for name in problem.names
            ]
        )


def _time_constants(candidate: Candidate) -> Iterator[str]:
    """Yield the time constants of a candidate's effects."""
    for effect in candidate.effects:
        own = set(own_parameters(effect))
        yield from (p.name for p in effect.layout.parameters if p.name in own and p.unit == "s")


def _shortest_ways(candidate: Candidate, period: float) -> Iterator[tuple[str, float]]:
    """Yield the ways until slides give, with the shortest of each that samples can tell from none.

    Parameters
    ----------
    candidate : Candidate
    period : float
        Between samples, s.
    """
    for effect in candidate.effects:
        given = made_with(effect)
        if given.get("kind") == "sliding":
            _, way = own_parameters(effect)
            yield way, _AT_ONCE * (given["scale"] or effect.declared[way].nominal) * period


def _are_of_one_record(one: FitResult, other: FitResult) -> bool:
    """Return whether two fits of a model are to as many samples, and not to a part and to all."""
    return one.samples == other.samples


def _with_free_starts(candidate: Candidate, effect: type[Effect]) -> Candidate:
    """Return a candidate in which the start values of an effect's states are searched, too."""
    return replace(candidate, starts=tuple(dict.fromkeys((*candidate.starts, *_starts(effect)))))


def _without_free_starts(candidate: Candidate, effect: type[Effect]) -> Candidate:
    """Return a candidate in which the states of an effect start at rest."""
    own = _starts(effect)
    return replace(candidate, starts=tuple(name for name in candidate.starts if name not in own))


def _starts(effect: type[Effect]) -> list[str]:
    """Return the start values of the states of an effect, but for clocks, which start with it."""
    layout = effect.layout
    return [layout.start_of[state.name] for state in layout.states if state.unit != "s"]


def _refuse_runaway(problem: Problem, fit: FitResult) -> None:
    """Refuse a fit of which a signal, or a derivative, is beyond all reason; UserError."""
    values = problem.start | fit.values
    ran = problem.model.run(
        problem.time, problem.inputs, values, problem.effort, problem.runs, problem.tolerance
    )
    kinds = (("", ran.signals, _RUNAWAY), ("a derivative of ", ran.sensitivities, _STEEPEST))
    for kind, courses, most in kinds:
        for name, course in courses.items():
            largest = float(np.abs(course).max(initial=0.0))
            if not largest < most:
                raise UserError(f"{kind}{name} runs away, to {largest:.0e}")
