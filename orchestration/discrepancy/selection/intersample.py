"""Whether each input is held or goes linearly between samples: its own course tells, and the fits may overrule it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from fmus.kit import Component
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.encompassing import Amount, encompassing
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.intersample import Course, course
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection.input_noise import disturbances, noisy_inputs, simulated
from orchestration.discrepancy.selection.search import Search

CLEAR = 10.0  # fall of BIC that overrules the course of an input: very strong evidence (Kass and Raftery 1995)
# Half a sample of an unknown lag looks a little like the other choice. Then a record asks for another amount of it
# than all: more than twice as much, and more than three standard errors from it.
_OTHERWISE, _SURELY = 1.0 / 3.0, 9.0
_MATTERS = 1.0  # standard errors by which a parameter must hang on the choice to be worth a remark


class Basis(StrEnum):
    """What a choice rests on."""

    GIVEN = "given"
    COURSE = "course"
    FIT = "fit"
    DEFAULT = "default"


@dataclass(frozen=True)
class Intersample:
    """What an input is taken to do between samples.

    Attributes
    ----------
    linear : bool
        Or held.
    basis : Basis
        What tells: it was given, the input's own course, the fits, or nothing.
    margin : float, optional
        Fall of BIC against the other choice, as the linearised model predicts it or as both fits have it; None where
        they were not held against each other.
    hangs : str
        Parameter that would surely be another with the other choice, where the fits do not tell; empty if none would.
    factor : float
        By which it would be another.
    """

    linear: bool
    basis: Basis
    margin: float | None = None
    hangs: str = ""
    factor: float = 1.0


def by_course(cls: type[Component], data: Dataset) -> dict[str, Intersample]:
    """Choose for every input that moves as its own course tells; it is held where that does not tell."""
    real = {v.name for v in cls.layout.inputs if v.type == "real"}
    chosen = {}
    for name, values in data.inputs.items():
        values = max((values[run.samples] for run in data.runs), key=lambda part: np.count_nonzero(np.diff(part)))
        kind = course(values) if name in real else Course.STEPS
        if kind is not Course.STILL:
            basis = Basis.DEFAULT if kind is Course.UNCLEAR else Basis.COURSE
            chosen[name] = Intersample(kind is Course.SMOOTH, basis)
    return chosen


def given(data: Dataset) -> dict[str, Intersample]:
    """What a dataset says of every input that moves."""
    named = data.inputs if data.linear is True else data.linear or ()
    return {n: Intersample(n in named, Basis.GIVEN) for n, values in data.inputs.items() if np.ptp(values) > 0.0}


def linear(chosen: dict[str, Intersample]) -> frozenset[str]:
    """Inputs that go linearly."""
    return frozenset(name for name, choice in chosen.items() if choice.linear)


def by_fit(
    search: Search, base: FittedCandidate, chosen: dict[str, Intersample]
) -> tuple[Search, FittedCandidate, dict[str, Intersample]]:
    """Let the record overrule the course of inputs.

    Every input is looked at with a simulation and no fit; where the record asks for another choice, the base model is
    fitted once more with it, and the likelier one is taken.

    Parameters
    ----------
    search : Search
    base : FittedCandidate
        The base model fitted with what was chosen.
    chosen : dict of str to Intersample
        By `by_course`.

    Returns
    -------
    search, base, chosen
        The same, or with what the record asks for.
    """
    real = {v.name for v in search.base.layout.inputs if v.type == "real"}
    names = [name for name, choice in chosen.items() if name in real and choice.basis is not Basis.GIVEN]
    if not names:
        return search, base, chosen
    now = linear(chosen)
    try:
        others = [simulated(search, base, replace(search.data, linear=now ^ {n})) for n in names]
        noise = disturbances(search, base, noisy_inputs(search.base, search.data))
        amounts = dict(zip(names, encompassing(base, others, noise), strict=True))
    except UserError:
        return search, base, chosen
    asked = {n for n, amount in amounts.items() if _asked(amount)}
    assessed = {n: _assessed(choice, base, amounts.get(n)) for n, choice in chosen.items()}
    if not asked:
        return search, base, assessed
    other = replace(search, data=replace(search.data, linear=now ^ asked))
    try:
        fitted = other.refit(base)
    except UserError:
        return search, base, assessed
    margin = base.fit.bic - fitted.fit.bic
    if margin < CLEAR:
        return search, base, assessed | {n: replace(assessed[n], margin=-margin) for n in asked}
    overruled = {n: Intersample(not chosen[n].linear, Basis.FIT, margin) for n in asked}
    return other, fitted, assessed | overruled


def _asked(amount: Amount) -> bool:
    """Whether a record asks for the other choice, and for no more of it than there is."""
    if not np.isfinite(amount.standard_error) or amount.margin < CLEAR:
        return False
    return amount.excess < max(_OTHERWISE * amount.margin, _SURELY)


def _assessed(choice: Intersample, base: FittedCandidate, amount: Amount | None) -> Intersample:
    """Add what the fitted model says of a choice that stands."""
    if amount is None or not np.isfinite(amount.standard_error):
        return choice
    margin = -amount.margin
    if margin >= CLEAR:
        return replace(choice, basis=Basis.FIT if choice.basis is Basis.DEFAULT else choice.basis, margin=margin)
    if choice.basis is Basis.COURSE and not choice.linear:  # nothing but an output stage rests between steps
        return replace(choice, margin=margin)
    problem, fit = base.problem, base.fit
    errors = fit.covariance.standard_errors
    turns = {
        n: (shift / error, problem.scales[i].value(fit.q[i] + shift) / fit.values[n])
        for i, (n, shift, error) in enumerate(zip(problem.names, amount.shift, errors, strict=True))
        if not problem.declared[n].starts and np.isfinite(error) and fit.values[n]
    }
    most = max(turns, key=lambda n: abs(turns[n][0]), default="")
    if not most or abs(turns[most][0]) < _MATTERS:
        return replace(choice, margin=margin)
    return replace(choice, margin=margin, hangs=most, factor=turns[most][1])


def remarks(chosen: dict[str, Intersample]) -> list[Note]:
    """What is to be said of choices: where an input is not simply held, and where a parameter hangs on it."""
    notes = []
    for name, choice in chosen.items():
        facts = {
            "course": "linear" if choice.linear else "held",
            "basis": str(choice.basis),
            "margin": choice.margin or 0.0,
        }
        if choice.hangs:
            notes.append(
                Note(NoteCode.INTERSAMPLE_OPEN, name, facts | {"parameter": choice.hangs, "factor": choice.factor})
            )
        elif choice.basis is not Basis.GIVEN and (choice.linear or choice.basis is Basis.FIT):
            notes.append(Note(NoteCode.INTERSAMPLE, name, facts))
    return notes
