"""Whether each input is held or goes smoothly between samples: its own course tells, and the fits may overrule it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import expit, ndtr
from scipy.stats import norm

from fmus.kit import Component
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.encompassing import Amount, encompassing
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.intersample import Course, course
from orchestration.discrepancy.note import Note, NoteCode
from orchestration.discrepancy.selection.input_noise import disturbances, noisy_inputs, simulated
from orchestration.discrepancy.selection.search import Search

Array = NDArray[np.float64]
CLEAR = 10.0  # fall of BIC that overrules the course of an input: very strong evidence (Kass and Raftery 1995)
# Half a sample of an unknown lag looks a little like the other choice. Then a record asks for another amount of it
# than all: more than twice as much, and more than three standard errors from it.
_OTHERWISE, _SURELY = 1.0 / 3.0, 9.0
_POSITIVE = 2.0  # fall of BIC that decides where both ways were fitted: positive evidence (ibid.)
_TINY = float(np.finfo(float).tiny)
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
    shift : Mapping of str to float
        By how much coordinates of the model would be others, where both ways were fitted and neither is clear.
    against : Course, optional
        What the course of the input is, where something else was asked for.
    apart : float
        How far both ways are, in innovations of what the model leaves; 0 where nobody asked.
    """

    linear: bool
    basis: Basis
    margin: float | None = None
    hangs: str = ""
    factor: float = 1.0
    shift: Mapping[str, float] = field(default_factory=dict)
    against: Course | None = None
    apart: float = 0.0

    @property
    def open(self) -> bool:
        """Whether another model might ask for the other way."""
        if self.basis is Basis.GIVEN or (self.basis is Basis.COURSE and not self.linear):
            return False
        return self.apart**2 >= CLEAR


def by_course(cls: type[Component], data: Dataset) -> dict[str, Intersample]:
    """Choose for every input that moves as its own course tells; it is held where that does not tell."""
    real = {v.name for v in cls.layout.inputs if v.type == "real"}
    chosen = {}
    for name, values in data.inputs.items():
        values = max(
            (values[run.samples] for run in data.runs),
            key=lambda part: np.count_nonzero(np.diff(part)),
        )
        kind = course(values) if name in real else Course.STEPS
        if kind is not Course.STILL:
            basis = Basis.DEFAULT if kind is Course.UNCLEAR else Basis.COURSE
            chosen[name] = Intersample(kind is Course.SMOOTH, basis)
    return chosen


def given(cls: type[Component], data: Dataset) -> dict[str, Intersample]:
    """What a dataset says of every input that moves, and where its own course speaks against it."""
    named = data.inputs if data.linear is True else data.linear or ()
    chosen, natural = {}, by_course(cls, data)
    for name in (n for n, values in data.inputs.items() if np.ptp(values) > 0.0):
        own = natural.get(name)
        contrary = (
            own is not None and own.basis is Basis.COURSE and own.linear is not (name in named)
        )
        course_of = Course.SMOOTH if own is not None and own.linear else Course.STEPS
        chosen[name] = Intersample(
            name in named, Basis.GIVEN, against=course_of if contrary else None
        )
    return chosen


def linear(chosen: dict[str, Intersample]) -> frozenset[str]:
    """Inputs that go smoothly."""
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
    names = [
        name for name, choice in chosen.items() if name in real and choice.basis is not Basis.GIVEN
    ]
    if not names:
        return search, base, chosen
    now = linear(chosen)
    try:
        others = [simulated(search, base, replace(search.data, linear=now ^ {n})) for n in names]
        noise = disturbances(search, base, noisy_inputs(search.base, search.data))
        amounts = dict(zip(names, encompassing(base, others, noise), strict=True))
    except UserError:
        return search, base, chosen
    apart = {n: _apart(base, other) for n, other in zip(names, others, strict=True)}
    asked = {n for n, amount in amounts.items() if _asked(amount)}
    assessed = {n: _assessed(choice, base, amounts.get(n)) for n, choice in chosen.items()}
    if asked and (other := turned(search, base, asked)) is not None:
        margin = base.fit.bic - other[1].fit.bic
        if margin < CLEAR:
            assessed |= {n: replace(assessed[n], margin=-margin) for n in asked}
        else:
            search, base = other
            assessed |= {n: Intersample(not chosen[n].linear, Basis.FIT, margin) for n in asked}
    for name, choice in assessed.items():
        if choice.hangs:
            search, base, assessed[name] = _by_both_fits(search, base, name, choice)
    return (
        search,
        base,
        {n: replace(choice, apart=apart.get(n, 0.0)) for n, choice in assessed.items()},
    )


def _apart(base: FittedCandidate, other: Mapping[str, Array]) -> float:
    """Root sum of squares, in innovations, between a model and another simulation; with no parameter in between."""
    squares = 0.0
    for output, noise in base.fit.noise.items():
        measured = base.problem.measured[output] - other[output]
        moved = measured[base.problem.present[output]] - base.fit.residual[output]
        power = float(np.mean((noise.deviation * base.fit.innovation[output]) ** 2))
        squares += float(moved @ moved) / max(
            power, _TINY
        )  # of a record without noise nothing may be left
    return float(np.sqrt(squares))


