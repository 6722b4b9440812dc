"""Other shapes in place of a term of a fit, of which linear responses propose a few.

Without the term the errors of a fit are, to first order, those that it leaves plus the response to
the term. What another shape explains of these, beside all else that is fitted, is a regression.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array
from orchestration.diagnosis.comparison import words
from orchestration.diagnosis.courses import Courses
from orchestration.diagnosis.screening import CURVE_KNOTS, Candidate, Screen
from orchestration.diagnosis.terms import FORMS, KNOTS, Memory, Shape, Term

_WIDTHS = (0.05, 0.15, 0.4, 0.8, 1.5)  # that are tried, in scales of the signal
_BEST = 2  # shapes by each measure that are fitted
_RATIO = 4.0  # of two lags, from which a search starts
_QUICK, _RATES = 5.0, (0.5, 2.0)  # of a rate limit: its lag, and rates in scales over that of a lag


@dataclass(frozen=True, eq=False)
class _Place:
    """The place of a term in a fit, and its signal as it sees it.

    Attributes
    ----------
    along : Courses
    term : Term
    seen : ndarray, shape (n,)
    """

    along: Courses
    term: Term
    seen: Array

    def candidates(self) -> Iterator[tuple[Term, Candidate]]:
        """Yield each other shape, with the widths that are tried."""
        model, term = self.along.model, self.term
        scaled = (self.seen - term.middle) / term.scale
        amount = np.full(len(self.seen), term.size)
        if term.factor:
            amount = amount * self.along.values[term.factor]
        for other in other_shapes(term, float(scaled.min()), float(scaled.max())):
            for width in _WIDTHS if other.shape.has_width else (other.width,):
                one = replace(other, width=width)
                values = model.shape_values(one, self.seen)
                yield other, Candidate(one, values, amount, words(model, one, True))

    @cached_property
    def function(self) -> Array:
        """Part of its law (n,) that the term is, in its size."""
        own, term = self.along.fitted.values_of(self.term), self.term
        width = float(np.exp(own[-1])) if term.shape.has_width else term.width
        shapes = self.along.model.shape_values(replace(term, width=width), self.seen)
        return np.asarray(shapes @ own[: term.coefficients])

    def nearest(self, one: Candidate) -> Array:
        """Return the coefficients by which another shape is nearest to the function."""
        return np.asarray(np.linalg.lstsq(one.values, self.function, rcond=None)[0])

    def distance(self, one: Candidate) -> float:
        """Return how far it is from the function then."""
        return float(np.linalg.norm(one.values @ self.nearest(one) - self.function))

    def start(self, one: Candidate, coefficients: Array) -> Array:
        """Return values of another shape, with the fitted constants of the memory."""
        own, term = self.along.fitted.values_of(self.term), self.term
        constants = own[term.coefficients :][: len(term.constants)]
        width = np.log([one.term.width] * one.term.shape.has_width)
        return np.concatenate([coefficients, constants, width])


def replacements(along: Courses, term: Term) -> Iterator[tuple[Term, list[Array]]]:
    """Yield promising shapes in place of a term of a fit, each with values to start from.

    The best by the gain of linear responses, with what columns cost and without, and those nearest
    to the function that the term has: where other terms could take its part by going far, linear
    responses tell nothing.

    Parameters
    ----------
    along : Courses
        Of the fit.
    term : Term
        Of a law, with a signal.
    """
    place = _Place(along, term, along.seen_by(term))
    others, candidates = zip(*place.candidates(), strict=True)
    screen = Screen(along, candidates, term)
    sets = [(i,) for i in range(len(candidates))]
    distances = np.array([place.distance(one) for one in candidates])
    promising: dict[Term, int] = {}
    for measure in (screen.values(sets), screen.gains(sets), -distances):
        best: dict[Term, int] = {}
        for i in np.argsort(-measure, kind="stable").tolist():
            best.setdefault(others[i], i)
        for other in list(best)[:_BEST]:
            promising.setdefault(other, best[other])
    for other, i in promising.items():
        (explaining,), _ = screen.solve([i])
        starts = place.nearest(candidates[i]), explaining
        yield other, [place.start(candidates[i], start) for start in starts]


def other_shapes(term: Term, low: float, high: float) -> Iterator[Term]:
    """Yield a term with each of the other shapes of its signal.

    Parameters
    ----------
    term : Term
    low, high : float
        Range of its signal, in scales.

    Notes
    -----
    A curve with more knots is another. A product of two signals is one of either over the other:
    a screen has it in one way.
    """
    if len(term.places) < KNOTS:
        finer = tuple(np.linspace(low, high, KNOTS))
        yield replace(term, shape=Shape.CURVE, width=1.0, places=finer)
    is_product = term.factor not in ("", term.law)
    for shape in Shape:
        if shape is term.shape or shape in (Shape.CONSTANT, Shape.MODULUS, Shape.STEP):
            continue
        if is_product and shape is Shape.LINEAR:
            continue
        places = tuple(np.linspace(low, high, CURVE_KNOTS)) if shape is Shape.CURVE else ()
        yield replace(term, shape=shape, width=FORMS[shape].width, places=places)


def other_memories(term: Term) -> Iterator[Term]:
    """Yield a term that lags or fades with lags that differ by direction, or a limited rate."""
    if term.memory not in (Memory.LAG, Memory.FADING):
        return
    lag = term.constants[0]
    kinds: list[tuple[Memory, tuple[float, ...]]] = [(Memory.FADING, (lag,))]
    kinds += [(Memory.TWO_LAGS, (lag / ratio**0.5, ratio)) for ratio in (_RATIO, 1.0 / _RATIO)]
    kinds += [(Memory.RATE_LIMIT, (lag / _QUICK, rate / lag)) for rate in _RATES]
    for memory, constants in kinds:
        if memory is not term.memory or term.shape is not Shape.LINEAR:
            yield replace(term, memory=memory, constants=constants, shape=Shape.LINEAR, places=())
