"""The experiment that discriminates between alternatives: stimuli within a rig's limits, and the evidence to expect.

Each input has a menu of shapes between its limits. From the broadest excitation on, the shape of one input after the
other is exchanged for the one that raises the least evidence over all pairs of alternatives, either of them
being true; the best few are then judged with the wrong model refitted for good.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.holdout import HELD_OUT
from orchestration.discrepancy.design.expected_evidence import (
    Response,
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
from orchestration.discrepancy.parallel import side_by_side
from orchestration.discrepancy.selection.stepwise import Selection

Array = NDArray[np.float64]
Experiment = dict[str, Stimulus]
T = TypeVar("T")
ENOUGH = 10.0  # fall of BIC below which an experiment is not worth its time
_ROUNDS = 2  # of exchanging the shape of every input
_EVALUATED = 3  # experiments that are judged for good
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
    """An experiment that should tell alternatives apart.

    Attributes
    ----------
    stimuli : dict of str to Stimulus
        By input.
    duration, step : float
        Seconds.
    expected : list of ExpectedEvidence
        Of every ordered pair of alternatives; empty if nothing is known yet that could be told apart.
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
        """Evidence to expect for the pair that is the hardest to tell apart."""
        return min((e.bic for e in self.expected), default=float("nan"))

    @property
    def is_worthwhile(self) -> bool:
        """Whether the experiment is worth making."""
        return not self.least < ENOUGH

    def as_json(self) -> dict[str, Any]:
        """Figures and stimuli."""
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
        """Write the experiment.

        Parameters
        ----------
        component : str
            As ``ppy run`` finds it.
        comment : str
            What it is for, in a line.
        title : str

        Returns
        -------
        str
            It runs as it is, on the model of one of the alternatives, as far as physics goes: effects of a measurement
            cannot be laid over a component in an experiment and are left out.
        """
        declared = {v.name: v.unit for v in self.model.candidate.cls.layout.inputs}
        limits = "; ".join(
            f"{n} {low:g} to {high:g} {declared[n]}" for n, (low, high) in self.limits.items()
        )
        lines = [f"# {comment}", f"# Limits kept: {limits}.", *self._comments()]
        physics = [effect for effect in self.model.candidate.effects if not effect.output]
        lines += [f"title = {_text(title or self._title())}", f"component = {_text(component)}"]
        lines += [f"effects = {_value([effect.id for effect in physics])}"] if physics else []
        lines += [f'duration = "{self.duration:.10g} s"', f'step = "{self.step:.10g} s"']
        lines += [f"record = {_value(list(self.model.fit.residual))}", "", "[parameters]"]
        starts = self.model.candidate.cls.layout.start_parameters
        shown = {
            p.name
            for effect in self.model.candidate.effects
            if effect.output
            for p in effect.layout.parameters
        }
        lines += [
            f"{name} = {value!r}"
            for name, value in self.model.problem.runs[0].values(self.model.fit.values).items()
            if name not in shown and name not in starts
        ]
        for name, stimulus in self.stimuli.items():
            lines += ["", f"[inputs.{name}]", f"kind = {_text(stimulus.kind)}"]
            for key, value in stimulus.keys.items():
                unit = declared[name] if key in _AMOUNTS else ""
                lines.append(f"{key} = {_value(value, unit)}")
        return "\n".join(lines) + "\n"

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