def turned(
    search: Search, base: FittedCandidate, names: Collection[str]
) -> tuple[Search, FittedCandidate] | None:
    """The base model fitted with some inputs the other way; None if that fails."""
    now = frozenset(search.data.inputs if search.data.linear is True else search.data.linear or ())
    other = replace(search, data=replace(search.data, linear=now ^ frozenset(names)))
    try:
        return other, other.refit(base)
    except UserError:
        return None


def _by_both_fits(
    search: Search, base: FittedCandidate, name: str, choice: Intersample
) -> tuple[Search, FittedCandidate, Intersample]:
    """Take the likelier way of an input on which parameters hang: what they take over is not linear in them."""
    other = turned(search, base, [name])
    if other is None:
        return search, base, choice
    margin = other[1].fit.bic - base.fit.bic
    if margin < -_POSITIVE:
        margin, choice = -margin, replace(choice, linear=not choice.linear, basis=Basis.FIT)
        (search, base), other = other, (search, base)
    if margin >= CLEAR:
        basis = Basis.FIT if choice.basis is Basis.DEFAULT else choice.basis
        return search, base, Intersample(choice.linear, basis, margin)
    shift = dict(zip(base.problem.names, other[1].fit.q - base.fit.q, strict=True))
    return search, base, replace(_hanging(choice, base, shift), margin=margin, shift=shift)


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
        return replace(
            choice,
            basis=Basis.FIT if choice.basis is Basis.DEFAULT else choice.basis,
            margin=margin,
        )
    if (
        choice.basis is Basis.COURSE and not choice.linear
    ):  # nothing but an output stage rests between steps
        return replace(choice, margin=margin)
    choice = replace(choice, margin=margin)
    if margin <= -CLEAR:  # it asks for neither of the two
        return choice
    return _hanging(choice, base, dict(zip(base.problem.names, amount.shift, strict=True)))


def _hanging(choice: Intersample, base: FittedCandidate, shift: Mapping[str, float]) -> Intersample:
    """Add which parameter would most surely be another with the other choice, if any would."""
    problem, fit = base.problem, base.fit
    errors = fit.covariance.standard_errors
    turns = {
        n: (shift[n] / error, problem.scales[i].value(fit.q[i] + shift[n]) / fit.values[n])
        for i, (n, error) in enumerate(zip(problem.names, errors, strict=True))
        if not problem.declared[n].starts and np.isfinite(error) and fit.values[n]
    }
    most = max(turns, key=lambda n: abs(turns[n][0]), default="")
    if not most or abs(turns[most][0]) < _MATTERS:
        return replace(choice, hangs="", factor=1.0)
    return replace(choice, hangs=most, factor=turns[most][1])


def spread(chosen: Mapping[str, Intersample], model: FittedCandidate) -> Array:
    """Deviation of parameters (p,) on top of that of the fit, where the other way of an input may be as likely.

    Either way has the weight of its BIC, and the interval holds 95 % of both together (Bayesian model averaging;
    Hoeting and others, Statistical Science 14, 1999).
    """
    errors = model.fit.covariance.standard_errors
    seen = np.isfinite(errors) & (errors > 0.0)
    more = np.zeros(len(errors))
    for choice in chosen.values():
        weight = float(expit(-(choice.margin or 0.0) / 2.0))
        for i in np.flatnonzero(seen):
            apart = choice.shift.get(model.problem.names[i], 0.0) / errors[i]
            wider = _half_width(abs(apart), weight) / _half_width(0.0, weight)
            more[i] = np.hypot(more[i], errors[i] * np.sqrt(max(wider**2 - 1.0, 0.0)))
    return more


def _half_width(apart: float, weight: float) -> float:
    """Of the interval about 0 with 95 % of two unit normal distributions, one so far apart and of this weight."""
    plain = float(norm.ppf(0.975))

    def outside(half: float) -> float:
        return float(
            (1.0 - weight) * 2.0 * ndtr(-half) + weight * (ndtr(apart - half) + ndtr(-half - apart))
        )

    return float(brentq(lambda half: outside(half) - 0.05, plain - 1e-3, plain + apart + 1e-3))


def remarks(chosen: dict[str, Intersample]) -> list[Note]:
    """What is to be said of choices: where an input is not simply held, and where a parameter hangs on it."""
    notes = []
    for name, choice in chosen.items():
        facts = {
            "course": "linear" if choice.linear else "held",
            "basis": str(choice.basis),
            "margin": choice.margin or 0.0,
        }
        if choice.against is not None:
            option = "--interpolate" if choice.linear else "--no-interpolate"
            contrary = {"course": facts["course"], "other": str(choice.against), "option": option}
            notes.append(Note(NoteCode.INTERSAMPLE_CONTRADICTED, name, contrary))
        elif choice.hangs:
            notes.append(
                Note(
                    NoteCode.INTERSAMPLE_OPEN,
                    name,
                    facts | {"parameter": choice.hangs, "factor": choice.factor},
                )
            )
        elif choice.basis is not Basis.GIVEN and (choice.linear or choice.basis is Basis.FIT):
            notes.append(Note(NoteCode.INTERSAMPLE, name, facts))
    return notes
