"""Fits of a model to records and to later ones of the same specimen, with some values that differ.

A value that differs, of a parameter or of the strength of a term, is one more explanation: it is
fitted with everything else, and judged by samples that no fit saw, as terms are.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri

from fmus.kit.arrays import Array, single_threaded
from orchestration.diagnosis.comparison import WEIGHTS, Comparison, Judged, common_of, compare
from orchestration.diagnosis.fitting import (
    SMALL,
    Fit,
    Point,
    Problem,
    final_curvature,
    fit,
    mean_squares,
    variance_of,
    weights_of,
)
from orchestration.diagnosis.search import Found, Ranked
from orchestration.diagnosis.subject import Subject
from orchestration.diagnosis.term_names import covariance_of
from orchestration.diagnosis.terms import Term
from orchestration.identify.uncertainty import is_significantly_different

_ROUNDS = 6  # of a fit, each in the noise that the one before left
_STEPS = 40  # of each
_LOWER = 0.01  # share of the noise, by which it has to fall for another round
Difference = str | Term  # a parameter, or a term whose strength, may be another in a later record


@dataclass(frozen=True, eq=False)
class Values:
    """Values of all that is fitted, from which a fit may start.

    Attributes
    ----------
    common : ndarray, shape (p,)
        Searched coordinates of the parameters without differences.
    terms : ndarray, shape (k,)
        Values of the terms without differences.
    later : Mapping of Difference to ndarray
        Searched coordinate of a parameter (1,), or coefficients of a term, in the later record.
    starts : tuple of ndarray, shape (nx,)
        Of each record.
    """

    common: Array
    terms: Array
    later: Mapping[Difference, Array]
    starts: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Joint:
    """A model with terms over records and later ones, which are of the last group.

    Attributes
    ----------
    subject : Subject
    terms : tuple of Term
    """

    subject: Subject
    terms: tuple[Term, ...]

    def place(self, name: str) -> int:
        """Return the searched coordinate of a parameter."""
        problem = self.subject.problem
        names = [problem.model.parameters[i].name for i in problem.searched]
        return names.index(name)

    def span(self, term: Term) -> range:
        """Return the positions of the coefficients of a term among the values of all."""
        before = self.terms[: self.terms.index(term)]
        first = sum(other.coefficients + len(other.start) for other in before)
        return range(first, first + term.coefficients)

    def problem(self, differences: Sequence[Difference]) -> Problem:
        """Return the problem in which some values differ."""
        names = tuple(one for one in differences if isinstance(one, str))
        spans = tuple(tuple(self.span(one)) for one in differences if isinstance(one, Term))
        problem = self.subject.problem
        return replace(problem, local=replace(problem.local, later=names, later_values=spans))

    def point(self, differences: Sequence[Difference], values: Values) -> Point:
        """Return the point at some values, in the problem in which some differ."""
        names = [one for one in differences if isinstance(one, str)]
        terms = [one for one in differences if isinstance(one, Term)]
        own = [values.later.get(n, values.common[[self.place(n)]]) for n in names]
        strengths = [values.later.get(t, values.terms[list(self.span(t))]) for t in terms]
        q = np.concatenate([values.common, *own])
        return Point(q, np.concatenate([values.terms, *strengths]), values.starts)

    def places(self, differences: Sequence[Difference]) -> dict[Difference, range]:
        """Return the places of values that differ among the coordinates and values of a fit."""
        names = [one for one in differences if isinstance(one, str)]
        at = len(self.subject.problem.free)
        result: dict[Difference, range] = {
            n: range(at + k, at + k + 1) for k, n in enumerate(names)
        }
        at += len(names) + self.size
        for term in differences:
            if isinstance(term, Term):
                result[term] = range(at, at + term.coefficients)
                at += term.coefficients
        return result

    def values(self, fitted: Fit, differences: Sequence[Difference]) -> Values:
        """Return the values of a fit in which some differ."""
        own = np.append(fitted.point.q, fitted.point.values)
        common = fitted.point.q[: len(self.subject.problem.free)]
        later = {one: own[list(at)] for one, at in self.places(differences).items()}
        return Values(common, fitted.point.values[: self.size], later, fitted.point.starts)

    @property
    def size(self) -> int:
        """Number of the values of all terms."""
        return sum(term.coefficients + len(term.start) for term in self.terms)

    def fit(self, differences: Sequence[Difference], starts: Iterable[Values]) -> Judged | None:
        """Fit with some values that differ, from the nearest of several starts; None if it fails.

        First in the noise of the model without terms, then in that which it leaves, until it leaves
        no less.
        """
        problem = self.problem(differences)
        points = [self.point(differences, values) for values in starts]
        weights = weights_of(self.subject.base.errors)
        best = None
        for _ in range(_ROUNDS):
            fitted = fit(problem, self.terms, points, weights, _STEPS)
            if fitted is None:
                break
            is_settled = best is not None and _noise(fitted) > (1.0 - _LOWER) * _noise(best)
            if best is None or _noise(fitted) < _noise(best):
                best = fitted
            if is_settled:
                break
            points, weights = [fitted.point], weights_of(fitted.errors)
        return None if best is None else self.subject.judge(best)

    def all_differences(self, alone: Sequence[Fit]) -> list[Difference]:
        """Return all that may differ: terms, and parameters of which some record says something.

        Parameters
        ----------
        alone : sequence of Fit
            Of the records by themselves: in one fit of all, what differs is noise.
        """
        problem = self.subject.problem
        names = [problem.model.parameters[i].name for i in problem.searched]
        told = [name for fitted in alone for name in _told(fitted)]
        own = [name for name in names if name in told and name not in problem.local.each]
        return [*self.terms, *own]


def _noise(fitted: Fit) -> float:
    """Return the geometric mean of what a fit leaves in each output, in spreads.

    The likelihood falls with it, where the noise of each output is unknown (Bard: Nonlinear
    Parameter Estimation, 1974, chapter 4). In a sum of squares the noisiest output would decide.
    """
    return float(np.exp(0.5 * np.nanmean(np.log(variance_of(fitted.errors)))))


def _told(fitted: Fit) -> list[str]:
    """Return the parameters of which a fit says more than their prior."""
    problem = fitted.problem
    information = np.diag(final_curvature(fitted))[: len(problem.free)]
    told = information * problem.deviation**2 - 1.0 > 1.0
    return [problem.model.parameters[i].name for i in problem.free[told]]


def start_values(joint: Joint, before: Fit, after: Fit) -> Values:
    """Return the values of two fits, of the records by themselves; a term of one is small in both.

    Parameters
    ----------
    joint : Joint
    before, after : Fit
        With the same parameters.
    """
    each = [joint.place(name) for name in joint.subject.problem.local.each]
    common = np.append(before.point.q, after.point.q[each])
    names = [joint.subject.problem.model.parameters[i].name for i in joint.subject.problem.searched]
    later: dict[Difference, Array] = {n: after.point.q[[k]] for k, n in enumerate(names)}
    values = [np.zeros(0)]
    for term in joint.terms:
        own, other = (f.values_of(term) if term in f.terms else None for f in (before, after))
        values.append(_values_before(term, own, other))
        later[term] = (term.values(SMALL) if other is None else other)[: term.coefficients]
    starts = (*before.point.starts, *after.point.starts)
    return Values(common, np.concatenate(values), later, starts)


def _values_before(term: Term, own: Array | None, other: Array | None) -> Array:
    """Return the values of a term before: its own, or small ones with the other's constants."""
    small = term.values(SMALL)
    if own is not None:
        return own.copy()
    return (
        small
        if other is None
        else np.append(small[: term.coefficients], other[term.coefficients :])
    )