# fits run side by side, and the matrices are narrow: a thread for each product would only wait for the others
@threadpool_limits.wrap(limits=1)
def design(
    selection: Selection,
    data: Dataset,
    limits: Limits | None = None,
    highest: float = np.inf,
    duration: float | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> DiscriminatingExperiment:
    """Design an experiment that tells alternatives apart.

    Parameters
    ----------
    selection : Selection
        Whose steps have alternatives; without any, every input is moved and nothing is expected of it.
    data : Dataset
        The whole record: its sampling and, unless given, its duration are those of the experiment.
    limits : Mapping of str to tuple of float, optional
        Of the rig by input, SI. Without them those that the component declares, and where it declares none what the
        record shows.
    highest : float
        Frequency, in Hz, above which nothing may be in a stimulus: no stay is shorter than half its period.
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
    length = float(data.time[-1] - data.time[0]) if duration is None else duration
    length = round(length / step) * step
    within = limits_of_inputs(selection.base, data, limits or {})
    shortest = max(2.0 * step, 0.5 / highest)
    layout = {v.name: v for v in selection.base.candidate.cls.layout.inputs}
    menus = {
        name: shapes_between(
            *ends, float(np.clip(layout[name].start, *ends)), length, step, shortest, seed
        )
        for seed, (name, ends) in enumerate(within.items(), start=1)
    }
    broad = {name: menu[0] for name, menu in menus.items()}
    groups = [
        [s.chosen, *s.alternatives[:_ALTERNATIVES]] for s in selection.steps if s.alternatives
    ]
    if not groups:
        return DiscriminatingExperiment(broad, length, step, [], selection.best, within)
    time = (
        np.arange(round((1.0 - HELD_OUT) * length / step) + 1, dtype=float) * step
    )  # what a diagnosis fits to
    search, chosen = _DesignSearch(groups, time, progress), broad
    for _ in range(_ROUNDS):
        before = chosen
        for name, menu in menus.items():
            chosen = search.best(
                [chosen, *({**chosen, name: new} for new in menu if new != chosen[name])]
            )
        if chosen == before:
            break
    best, expected = search.evaluated(chosen)
    return DiscriminatingExperiment(best, length, step, expected, groups[0][0], within)


class _DesignSearch:
    """Experiments that were tried, and what each makes one expect."""

    def __init__(
        self,
        groups: Sequence[Sequence[FittedCandidate]],
        time: Array,
        progress: Callable[[str], None],
    ):
        self.pairs = [pair for group in groups for pair in permutations(group, 2)]
        models = {id(model): model for group in groups for model in group}
        self.starts = {key: (model, at_rest(model)) for key, model in models.items()}
        self.time, self.progress = time, progress
        self.seen: list[tuple[float, Experiment]] = []

    def best(self, trials: Sequence[Experiment]) -> Experiment:
        """Return the trial of which most is to be expected of the hardest pair, as far as models are linear."""
        fresh = [trial for trial in trials if all(trial != seen for _, seen in self.seen)]
        self.seen += zip(side_by_side(self._least, fresh), fresh, strict=True)
        ranked = [
            next((least, seen) for least, seen in self.seen if seen == trial) for trial in trials
        ]
        return _best_broadest(ranked)

    def _least(self, chosen: Experiment) -> float:
        self.progress(f"trying {', '.join(f'{s.kind} {n}' for n, s in chosen.items())}")
        try:
            responses = self._responses(chosen)
        except UserError:
            return -np.inf
        return min(
            expected_delta_bic_linear(a, b, responses[id(a)], responses[id(b)])
            for a, b in self.pairs
        )

    def evaluated(self, chosen: Experiment) -> tuple[Experiment, list[ExpectedEvidence]]:
        """Return the chosen experiment, or one of the next best, judged with the wrong model refitted for good."""
        others = sorted((row for row in self.seen if row[1] != chosen), key=lambda row: -row[0])
        trials = [chosen, *(trial for least, trial in others[: _EVALUATED - 1] if least > -np.inf)]
        evaluated = side_by_side(self._expected, trials)
        rows = [
            (min(e.bic for e in expected), (trial, expected))
            for trial, expected in zip(trials, evaluated, strict=True)
        ]
        return _best_broadest(rows)

    def _expected(self, chosen: Experiment) -> list[ExpectedEvidence]:
        self.progress("refitting alternatives over a designed experiment")
        responses, inputs = self._responses(chosen), self._inputs(chosen)
        return [
            ExpectedEvidence(
                a.effect_name,
                b.effect_name,
                expected_delta_bic(
                    a, b, responses[id(a)], self.time, inputs, self.starts[id(b)][1]
                ),
            )
            for a, b in self.pairs
        ]

    def _inputs(self, chosen: Experiment) -> dict[str, Array]:
        return {name: stimulus.values(self.time) for name, stimulus in chosen.items()}

    def _responses(self, chosen: Experiment) -> dict[int, Response]:
        inputs = self._inputs(chosen)
        return {
            key: respond(model, self.time, inputs, q) for key, (model, q) in self.starts.items()
        }


def _best_broadest(ranked: Sequence[tuple[float, T]]) -> T:
    """Return the first that is about as good as the best: those before are broader, and tell of more."""
    best = max(value for value, _ in ranked)
    return next(
        item for value, item in ranked if value >= best - _ABOUT * abs(best) or value == best
    )


def _text(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _value(value: Any, unit: str = "") -> str:
    """Write a value of the experiment's file: a number, with its unit a text; several of them in a list."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(v, unit) for v in value)}]"
    if isinstance(value, str):
        return _text(value)
    return _text(f"{value!r} {unit}") if unit and unit != "1" else repr(value)
