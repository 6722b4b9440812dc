"""Experiment that discriminates between causes, with the evidence to expect, as TOML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fmus.kit import quoting
from orchestration.experiment.design.menu import Stimulus

# Fall of BIC from which on evidence is very strong (Kass and Raftery: Bayes factors, J. Am. Stat.
# Assoc. 90, 1995), and below which an experiment is not worth its time.
ENOUGH = 10.0
_AMOUNTS = ("value", "levels", "initial")  # keys with the unit of the input


@dataclass(frozen=True)
class ExpectedEvidence:
    """Evidence to expect of an experiment.

    Attributes
    ----------
    true_model, candidate : str
        Causes.
    bic : float
        Expected fall of BIC in favour of the true one, if it is true and the other is refitted.
    """

    true_model: str
    candidate: str
    bic: float


@dataclass(frozen=True)
class Rehearsal:
    """The part of a model on which an experiment can be simulated, without effects of sensors.

    Attributes
    ----------
    units : Mapping of str to str
        Of its inputs.
    outputs : sequence of str
        That are recorded.
    parameters : Mapping of str to float
        SI.
    effects : sequence of str
        That are laid over it, by id; those of a measurement cannot be.
    """

    units: Mapping[str, str]
    outputs: Sequence[str]
    parameters: Mapping[str, float] = field(default_factory=dict)
    effects: Sequence[str] = ()


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
    rehearsal : Rehearsal
        Of one of the alternatives.
    limits : dict of str to tuple of float
        That were kept, by input, SI.
    probabilities : dict of str to float
        That each alternative is expected to have if it is true; empty if they are not known.
    titles : dict of str to str
        Alternatives for people, by name; without one the name is used.
    """

    stimuli: dict[str, Stimulus]
    duration: float
    step: float
    expected: list[ExpectedEvidence]
    rehearsal: Rehearsal
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    probabilities: dict[str, float] = field(default_factory=dict)
    titles: dict[str, str] = field(default_factory=dict)

    @property
    def least(self) -> float:
        """Expected evidence for the pair with least of it; NaN without pairs."""
        return min((e.bic for e in self.expected), default=float("nan"))

    @property
    def is_worthwhile(self) -> bool:
        """True if the experiment discriminates between all alternatives."""
        return not self.least < ENOUGH

    @property
    def sentence(self) -> str:
        """The alternatives that the experiment separates, with the probability."""
        if not self.expected:
            return "An experiment in which every input moves shows all that a record can show."
        if self.probabilities:
            return " ".join([self._probabilities_sentence(), *self._alike_sentences()])
        hardest = min(self.expected, key=lambda e: e.bic)
        pair = f"{hardest.true_model} and {hardest.candidate}"
        if self.is_worthwhile:
            return (
                f"The experiment should tell {pair} apart: BIC would fall by {hardest.bic:.0f} or"
                " more."
            )
        return (
            f"No experiment within these limits that was looked at tells {pair} apart: BIC would"
            f" fall by {max(hardest.bic, 0.0):.1f} only."
        )

    def _probabilities_sentence(self) -> str:
        reached = [
            f"{_percent(share)} if it is {self.titles.get(name, name)}"
            for name, share in self.probabilities.items()
        ]
        shares = {*map(_percent, self.probabilities.values())}
        each = ", ".join(reached) if len(shares) > 1 else f"{shares.pop()}, whichever it is"
        return (
            "With the experiment the true one of these is expected to have a probability of"
            f" {each}."
        )

    def _alike_sentences(self) -> list[str]:
        """Return a sentence for each pair that the experiment does not separate."""
        pairs = {frozenset((e.true_model, e.candidate)): e for e in self.expected if e.bic < ENOUGH}
        named = [
            [self.titles.get(name, name) for name in (e.true_model, e.candidate)]
            for e in pairs.values()
        ]
        return [f"It does not tell {one} from {other}." for one, other in named]

    def as_json(self) -> dict[str, Any]:
        """Return figures and stimuli."""
        figures = {
            "duration": self.duration,
            "step": self.step,
            "separates": self.is_worthwhile,
            "inputs": {name: {"kind": s.kind, **s.keys} for name, s in self.stimuli.items()},
            "expected": [
                {"true_model": e.true_model, "candidate": e.candidate, "delta_bic": e.bic}
                for e in self.expected
            ],
        }
        return figures | ({"reached": dict(self.probabilities)} if self.probabilities else {})

    def toml(self, component: str, comment: str, title: str = "") -> str:
        """Return the experiment as ``ppy run`` reads it.

        Parameters
        ----------
        component : str
            As ``ppy run`` finds it.
        comment : str
            The purpose of the experiment, in a line.
        title : str
        """
        units = self.rehearsal.units
        limits = "; ".join(
            f"{n} {f'{low:g} to ' if low < high else ''}{high:g} {units[n]}"
            for n, (low, high) in self.limits.items()
        )
        comments = [f"# {comment}", f"# Limits kept: {limits}.", *self._comments()]
        lines = [quoting.visible(line) for line in comments]
        lines += [f"title = {_value(title or self._title())}", f"component = {_value(component)}"]
        if self.rehearsal.effects:
            lines.append(f"effects = {_value(list(self.rehearsal.effects))}")
        lines += [f'duration = "{self.duration:.10g} s"', f'step = "{self.step:.10g} s"']
        lines += [f"record = {_value(list(self.rehearsal.outputs))}", "", "[parameters]"]
        values = self.rehearsal.parameters
        lines += [f"{quoting.toml_key(name)} = {_value(value)}" for name, value in values.items()]
        for name, stimulus in self.stimuli.items():
            lines += ["", f"[inputs.{quoting.toml_key(name)}]", f"kind = {_value(stimulus.kind)}"]
            for key, value in stimulus.keys.items():
                unit = units[name] if key in _AMOUNTS else ""
                lines.append(f"{key} = {_value(value, unit)}")
        return "\n".join(lines) + "\n"

    def _title(self) -> str:
        names = list(dict.fromkeys(e.true_model for e in self.expected))
        return f"Telling apart {', '.join(names)}" if names else "Every input moves"

    def _comments(self) -> list[str]:
        if not self.expected:
            return []
        head = "# Expected fall of BIC in the diagnosis:"
        rows = [
            f"#   if {e.true_model} is right, against {e.candidate} refitted: {e.bic:.1f}"
            for e in self.expected
        ]
        reached = [
            f"# If {name} is right, its probability should be {_percent(share)}."
            for name, share in self.probabilities.items()
        ]
        return [head, *rows, f"# Above {ENOUGH:g} is very strong evidence.", *reached]


def _percent(share: float) -> str:
    """Return a probability in percent; not 100, which no experiment shows."""
    return "> 99 %" if share > 0.995 else f"{100.0 * share:.0f} %"


def _value(value: Any, unit: str = "") -> str:
    """Write a value of the experiment's file.

    A number is a text with its unit, if it has one; several values are a list.
    """
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(v, unit) for v in value)}]"
    if isinstance(value, str):
        return quoting.toml(value)
    return quoting.toml(f"{value!r} {unit}") if unit and unit != "1" else repr(value).lower()