@dataclass(frozen=True, eq=False)
class Selected:
    """The differences that explain a later record.

    Attributes
    ----------
    joint : Joint
    common, best, separate : Judged
        Without differences, with those that explain, and with all.
    chosen, all : tuple of Difference
        Those of `best`, in the order of their gain, and of `separate`.
    sure, doubtful : frozenset of Difference
        Those of which it is sure that they differ, and those that may.
    gains : Mapping of Difference to float
        Share of the squared error that each takes off, of what all take off; none if these take off
        no more than chance does.
    bounds : Mapping of Difference to float
        By how much each differs at most where all may, as `largest_difference` says.
    stayed : frozenset of Difference
        Those that differ significantly nowhere, and at most by what would be noticed.
    """

    joint: Joint
    common: Judged
    best: Judged
    separate: Judged
    chosen: tuple[Difference, ...]
    all: tuple[Difference, ...]
    sure: frozenset[Difference]
    doubtful: frozenset[Difference]
    gains: Mapping[Difference, float]
    bounds: Mapping[Difference, float]
    stayed: frozenset[Difference]


@dataclass
class Selection:
    """A search for the differences that explain a later record, the largest gain first.

    Attributes
    ----------
    joint : Joint
    common, separate : Judged
        Without differences, and with all.
    all : tuple of Difference
    is_over : callable
        Returns whether to leave out what has not been begun yet.
    """

    joint: Joint
    common: Judged
    separate: Judged
    all: tuple[Difference, ...]
    is_over: Callable[[], bool] = lambda: False
    _fits: dict[frozenset[Difference], tuple[tuple[Difference, ...], Judged]] = field(
        default_factory=dict, init=False
    )
    _gains: dict[Difference, float] = field(default_factory=dict, init=False)
    _found: Found = field(init=False)

    def __post_init__(self) -> None:
        self._found = Found(self.joint.subject, self.common)
        self._fits[frozenset()] = (), self.common

    @single_threaded
    def select(self) -> Selected:
        """Add one difference after the other, as long as the score rises."""
        bounds = {
            one: largest_difference(self.joint, self.separate.fit, self.all, one)
            for one in self.all
        }
        stayed = {one for one in self.all if self._stayed(one, bounds[one])}
        chosen: tuple[Difference, ...] = ()
        rivals: dict[Difference, list[Difference]] = {}
        while rest := [one for one in self.all if one not in chosen]:
            scores = self._scores([(*chosen, one) for one in rest])
            best = max(rest, key=lambda one: scores.get(frozenset((*chosen, one)), -np.inf))
            score = scores.get(frozenset((*chosen, best)), -np.inf)
            self._note_gains(chosen, rest)
            if score <= scores.get(frozenset(chosen), 0.0) or self._evidence(chosen, best) <= 0.0:
                break
            near = score - self._found.temper
            also = [o for o in rest if scores.get(frozenset((*chosen, o)), -np.inf) > near]
            rivals[best] = [one for one in also if one != best and one not in stayed]
            chosen = (*chosen, best)
        sure = {one for one in chosen if self._is_sure(chosen, one)}
        doubtful = {one for one in chosen if one not in sure and self._differs(chosen, one)}
        for one in chosen:
            beside = self._rivals_of(chosen, one, rivals[one])
            doubtful |= beside
            if beside and one in sure:
                sure.remove(one)
                doubtful.add(one)
        for one in self.all:
            if one not in chosen and self._differs((*chosen, one), one):
                doubtful.add(one)
        return Selected(
            self.joint,
            self.common,
            self._fits[frozenset(chosen)][1],
            self.separate,
            chosen,
            self.all,
            frozenset(sure),
            frozenset(doubtful - stayed),
            self._gains if self._is_telling() else {},
            bounds,
            frozenset(stayed - sure),
        )

    def _judged(self, differences: Sequence[Difference]) -> Judged | None:
        """Return the fit in which some differ, if it was made."""
        known = self._fits.get(frozenset(differences))
        return None if known is None else known[1]

    def _fit(self, sets: Sequence[tuple[Difference, ...]]) -> None:
        """Fit sets of differences on all cores, unless they were fitted or the time is over."""
        new = [one for one in sets if frozenset(one) not in self._fits]

        def one(differences: tuple[Difference, ...]) -> Judged | None:
            if self.is_over():
                return None
            order, nearest = self._fits.get(frozenset(differences[:-1]), ((), self.common))
            here = self.joint.values(nearest.fit, order)
            apart = self.joint.values(self.separate.fit, self.all)
            return self.joint.fit(differences, [here, replace(here, later=apart.later)])

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for differences, judged in zip(new, pool.map(one, new), strict=True):
                if judged is not None:
                    self._fits[frozenset(differences)] = differences, judged
                    self._found = self._found.with_fits([judged])

    def _scores(self, sets: Sequence[tuple[Difference, ...]]) -> dict[frozenset[Difference], float]:
        """Fit some sets, and return the scores of all fits so far that are not worse."""
        self._fit(sets)
        ranked: dict[int, Ranked] = {id(one.judged): one for one in self._found.compared()}
        known = {key: ranked.get(id(judged)) for key, (_, judged) in self._fits.items()}
        return {
            key: one.score
            for key, one in known.items()
            if one is not None and not one.comparison.is_worse
        }

    def _against(
        self, differences: Sequence[Difference], others: Sequence[Difference]
    ) -> Comparison | None:
        """Compare the fit in which some differ with that in which others do."""
        ours, theirs = self._judged(differences), self._judged(others)
        if ours is None or theirs is None:
            return None
        return compare(ours, theirs, common_of([self.common, *self._found.fits]))

    def _evidence(self, chosen: Sequence[Difference], one: Difference) -> float:
        """Return the evidence that a further one differs, beyond what is needed, nats."""
        comparison = self._against((*chosen, one), chosen)
        return -np.inf if comparison is None else comparison.evidence - WEIGHTS.least

    def _is_sure(self, chosen: Sequence[Difference], one: Difference) -> bool:
        """Return whether one of some differs significantly, and is needed beside the others."""
        others = tuple(other for other in chosen if other != one)
        self._fit([others])
        comparison = self._against(chosen, others)
        needed = comparison is not None and comparison.evidence > WEIGHTS.least
        return needed and self._differs(chosen, one)

    def _differs(self, differences: Sequence[Difference], one: Difference) -> bool:
        """Return whether a difference is significant; an untried one may be."""
        judged = self._judged(differences)
        if judged is None:
            return self.is_over()
        order = self._fits[frozenset(differences)][0]
        return _is_significant(self.joint, judged.fit, order, one)

    def _stayed(self, one: Difference, bound: float) -> bool:
        """Return whether one is known to differ by little where all may, if it does at all."""
        is_small = not is_significantly_different(bound, 0.0)
        return is_small and not _is_significant(self.joint, self.separate.fit, self.all, one)

    def _rivals_of(
        self, chosen: Sequence[Difference], one: Difference, near: Sequence[Difference]
    ) -> set[Difference]:
        """Return those that explain as much in place of one, within what scores may differ by."""
        others = tuple(other for other in chosen if other != one)
        instead = {other: (*others, other) for other in near if other not in chosen}
        scores = self._scores([*instead.values()])
        least = scores.get(frozenset(chosen), 0.0) - self._found.temper
        return {
            other for other, own in instead.items() if scores.get(frozenset(own), -np.inf) > least
        }

    def _note_gains(self, chosen: Sequence[Difference], rest: Sequence[Difference]) -> None:
        """Note the share of the squared error that each further difference takes off."""
        total = self._error(self.common) - self._error(self.separate)
        here = self._judged(chosen)
        for one in rest:
            there = self._judged((*chosen, one))
            if here is not None and there is not None and total > 0.0:
                self._gains[one] = (self._error(here) - self._error(there)) / total

    def _error(self, judged: Judged) -> float:
        """Return the mean square of the errors, in those of the fit in which all differ."""
        ours, theirs = (mean_squares(np.concatenate(j.fit.errors)) for j in (judged, self.separate))
        return float(np.nanmean(ours / theirs))

    def _is_telling(self) -> bool:
        """Return whether all differences together gain more than chance does."""
        common = common_of([self.common, self.separate])
        comparison = compare(self.separate, self.common, common)
        return comparison.fitted > comparison.columns


