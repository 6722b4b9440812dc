"""Design of the experiment that discriminates between alternatives, within the limits of a rig.

Each input has a menu of shapes between its limits. From the broadest excitation on, the shape of
one input after the other is exchanged for the one that raises the least evidence over all pairs of
alternatives, either of them being true; the best few are then evaluated with the wrong model
refitted in full.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from typing import Any, TypeVar

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
from orchestration.discrepancy.design.stimuli import (
    Limits,
    Stimulus,
    limits_of_inputs,
    shapes_between,
)
from orchestration.discrepancy.parallel import parallel_map
from orchestration.discrepancy.selection import Selection

Experiment = dict[str, Stimulus]
T = TypeVar("T")
ENOUGH = 10.0  # fall of BIC below which an experiment is not worth its time
_ROUNDS = 2  # of exchanging the shape of every input
_EVALUATED = 3  # experiments that are evaluated in full
_ALTERNATIVES = 3  # of one step, the best, that are looked at
_ABOUT = 0.02  # relative difference of evidence that is none
_AMOUNTS = ("value", "levels", "initial")  # keys with the unit of the input


@dataclass(frozen=True)
class ExpectedEvidence:
    """Evidence to expect of an experiment.

    Attributes
    ----------
    true_model, candidate : str
        Effects.
    bic : float
        Expected fall of BIC in favour of the true one, if it is true and the other is refitted.
    """

    true_model: str
    candidate: str
    bic: float


@dataclass(frozen=True)
class DiscriminatingExperiment:
    """An experiment that should discriminate between alternatives.

    Attributes
    ----------
    stimuli : dict of str to Stimulus
        By input.
    duration, step : float
        Seconds.
    expected : list of ExpectedEvidence
        Of every ordered pair of alternatives; empty if there are none yet.
    model : FittedCandidate
        One of the alternatives, for a simulation of the experiment.
    limits : dict of str to tuple of float
        That were kept, by input, SI.
    """

    stimuli: dict[str, Stimulus]
    duration: float
    step: float
    expected: list[ExpectedEvidence]
    model: FittedCandidate
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def least(self) -> float:
        """Expected evidence for the pair with least of it; NaN without pairs."""
        return min((e.bic for e in self.expected), default=float("nan"))

    @property
    def is_worthwhile(self) -> bool:
        """True if the experiment is worth making."""
        return not self.least < ENOUGH

    def as_json(self) -> dict[str, Any]:
        """Return figures and stimuli."""
        return {
            "duration": self.duration,
            "step": self.step,
            "separates": self.is_worthwhile,
            "inputs": {name: {"kind": s.kind, **s.keys} for name, s in self.stimuli.items()},
            "expected": [
                {"true_model": e.true_model, "candidate": e.candidate, "delta_bic": e.bic}
                for e in self.expected
            ],
        }

    def toml(self, component: str, comment: str, title: str = "") -> str:
        """Return the experiment as ``ppy run`` reads it.

        Parameters
        ----------
        component : str
            As ``ppy run`` finds it.
        comment : str
            The purpose of the experiment, in a line.
        title : str

        Returns
        -------
        str
            It runs as it is, on the model of one of the alternatives, as far as physics goes:
            effects of a measurement cannot be laid over a component in an experiment and are left
            out.
        """
        declared = {v.name: v.unit for v in self.model.candidate.cls.layout.inputs}
        limits = "; ".join(
            f"{n} {low:g} to {high:g} {declared[n]}" for n, (low, high) in self.limits.items()
        )
        lines = [f"# {comment}", f"# Limits kept: {limits}.", *self._comments()]
        lines += [f"title = {_text(title or self._title())}", f"component = {_text(component)}"]
        physics = [effect.id for effect in self.model.candidate.effects if not effect.output]
        if physics:
            lines.append(f"effects = {_value(physics)}")
        lines += [f'duration = "{self.duration:.10g} s"', f'step = "{self.step:.10g} s"']
        lines += [f"record = {_value(list(self.model.fit.residual))}", "", "[parameters]"]
        lines += [f"{name} = {value!r}" for name, value in self._parameters().items()]
        for name, stimulus in self.stimuli.items():
            lines += ["", f"[inputs.{name}]", f"kind = {_text(stimulus.kind)}"]
            for key, value in stimulus.keys.items():
                unit = declared[name] if key in _AMOUNTS else ""
                lines.append(f"{key} = {_value(value, unit)}")
        return "\n".join(lines) + "\n"

    def _parameters(self) -> dict[str, float]:
        """Return the fitted parameters of the model, without those of effects of a measurement."""
        candidate = self.model.candidate
        left_out = set(candidate.cls.layout.start_parameters)
        for effect in candidate.effects:
            if effect.output:
                left_out |= {p.name for p in effect.layout.parameters}
        fitted = self.model.problem.runs[0].values(self.model.fit.values)
        return {name: value for name, value in fitted.items() if name not in left_out}

    def _title(self) -> str:
        names = list(dict.fromkeys(e.true_model for e in self.expected))
        return f"Telling apart {', '.join(names)}" if names else "Every input moves"

    def _comments(self) -> list[str]:
        if not self.expected:
            return []
        head = "# Expected fall of BIC in the diagnosis, which fits to the first two thirds:"
        rows = [
            f"#   if {e.true_model} is right, against {e.candidate} refitted: {e.bic:.1f}"
            for e in self.expected
        ]
        return [head, *rows, f"# Above {ENOUGH:g} is very strong evidence."]


@single_threaded
def design_experiment(
    selection: Selection,
    data: Dataset,
    limits: Limits | None = None,
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
    within = limits_of_inputs(selection.base, data, limits or {})
    menus = _menus(selection.base, within, length, step, max(2.0 * step, 0.5 / highest))
    broadest = {name: menu[0] for name, menu in menus.items()}
    groups = [
        [s.chosen, *s.alternatives[:_ALTERNATIVES]] for s in selection.steps if s.alternatives
    ]
    if not groups:
        return DiscriminatingExperiment(broadest, length, step, [], selection.best, within)
    fitted = round((1.0 - HELD_OUT) * length / step) + 1  # samples to which a diagnosis fits
    search = _DesignSearch(groups, np.arange(fitted, dtype=float) * step, progress)
    best, expected = search.evaluated(_improved(search, menus, broadest))
    return DiscriminatingExperiment(best, length, step, expected, groups[0][0], within)


def _menus(
    base: FittedCandidate,
    limits: Mapping[str, tuple[float, float]],
    duration: float,
    step: float,
    shortest: float,
) -> dict[str, list[Stimulus]]:
    """Return the shapes that every input may take, the broadest excitation first.

    Parameters
    ----------
    base : FittedCandidate
    limits : Mapping of str to tuple of float
        Of all inputs, SI.
    duration, step, shortest : float
        Of the experiment, of its samples, and the shortest stay at a level, s.
    """
    layout = {v.name: v for v in base.candidate.cls.layout.inputs}
    menus = {}
    for seed, (name, (low, high)) in enumerate(limits.items(), start=1):
        resting = float(np.clip(layout[name].start, low, high))
        menus[name] = shapes_between(
            low, high, resting, duration=duration, step=step, shortest=shortest, seed=seed
        )
    return menus


def _improved(
    search: _DesignSearch, menus: Mapping[str, Sequence[Stimulus]], start: Experiment
) -> Experiment:
    """Exchange the shape of one input after the other for a better one."""
    chosen = start
    for _ in range(_ROUNDS):
        before = chosen
        for name, menu in menus.items():
            others = [{**chosen, name: shape} for shape in menu if shape != chosen[name]]
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


def _text(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _value(value: Any, unit: str = "") -> str:
    """Write a value of the experiment's file.

    A number is a text with its unit, if it has one; several values are a list.
    """
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(v, unit) for v in value)}]"
    if isinstance(value, str):
        return _text(value)
    return _text(f"{value!r} {unit}") if unit and unit != "1" else repr(value)
