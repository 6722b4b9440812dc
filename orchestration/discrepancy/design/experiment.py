"""Design of the experiment that discriminates between alternatives, within the limits of a rig.

Each input has a menu of shapes between its limits. From the broadest excitation on, the shape of
one input after the other is exchanged for the one that raises the least evidence over all pairs of
alternatives, either of them being true; the best few are then evaluated with the wrong model
refitted in full.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import permutations
from typing import TypeVar

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, single_threaded
from orchestration.discrepancy.candidates import FittedCandidate
from orchestration.discrepancy.data import HELD_OUT, Dataset
from orchestration.discrepancy.design.expected_evidence import (
    ExpectedResponse,
    at_rest,
    expected_delta_bic,
    expected_delta_bic_linear,
    respond,
)
from orchestration.discrepancy.parallel import parallel_map
from orchestration.discrepancy.selection import Selection
from orchestration.experiment.design import (
    DiscriminatingExperiment,
    ExpectedEvidence,
    Rehearsal,
    menu,
)

Experiment = dict[str, menu.Stimulus]
T = TypeVar("T")
_ROUNDS = 2  # of exchanging the shape of every input
_EVALUATED = 3  # experiments that are evaluated in full
_ALTERNATIVES = 3  # of one step, the best, that are looked at
_ABOUT = 0.02  # relative difference of evidence that is none


@single_threaded
def design_experiment(
    selection: Selection,
    data: Dataset,
    limits: menu.Limits | None = None,
    highest: float = np.inf,
    duration: float | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> DiscriminatingExperiment:
    """Design an experiment that discriminates between alternatives.

    Parameters
    ----------
    selection : Selection
        Whose steps have alternatives; without any, every input is moved and nothing is expected of
        it.
    data : Dataset
        The whole record: its sampling and, unless given, its duration are those of the experiment.
    limits : Mapping of str to tuple of float, optional
        Of the rig by input, SI. Without them those that the component declares, and where it
        declares none what the record shows.
    highest : float
        Frequency, in Hz, above which nothing may be in a stimulus: no stay is shorter than half its
        period.
    duration : float, optional
        Seconds.
    progress : callable
        Told what is being done.

    Returns
    -------
    DiscriminatingExperiment

    Raises
    ------
    UserError
        If a limit is of no input, or leaves nothing, or no stimulus can be simulated.
    """
    step = float(np.median(np.diff(data.time)))
    if duration is None:
        duration = float(data.time[-1] - data.time[0])
    length = round(duration / step) * step
    declared = selection.base.candidate.cls.layout.inputs
    within = menu.limits_of_inputs(declared, data.inputs, limits or {})
    shortest = max(2.0 * step, 0.5 / highest)
    menus = menu.menus(declared, within, duration=length, step=step, shortest=shortest)
    broadest = {name: shapes[0] for name, shapes in menus.items()}
    groups = [
        [s.chosen, *s.alternatives[:_ALTERNATIVES]] for s in selection.steps if s.alternatives
    ]
    if not groups:
        rehearsal = _rehearsal(selection.best)
        return DiscriminatingExperiment(broadest, length, step, [], rehearsal, within)
    fitted = round((1.0 - HELD_OUT) * length / step) + 1  # samples to which a diagnosis fits
    search = _DesignSearch(groups, np.arange(fitted, dtype=float) * step, progress)
    best, expected = search.evaluated(_improved(search, menus, broadest))
    rehearsal = _rehearsal(groups[0][0])
    return DiscriminatingExperiment(best, length, step, expected, rehearsal, within)


def _rehearsal(model: FittedCandidate) -> Rehearsal:
    """Return a fitted model as an experiment runs it, without its effects of a measurement."""
    candidate = model.candidate
    left_out = set(candidate.cls.layout.start_parameters)
    for effect in candidate.effects:
        if effect.output:
            left_out |= {p.name for p in effect.layout.parameters}
    values = model.problem.runs[0].values(model.fit.values)
    return Rehearsal(
        {v.name: v.unit for v in candidate.cls.layout.inputs},
        list(model.fit.residual),
        {name: value for name, value in values.items() if name not in left_out},
        [effect.id for effect in candidate.effects if not effect.output],
    )


def _improved(
    search: _DesignSearch, menus: Mapping[str, Sequence[menu.Stimulus]], start: Experiment
) -> Experiment:
    """Exchange the shape of one input after the other for a better one."""
    chosen = start
    for _ in range(_ROUNDS):
        before = chosen
        for name, shapes in menus.items():
            others = [{**chosen, name: shape} for shape in shapes if shape != chosen[name]]
            chosen = search.best([chosen, *others])
        if chosen == before:
            break
    return chosen


class _DesignSearch:
    """Experiments that were tried, with the evidence to expect of each.

    Parameters
    ----------
    groups : sequence of sequence of FittedCandidate
        Alternatives that explain the same.
    time : ndarray, shape (n,)
        Seconds.
    progress : callable
        Told what is being done.
    """

    def __init__(
        self,
        groups: Sequence[Sequence[FittedCandidate]],
        time: Array,
        progress: Callable[[str], None],
    ):
        self._pairs = [pair for group in groups for pair in permutations(group, 2)]
        models = {id(model): model for group in groups for model in group}
        self._starts = {key: (model, at_rest(model)) for key, model in models.items()}
        self._time = time
        self._progress = progress
        self._experiments: list[Experiment] = []  # that were tried
        self._least_evidence: list[float] = []  # of each

    def best(self, trials: Sequence[Experiment]) -> Experiment:
        """Return the trial with most evidence for the hardest pair, as far as models are linear."""
        fresh = [trial for trial in trials if trial not in self._experiments]
        self._least_evidence += parallel_map(self._least, fresh)
        self._experiments += fresh
        ranked = []
        for trial in trials:
            place = self._experiments.index(trial)
            ranked.append((self._least_evidence[place], self._experiments[place]))
        return _best_broadest(ranked)

    def evaluated(self, chosen: Experiment) -> tuple[Experiment, list[ExpectedEvidence]]:
        """Return the chosen experiment, or one of the next best, with the wrong model refitted."""
        tried = zip(self._least_evidence, self._experiments, strict=True)
        others = sorted((row for row in tried if row[1] != chosen), key=lambda row: -row[0])
        next_best = [trial for least, trial in others[: _EVALUATED - 1] if least > -np.inf]
        trials = [chosen, *next_best]
        ranked = []
        for trial, expected in zip(trials, parallel_map(self._expected, trials), strict=True):
            ranked.append((min(e.bic for e in expected), (trial, expected)))
        return _best_broadest(ranked)

    def _least(self, chosen: Experiment) -> float:
        """Return the evidence for the hardest pair, as far as models are linear."""
        self._progress(f"trying {', '.join(f'{s.kind} {n}' for n, s in chosen.items())}")
        try:
            responses = self._responses(chosen)
        except UserError:
            return -np.inf
        return min(
            expected_delta_bic_linear(a, b, responses[id(a)], responses[id(b)])
            for a, b in self._pairs
        )

    def _expected(self, chosen: Experiment) -> list[ExpectedEvidence]:
        """Return the evidence for every pair, with the wrong model refitted."""
        self._progress("refitting alternatives over a designed experiment")
        inputs = self._inputs(chosen)
        responses = self._responses(chosen)
        result = []
        for a, b in self._pairs:
            start = self._starts[id(b)][1]
            bic = expected_delta_bic(a, b, responses[id(a)], self._time, inputs, start)
            result.append(ExpectedEvidence(a.effect_name, b.effect_name, bic))
        return result

    def _inputs(self, chosen: Experiment) -> dict[str, Array]:
        return {name: stimulus.values(self._time) for name, stimulus in chosen.items()}

    def _responses(self, chosen: Experiment) -> dict[int, ExpectedResponse]:
        inputs = self._inputs(chosen)
        return {
            key: respond(model, self._time, inputs, q) for key, (model, q) in self._starts.items()
        }


def _best_broadest(ranked: Sequence[tuple[float, T]]) -> T:
    """Return the first that is about as good as the best: those before are broader."""
    best = max(value for value, _ in ranked)
    return next(
        item for value, item in ranked if value >= best - _ABOUT * abs(best) or value == best
    )
