"""Design of the experiment that tells causes apart, from their fits and their probabilities.

Of two causes, the evidence that a run is expected to give is half the squared difference of their
outputs, in widths of the noise of the best fit and by its independent samples: the expected log
likelihood ratio if one of them is true (Atkinson and Fedorov: The design of experiments for
discriminating between two rival models, Biometrika 62, 1975). A difference that parameters, values
of terms and start states could take up, within what the records at hand leave open in them, does
not count. Each input has a menu of shapes in its range; one after the other is exchanged for the
shape with which the true cause is expected to become most probable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations, zip_longest

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, single_threaded
from fmus.kit.registry import Excitation
from orchestration.diagnosis.cause import Cause
from orchestration.diagnosis.comparison import Judged
from orchestration.diagnosis.conclude import Conclusion
from orchestration.diagnosis.features import confidence, margin
from orchestration.diagnosis.fitting import Fit, Problem, independent_weights, mean_squares
from orchestration.diagnosis.options import Deadline
from orchestration.diagnosis.prediction import Forecast
from orchestration.diagnosis.runs import Record, step_of
from orchestration.diagnosis.search import Found
from orchestration.diagnosis.subject import start_prior
from orchestration.diagnosis.term_names import sentence
from orchestration.diagnosis.terms import NamedTerm, Term
from orchestration.experiment.design import (
    ENOUGH,
    DiscriminatingExperiment,
    ExpectedEvidence,
    Rehearsal,
    menu,
)

Experiment = dict[str, menu.Stimulus]

_MOST = 2400  # samples of a simulated run: four in the shortest stay of a menu
_ROUNDS = 2  # of exchanging the shape of every input
_MOST_TRIALS = 60
_SECONDS = 1.0  # of processor time, after which stiff models are tried no more
_ABOUT = 0.02  # relative fall of the loss that is none: what is tried first is broader
_LEAST = 1e-12  # mean square of errors, in squared spreads
_CERTAIN = 1e-9  # expected loss, nats, below which experiments are equally good


@dataclass(frozen=True)
class Design:
    """The experiment that tells causes apart, or why there is none.

    Attributes
    ----------
    experiment : DiscriminatingExperiment or None
    reason : str
        Why there is none; empty if there is one, or nothing to tell apart.
    is_futile : bool
        Whether that is because none would tell them apart.
    """

    experiment: DiscriminatingExperiment | None = None
    reason: str = ""
    is_futile: bool = False

    @property
    def notes(self) -> list[tuple[str, str, str]]:
        """The reason as a note of a diagnosis: code, subject and sentence."""
        code = "futile_experiment" if self.is_futile else "no_experiment"
        return [(code, "", self.reason)] if self.reason else []


@single_threaded
def design_experiment(
    found: Found,
    conclusion: Conclusion,
    recorded: Mapping[str, Array],
    time: Array,
    rig: Excitation,
) -> Design:
    """Design the experiment that tells the causes of a conclusion apart.

    Parameters
    ----------
    found : Found
    conclusion : Conclusion
        ``ambiguous``, or ``unexplained`` with several guesses; of others nothing is to be told
        apart. A file that is misread is looked into, and takes no part.
    recorded : Mapping of str to ndarray, shape (n,)
        Inputs of a record, by name, SI; one that is constant because the user says so stays.
    time : ndarray, shape (n,)
        Of that record, s; the experiment has its sampling and duration.
    rig : Excitation

    Returns
    -------
    Design

    Raises
    ------
    UserError
        If a limit is of no input, or leaves nothing.
    """
    group = [cause for cause in conclusion.causes if cause.probability > 0.0]
    if conclusion.verdict not in ("ambiguous", "unexplained") or len(group) < 2:
        return Design()
    if found.subject.observer is not None:
        return Design(
            reason="no experiment is designed, as free runs of the model drift: what they would"
            " tell is not known beforehand"
        )
    causes = [cause for cause in group if cause.reading is None]
    if len(causes) < 2:
        return Design(reason="no experiment is designed: a look at file and wiring tells more")
    model = found.subject.problem.model
    within = menu.limits_of_inputs(model.recorded, recorded, rig.ranges)
    if all(low == high for low, high in within.values()):
        return Design(reason="no experiment is designed: no input of the model may move")
    step = float(f"{np.median(np.diff(time)):.9g}")
    duration = float(f"{round(float(time[-1] - time[0]) / step) * step:.9g}")
    shortest = max(2.0 * step, 0.5 / rig.bandwidth)
    resting = menu.operating_values(model.recorded, recorded)
    shapes = menu.menus(resting, within, duration=duration, step=step, shortest=shortest)
    contest = _Contest(causes, found, duration, step)
    return contest.concluded(contest.improved(shapes), within)


class _Contest:
    """Causes that are simulated under the same stimuli.

    Parameters
    ----------
    causes : sequence of Cause
    found : Found
    duration, step : float
        Of the experiment and of its samples, s.
    """

    def __init__(self, causes: Sequence[Cause], found: Found, duration: float, step: float):
        self._causes = list(causes)
        self._rehearsal = _rehearsal(causes, found.base.fit)
        self._step = step
        shares = np.array([cause.probability for cause in causes])
        self._shares = shares / shares.sum()
        self._temper = found.temper
        best = min((cause.judged for cause in causes), key=lambda one: one.fit.misfit)
        problem = best.fit.problem
        self._model = problem.model
        self._time = np.linspace(0.0, duration, min(round(duration / step) + 1, _MOST))
        self._record = _after(problem, self._time)
        measured = self._record.measured
        weights = (_weights(best) / problem.spread**2)[measured]
        # of as many independent samples as the kernel counts in so long a record
        samples = duration / _sampling(problem)
        errors = mean_squares(np.concatenate(best.fit.errors))
        self._samples = float(samples * (_weights(best) * errors)[measured].sum())
        self._widths = np.sqrt(weights * samples / len(self._time))
        fits = [*(cause.judged.fit for cause in causes), found.base.fit]
        self._forecasts = [_forecast(one, self._record) for one in fits]
        self._tried: dict[str, Array | None] = {}
        self._deadline = Deadline(_SECONDS)

    def improved(self, shapes: Mapping[str, Sequence[menu.Stimulus]]) -> Experiment:
        """Return the broadest experiment with the shape of one input after the other exchanged.

        Parameters
        ----------
        shapes : Mapping of str to sequence of Stimulus
            That each input may take, the broadest first.
        """
        chosen = {name: menu_of_input[0] for name, menu_of_input in shapes.items()}
        least = self._loss(chosen)
        for _ in range(_ROUNDS):
            before = chosen
            for name, shape in _by_turns(shapes):
                trial = {**chosen, name: shape}
                loss = self._loss(trial)
                if loss < (1.0 - _ABOUT) * least:
                    chosen, least = trial, loss
            if chosen == before:
                break
        return chosen

    def concluded(self, chosen: Experiment, limits: dict[str, tuple[float, float]]) -> Design:
        """Return an experiment with what is expected of it, unless it tells nothing apart."""
        known = self._known(chosen)
        names = [cause.name for cause in self._causes]
        if known is None:
            return Design(
                reason="no experiment is designed: a cause runs away under every stimulus tried"
            )
        evidence, gained = known[:-1, :-1], known[:-1, -1]
        if 2.0 * evidence.max() < ENOUGH:
            return Design(
                reason=f"no experiment within the ranges of the inputs tells {', '.join(names)}"
                f" apart: the evidence would be {evidence.max():.1f} nat at most",
                is_futile=True,
            )
        expected = [
            ExpectedEvidence(names[i], names[j], 2.0 * float(evidence[i, j]))
            for i, j in permutations(range(len(names)), 2)
        ]
        leads = [cause.parts[0] for cause in self._causes]
        told = [sentence(self._model.cls, lead) for lead in leads if isinstance(lead, Term)]
        return Design(
            DiscriminatingExperiment(
                chosen,
                float(self._time[-1]),
                self._step,
                expected,
                self._rehearsal,
                limits,
                dict(zip(names, self._reached(evidence, gained), strict=True)),
                dict(zip(names, told, strict=True)),
            )
        )

    def _known(self, chosen: Experiment) -> Array | None:
        """Return the expected evidence (m + 1, m + 1) between any two causes and no term, nats.

        None if no more are to be tried, or one runs away.
        """
        key = repr(chosen)
        if key not in self._tried:
            if len(self._tried) >= _MOST_TRIALS or self._deadline.is_over():
                return None
            self._tried[key] = self._evidence(chosen)
        return self._tried[key]

    def _rivals(self, evidence: Array) -> Array:
        """Return the probability (m,) of all other causes over that of the true one."""
        odds = self._shares / self._shares[:, np.newaxis] * np.exp(-evidence / self._temper)
        return np.asarray(odds.sum(axis=1) - np.diag(odds))

    def _loss(self, chosen: Experiment) -> float:
        """Return the expected loss of a logarithmic score, nats."""
        known = self._known(chosen)
        if known is None:
            return np.inf
        rivals = self._rivals(known[:-1, :-1])
        return max(float(self._shares @ np.log1p(rivals)), _CERTAIN)

    def _reached(self, evidence: Array, gained: Array) -> list[float]:
        """Return the probability that each cause is expected to have, with both records diagnosed.

        By its features as `conclude` has them: a lead that is a small share of what it gains, and
        many words, say that further causes may do as well.
        """
        reached = []
        shares = 1.0 / (1.0 + self._rivals(evidence))
        for i, cause in enumerate(self._causes):
            leads = [
                cause.score - other.score + self._likelier(evidence[i, j])
                for j, other in enumerate(self._causes)
                if j != i
            ]
            gain = cause.comparison.gain + self._likelier(gained[i])
            expected = {
                "margin": margin(min(leads), gain, self._temper),
                "share": float(shares[i]),
                "words": cause.judged.words,
                "rise": 0.0,
            }
            reached.append(confidence(expected))
        return reached

    def _likelier(self, evidence: float) -> float:
        """Return evidence as a gain in log likelihood whose noise is what a fit leaves, nats."""
        return float(0.5 * self._samples * np.log1p(2.0 * evidence / self._samples))

    def _evidence(self, chosen: Experiment) -> Array | None:
        record = self._record
        for j, variable in enumerate(self._model.inputs):
            stimulus = chosen.get(variable.name)
            record.inputs[:, j] = (
                variable.start if stimulus is None else stimulus.values(self._time)
            )
        try:
            record = self._model.simulated(record)
        except UserError:
            return None
        rows, columns = [], []
        for forecast in self._forecasts:
            response = forecast.respond(record)
            if response is None:
                return None
            rows.append((response.outputs[:, record.measured] * self._widths).ravel())
            directions = response.directions[:, record.measured] * self._widths[:, np.newaxis]
            columns.append(directions.reshape(len(rows[-1]), -1))
        evidence = np.zeros((len(rows), len(rows)))
        for i, j in combinations(range(len(rows)), 2):
            far = _beyond(rows[i] - rows[j], np.hstack([columns[i], columns[j]]))
            evidence[i, j] = evidence[j, i] = far
        return evidence


def _weights(judged: Judged) -> Array:
    """Return weights (ny,) of squared errors in spreads; see `independent_weights`.

    A model that errs by more where nothing was fitted errs by that in an experiment, too.
    """
    weights = np.mean(independent_weights(judged.fit.errors), axis=0)
    fitted = mean_squares(np.concatenate(judged.fit.errors))
    unseen = mean_squares(judged.beyond)
    return np.asarray(weights * np.fmin(1.0, fitted / np.maximum(unseen, _LEAST)))


def _by_turns(
    shapes: Mapping[str, Sequence[menu.Stimulus]],
) -> Iterator[tuple[str, menu.Stimulus]]:
    """Yield each input with each of its shapes, the broadest shapes of all inputs first."""
    for same_rank in zip_longest(*shapes.values()):
        for name, shape in zip(shapes, same_rank, strict=True):
            if shape is not None:
                yield name, shape


def _beyond(difference: Array, directions: Array) -> float:
    """Return half the square of a difference (n,) that directions (n, m) do not take up, nats.

    Half the least ``|d - D z|^2 + |z|^2``: what a refit leaves, with what it costs.
    """
    along = directions.T @ difference
    information = directions.T @ directions + np.eye(directions.shape[1])
    taken = along @ np.linalg.solve(information, along)
    far = 0.5 * float(difference @ difference - taken)
    return max(far, 0.0) if np.isfinite(far) else 0.0


def _sampling(problem: Problem) -> float:
    """Return the time between two fitted samples, s."""
    return step_of(problem.records[0].time)


def _after(problem: Problem, time: Array) -> Record:
    """Return a record that is made after those of a problem, without values.

    A change at an instant has been by then, and values of the last record's own are as there.
    """
    last = max(float(record.time[-1]) for record in problem.records)
    measured = np.any([record.measured for record in problem.records], axis=0)
    begin = last + _sampling(problem)
    outputs = np.where(measured, 0.0, np.nan) + np.zeros((len(time), 1))
    inputs = np.empty((len(time), len(problem.model.inputs)))
    newest = problem.records[-1]
    return replace(newest, time=time + begin, inputs=inputs, outputs=outputs, begin=begin)


def _forecast(fitted: Fit, record: Record) -> Forecast:
    """Return a fit as it is simulated from its declared start, over the steps of a record."""
    problem = fitted.problem
    coarser = float(record.time[1] - record.time[0]) / _sampling(problem)
    substeps = int(np.ceil(problem.substeps * max(coarser, 1.0)))
    nothing = replace(record, outputs=np.full_like(record.outputs, np.nan))
    prior = start_prior(problem, nothing)
    return Forecast(
        replace(fitted, problem=replace(problem, substeps=substeps)), prior, record.group
    )


def _rehearsal(causes: Sequence[Cause], base: Fit) -> Rehearsal:
    """Return the model of the first cause that is laid over a component, or the one without terms.

    A law with a term, and an effect of a measurement, cannot be laid over one in an experiment.
    """
    model = base.problem.model
    for cause in causes:
        terms = [term for term in cause.terms if isinstance(term, NamedTerm)]
        effects = [model.effects[term.effect] for term in terms]
        if len(terms) == len(cause.parts) and not any(effect.output for effect in effects):
            return _rehearsed(cause.judged.fit, [effect.id for effect in effects])
    return _rehearsed(base, [])


def _rehearsed(fitted: Fit, effects: Sequence[str]) -> Rehearsal:
    problem = fitted.problem
    model = problem.model
    fitted_values = problem.parameters(fitted.point.q, problem.records[-1].group)
    values = {}
    for i in problem.searched:
        declared = model.parameters[i]
        values[declared.name] = float(np.clip(fitted_values[i], declared.min, declared.max))
    for term in fitted.terms:
        if isinstance(term, NamedTerm):
            pairs = zip(term.released, fitted.values_of(term), strict=True)
            values |= {one.name: one.value(value) for one, value in pairs}
    measured = np.any([record.measured for record in problem.records], axis=0)
    return Rehearsal(
        {v.name: v.unit for v in model.recorded},
        [o.name for o, seen in zip(model.outputs, measured, strict=True) if seen],
        values,
        effects,
    )
