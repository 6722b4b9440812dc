"""A fitted model along its courses over pieces of records, as the measured outputs show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array, Mask
from orchestration.diagnosis.fitting import Fit
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.runs import Course, Linearisation, Record, Setting, step_of
from orchestration.diagnosis.terms import Term

_PLACES = 20  # of the function of a signal, by which the actions of two laws differ
_DIFFERENT = 1e-3  # share of squares that no such function explains


@dataclass(frozen=True, eq=False)
class Courses:
    """Courses of a fitted model over pieces of records.

    Attributes
    ----------
    fitted : Fit
    pieces : tuple of Record
    courses : tuple of Course
    measured : ndarray of bool, shape (ny,)
        Outputs that are measured in some piece; all below is of these m.
    spread : ndarray, shape (m,)
    errors : tuple of ndarray, shape (n, m)
        Of each piece, in spreads.
    parts : tuple of Linearisation
        Along each course.
    """

    fitted: Fit
    pieces: tuple[Record, ...]
    courses: tuple[Course, ...]
    measured: Mask
    spread: Array
    errors: tuple[Array, ...]
    parts: tuple[Linearisation, ...]

    @property
    def model(self) -> LawModel:
        """The model."""
        return self.fitted.problem.model

    @property
    def times(self) -> list[Array]:
        """Times of the pieces, s."""
        return [piece.time for piece in self.pieces]

    @property
    def length(self) -> float:
        """Duration of the longest piece, s."""
        return max(float(t[-1] - t[0]) for t in self.times)

    @property
    def step(self) -> float:
        """Shortest of the usual steps of the pieces, s."""
        return min(step_of(t) for t in self.times)

    def setting(self, piece: Record) -> Setting:
        """Return the setting of the run over a piece."""
        fitted = self.fitted
        return fitted.problem.setting(fitted.point, fitted.terms, piece.group)

    @cached_property
    def inputs(self) -> Array:
        """Inputs (n, nu) of all pieces, one after the other."""
        return np.concatenate([piece.inputs for piece in self.pieces])

    @cached_property
    def states(self) -> Array:
        """States and memories (n, nx + nz) of all pieces."""
        return np.concatenate([course.states for course in self.courses])

    @cached_property
    def laws(self) -> Array:
        """Values (n, nl) of the laws in all pieces."""
        return np.concatenate([part.laws for part in self.parts])

    @cached_property
    def values(self) -> dict[str, Array]:
        """Values (n,) of the inputs, states, and laws by name, in this order, and of the time."""
        model = self.model
        inputs = {v.name: self.inputs[:, i] for i, v in enumerate(model.inputs)}
        states = {v.name: self.states[:, i] for i, v in enumerate(model.states)}
        laws = dict(zip(model.laws, self.laws.T, strict=True))
        return inputs | states | laws | {"time": np.concatenate(self.times)}

    def remembered(self, term: Term) -> Array:
        """Return the values (n,) of the memory of a term of the fit."""
        remembering = [one for one in self.fitted.terms if one.has_memory]
        return self.states[:, len(self.model.states) + remembering.index(term)]

    def seen_by(self, term: Term) -> Array:
        """Return the values (n,) of its signal, or of the memory of it, as a term sees them."""
        values = self.values[term.signal]
        if not term.has_memory:
            return values
        remembered = self.remembered(term)
        return values - remembered if term.memory.is_behind else remembered


def courses_of_fit(fitted: Fit) -> Courses | None:
    """Run a fitted model over its own records; None if it runs away in one of them."""
    return courses_of(fitted, fitted.problem.records, fitted.point.starts)


def courses_of(fitted: Fit, pieces: Sequence[Record], starts: Sequence[Array]) -> Courses | None:
    """Run a fitted model over pieces of records from start states (nx,) of each.

    None if it runs away in one of them.
    """
    problem = fitted.problem
    settings = [problem.setting(fitted.point, fitted.terms, piece.group) for piece in pieces]
    each = list(zip(pieces, settings, starts, strict=True))
    runs = [problem.model.run(piece, setting, x) for piece, setting, x in each]
    courses = tuple(course for course in runs if course is not None)
    if len(courses) < len(runs):
        return None
    both = list(zip(pieces, settings, courses, strict=True))
    errors = [(piece.outputs - course.outputs) / problem.spread for piece, _, course in both]
    measured: Mask = np.asarray(np.isfinite(np.concatenate(errors)).any(axis=0))
    parts = [problem.model.linearise(*one) for one in both]
    return Courses(
        fitted,
        tuple(pieces),
        courses,
        measured,
        problem.spread[measured],
        tuple(e[:, measured] for e in errors),
        tuple(part.of_outputs(measured) for part in parts),
    )


def are_interchangeable(along: Courses, law: str, other: str, signal: str = "") -> bool:
    """Return whether a function of a signal in one law is some function of it in another.

    It is if, at each instant, what one law does to rates and measured outputs is what the other
    does, times a function of the signal: a voltage over charge and a capacitance over charge are
    one cause in two words. Without a signal they are in proportion: any term in the one is one in
    the other.
    """
    laws = along.model.laws
    values = along.values.get(signal) if signal else np.zeros(len(along.laws))
    if values is None or law not in laws or other not in laws:
        return False
    ours, theirs = (_actions(along, one) for one in (law, other))
    places = np.linspace(values.min(), values.max(), _PLACES if signal else 1)
    shares = np.array([np.interp(values, places, one) for one in np.eye(len(places))]).T
    return any(_follows(a, b, shares) for a, b in ((ours, theirs), (theirs, ours)))


def _follows(ours: Array, theirs: Array, shares: Array) -> bool:
    """Return whether actions (n, channels) are others times a piecewise linear function."""
    size = np.maximum(np.sqrt(np.mean(ours**2, axis=0)), np.finfo(float).tiny)
    with np.errstate(over="ignore", invalid="ignore"):  # of an action that one law has not at all
        columns = (theirs / size)[:, :, np.newaxis] * shares[:, np.newaxis]
    columns = columns.reshape(-1, shares.shape[1])
    target = (ours / size).ravel()
    norm = float(target @ target)
    if not norm or not np.isfinite(columns).all():
        return False
    solution = np.linalg.lstsq(columns, target, rcond=None)[0]
    rest = target - columns @ solution
    return float(rest @ rest) < _DIFFERENT * norm


def _actions(along: Courses, law: str) -> Array:
    """Return what an addition to a law does, (n, channels); an update is of the step behind it."""
    i = along.model.laws.index(law)
    rows = []
    for part in along.parts:
        ours = [action[:, :, i] for action in part.actions]
        rows.append(np.hstack([np.pad(a, ((0, len(part.laws) - len(a)), (0, 0))) for a in ours]))
    return np.nan_to_num(np.concatenate(rows))
