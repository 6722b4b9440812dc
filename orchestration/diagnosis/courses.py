"""A fitted model along its courses over pieces of records, as the measured outputs show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.fitting import Fit
from orchestration.diagnosis.law_model import Course, LawModel, Linearisation, Record


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
    measured: Array
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

    @cached_property
    def parameters(self) -> Array:
        """All parameters of the model, SI."""
        return self.fitted.problem.parameters(self.fitted.point.q)

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


def courses_of(fitted: Fit, pieces: Sequence[Record], starts: Sequence[Array]) -> Courses | None:
    """Run a fitted model over pieces of records from start states (nx,) of each.

    None if it runs away in one of them.
    """
    problem = fitted.problem
    model = problem.model
    setting = problem.setting(fitted.point, fitted.terms)
    runs = [model.run(piece, setting, x) for piece, x in zip(pieces, starts, strict=True)]
    courses = tuple(course for course in runs if course is not None)
    if len(courses) < len(runs):
        return None
    both = list(zip(pieces, courses, strict=True))
    errors = [(piece.outputs - course.outputs) / problem.spread for piece, course in both]
    measured = np.isfinite(np.concatenate(errors)).any(axis=0)
    parts = [model.linearise(piece, setting, course) for piece, course in both]
    return Courses(
        fitted,
        tuple(pieces),
        courses,
        measured,
        problem.spread[measured],
        tuple(e[:, measured] for e in errors),
        tuple(part.of_outputs(measured) for part in parts),
    )