def strengths(
    joint: Joint, fitted: Fit, differences: Sequence[Difference], one: Difference
) -> tuple[Array, Array]:
    """Return a value that differs, before and after, with its covariance.

    Parameters
    ----------
    joint : Joint
    fitted : Fit
    differences : sequence of Difference
        Of the fit.
    one : Difference

    Returns
    -------
    values : ndarray, shape (2,)
        The searched coordinate of a parameter; the coefficient of a term, or of several their root
        mean square, with the sign that they have in both records together.
    covariance : ndarray, shape (2, 2)
    """
    coordinates = np.append(fitted.point.q, fitted.point.values)
    first = (
        joint.place(one) if isinstance(one, str) else len(fitted.point.q) + joint.span(one).start
    )
    after = joint.places(differences)[one]
    before = range(first, first + len(after))
    direction = np.ones(1)
    if len(after) > 1:
        both = coordinates[list(before)] + coordinates[list(after)]
        direction = both / (np.linalg.norm(both) or 1.0) / np.sqrt(len(after))
    rows = np.zeros((2, len(coordinates)))
    rows[0, list(before)] = direction
    rows[1, list(after)] = direction
    own = covariance_of(fitted)[: len(coordinates), : len(coordinates)]
    return rows @ coordinates, rows @ own @ rows.T


def difference(
    joint: Joint, fitted: Fit, differences: Sequence[Difference], one: Difference
) -> tuple[float, float]:
    """Return by how much a value differs in the later record, and the standard error of that.

    In the searched coordinate of a parameter; of the strength of a term as a share of the larger.
    """
    (before, after), covariance = strengths(joint, fitted, differences, one)
    variance = covariance[0, 0] + covariance[1, 1] - 2.0 * covariance[0, 1]
    size = 1.0 if isinstance(one, str) else max(abs(before), abs(after)) or 1.0
    return float(after - before) / size, float(np.sqrt(max(variance, 0.0))) / size


def _is_significant(
    joint: Joint, fitted: Fit, differences: Sequence[Difference], one: Difference
) -> bool:
    """Return whether a value differs by many standard errors, however little that is."""
    change, error = difference(joint, fitted, differences, one)
    return is_significantly_different(change, error, noticeable=0.0)


def largest_difference(
    joint: Joint, fitted: Fit, differences: Sequence[Difference], one: Difference
) -> float:
    """Return by how much a value differs at most, at 95 %, in the measure of `difference`."""
    change, error = difference(joint, fitted, differences, one)
    return abs(change) + float(ndtri(0.975)) * error
