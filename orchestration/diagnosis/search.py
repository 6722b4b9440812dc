"""The search: terms are proposed along courses of the model, and fitted as sets in free runs."""

from __future__ import annotations

import itertools
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fmus.kit.arrays import Array, single_threaded
from orchestration.diagnosis.comparison import (
    WEIGHTS,
    Common,
    Comparison,
    Contrast,
    Judged,
    common_of,
    compare,
    contrast,
    inexact,
)
from orchestration.diagnosis.courses import Courses, courses_of, courses_of_fit
from orchestration.diagnosis.fitting import (
    FLAT,
    SMALL,
    Fit,
    Point,
    StartPrior,
    fit,
    fit_base,
    fit_start,
    located,
    not_fitted,
    piece_ends,
    variance_of,
    weights_of,
)
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.misreadings import misreadings
from orchestration.diagnosis.readings import Reading
from orchestration.diagnosis.remainder import leaves_more
from orchestration.diagnosis.replacements import other_memories, replacements
from orchestration.diagnosis.runs import Record
from orchestration.diagnosis.screening import (
    Screen,
    at_other_instants,
    screen_of,
    with_shorter_lags,
)
from orchestration.diagnosis.subject import Subject, nearer, read_again
from orchestration.diagnosis.terms import NamedTerm, SensorTerm, Term, effects_in

_PIECES = (8, 40)  # of a record, along which terms are proposed if the whole hides some
_QUOTAS = {1: {1: 7, 2: 6, 3: 3}, 8: {1: 6, 2: 5, 3: 2}, 40: {1: 6, 2: 5, 3: 2}}
_OF_READING = {1: {1: 3, 2: 2}}  # the same of a file that is read in another way
_QUICK = {1: {1: 7}}  # the same of a search that is not thorough
_SECOND = {1: 4, 2: 2}  # sets that are fitted around each of the best, by terms added
_NAMED = {1: 6, 2: 4}  # sets with an effect of the catalogue, beside those without
_LEADS = 2  # sets of one size with the same first term
_BEST = 3  # fits around which a second round goes
_MOST_TERMS = 3
_CLIP = 30.0  # coefficient from the screen at most
_SHIFT = 2.0  # of a parameter from the screen at most, in searched coordinates
_FAR = 0.4  # prior deviations from nominal, from which on a search starts at nominal too
_CHANCE = 2.0  # standard errors of a correlation, up to which noise is white
_WORTH = -5.0  # nats of evidence by the screen, below which a set is not fitted
_STEPS, _FEWER_STEPS = 15, 12  # of a fit; of one that starts from a fit of nearly the same terms
_LAST_STEPS = 25
_NEARLY_FLAT = 1e-3  # fall of the cost that ends a fit before the last ones: a nat of thousands
_FORMS = 4  # of the best single term, among which a conclusion is drawn
_SUBSETS, _SHAPES = 6, 2  # of the best fits, that are fitted with fewer terms, or other shapes
_FAULTS = 4  # of sensors, that are fitted alone where the model is linearised anew
_LINEARISATIONS = 3  # of a model that is linear in its parameters, at most
_LEADING, _FINALISTS = 8, 12  # best sets and fits that are fitted to all samples
_PIECE_WEIGHT = 0.5 / 0.1**2 / 5.0  # of squared errors of a piece: within a tenth of the spread


@dataclass(frozen=True, eq=False)
class Ranked:
    """A fit with its comparison to the model without terms.

    Attributes
    ----------
    judged : Judged
    comparison : Comparison
    score : float
        Of that comparison among all fits, nats.
    """

    judged: Judged
    comparison: Comparison
    score: float


@dataclass(frozen=True, eq=False)
class Found:
    """All fits of a record, with their comparisons to the model without terms.

    Attributes
    ----------
    subject : Subject
        Of the file as it was read.
    base : Judged
    fits : tuple of Judged
    read : tuple of Subject
        Of the file in other readings.
    chosen_from : int
        Further fits, among which these were chosen.
    """

    subject: Subject
    base: Judged
    fits: tuple[Judged, ...] = ()
    read: tuple[Subject, ...] = ()
    chosen_from: int = 0
    # to the base, which those that are found later share
    _contrasts: dict[tuple[Judged, Judged], Contrast] = field(default_factory=dict, repr=False)

    def with_fits(self, fits: Iterable[Judged], read: Iterable[Subject] = ()) -> Found:
        """Return this with further fits, and with further readings of the file."""
        return replace(self, fits=(*self.fits, *fits), read=(*self.read, *read))

    def subject_of(self, reading: Reading | None) -> Subject:
        """Return the subject of a reading."""
        return next((s for s in self.read if s.reading == reading), self.subject)

    @cached_property
    def along(self) -> Courses | None:
        """The model without terms along the fitted records."""
        fitted = self.base.fit
        return courses_of_fit(fitted)

    def compared(self) -> list[Ranked]:
        """Return each fit with its comparison to the base, the highest score first."""
        return list(self._ranked)

    @cached_property
    def _ranked(self) -> list[Ranked]:
        pairs = zip(self.fits, self._comparisons, strict=True)
        ranked = [Ranked(one, c, c.score(self._inexact)) for one, c in pairs]
        return sorted((r for r in ranked if np.isfinite(r.score)), key=lambda r: -r.score)

    @cached_property
    def _comparisons(self) -> list[Comparison]:
        """Comparison of each fit to the base."""
        known = self._contrasts
        for one in self.fits:
            if (one, self.base) not in known:
                known[one, self.base] = contrast(one, self.base)
        return [compare(one, self.base, self.common, known[one, self.base]) for one in self.fits]

    @cached_property
    def common(self) -> Common:
        """Effective samples of all comparisons; of the base where nothing was fitted."""
        return common_of(self.fits or [self.base])

    @cached_property
    def _inexact(self) -> float:
        return inexact(self._comparisons, self.structure)

    @property
    def temper(self) -> float:
        """Nats by which scores differ of causes that may both be true."""
        return WEIGHTS.temper + WEIGHTS.temper_of_gain * self._inexact

    @property
    def structure(self) -> float:
        """Share of the fitted samples that are not independent; see `Common`."""
        return self.common.structure if self.fits else 0.0

    def gain_where_fitted(self) -> float:
        """Return the largest gain on fitted samples beyond what the terms cost, nats.

        Less the logarithm of the number of fits: the best of so many gains as much by chance.
        """
        comparisons = [ranked.comparison for ranked in self.compared()]
        largest = max((c.fitted - c.cost for c in comparisons), default=0.0)
        return largest - float(np.log(max(len(comparisons) + self.chosen_from, 1)))

    def best(self, count: int) -> list[Judged]:
        """Return the best fits, of which no two have the same sources, and the lowest left out."""
        good = [r.judged for r in self.compared() if not r.comparison.is_worse]
        chosen: dict[object, Judged] = {}
        for one in good:
            chosen.setdefault(frozenset(t.source for t in one.terms), one)
        result = list(chosen.values())[:count]
        lowest = min(good, key=lambda one: np.nanmean(one.choosing**2), default=None)
        if lowest is not None and lowest not in result:
            result.append(lowest)
        return result


@single_threaded
def search(
    subject: Subject,
    progress: Callable[[str], None] = lambda text: None,
    is_over: Callable[[], bool] = lambda: False,
    is_candidate: Callable[[Term], bool] = lambda term: True,
    *,
    thorough: bool = True,
) -> Found | None:
    """Fit what the record proposes; None if the base cannot be judged.

    Parameters
    ----------
    subject : Subject
    progress : callable
        Called with a few words about each step.
    is_over : callable
        Returns whether to leave out what has not been begun yet.
    is_candidate : callable
        Returns whether a term may be a cause.
    thorough : bool
        Whether to propose along pieces of the record, to read the file otherwise, and to look for a
        second term where the best leaves noise alone.
    """
    subject = nearer(subject)
    base = subject.judge(subject.base)
    if base is None:
        return None
    ways = progress, is_over, is_candidate
    rounds = _Rounds(Found(subject, base), *ways, thorough=thorough)
    model = subject.problem.model
    if not thorough:
        return _along_the_whole(rounds)
    rounds.propose(subject.base, (1,), _QUOTAS)
    other = _between_samples(rounds.found)
    if other is None and model.states and not model.begins_as_declared and rounds.leave_more():
        rounds.propose(subject.base, _PIECES, _QUOTAS)
        other = _between_samples(rounds.found)
    if other is not None:
        progress("inputs go otherwise between samples")
        return search(other, *ways)
    for one in itertools.filterfalse(is_white, rounds.found.best(_BEST)[:_BEST]):
        if len(one.terms) < _MOST_TERMS:
            rounds.propose(one.fit, (1,), {1: _SECOND})
    rounds.subsets()
    rounds.shapes()
    rounds.owners()
    rounds.polish()
    rounds.subsets()
    rounds.parts_of_best()
    rounds.polish()
    found = _on_all_samples(_read_otherwise(rounds.found, *ways))
    linearised = 0
    while linearised < _LINEARISATIONS and _is_linearised_anew(found):
        read = [_with_base_anew(subject) for subject in found.read]
        found = _refitted(found, _with_base_anew(found.subject), read, _faults(found))
        linearised += 1
    # what inputs do between samples is less than a linearisation elsewhere leaves
    other = _between_samples(found) if linearised else None
    return found if other is None else search(other, *ways)


def _is_far(fitted: Fit) -> bool:
    """Return whether parameters went far from nominal."""
    shift = fitted.point.q - _at_nominal(fitted).q
    return bool(np.any(np.abs(shift) > _FAR * fitted.problem.deviation))


def _at_nominal(fitted: Fit) -> Point:
    """Return the point of a fit with nominal parameters, but for phases of clocks."""
    point = fitted.point
    return replace(point, q=fitted.problem.nominal_at_phases(point.q))


def _along_the_whole(rounds: _Rounds) -> Found:
    """Fit what the whole record proposes, once more around the best if that leaves more.

    Also along the nominal model where parameters went far: along it an effect has the response
    that they hide.
    """
    base = rounds.found.base.fit
    rounds.propose(base, (1,), _QUICK)
    if _is_far(base):
        plain = not_fitted(base.problem, _at_nominal(base), weights_of(base.errors))
        if plain is not None:
            rounds.propose(plain, (1,), _QUICK)
    for one in filter(leaves_more, rounds.found.best(1)[:1]):
        rounds.propose(one.fit, (1,), {1: _SECOND})
    rounds.subsets()
    rounds.polish()
    return _on_all_samples(rounds.found)


def is_white(judged: Judged) -> bool:
    """Return whether errors are white noise where a model was fitted.

    Its correlations have a standard error of ``1 / sqrt(n)`` (Bartlett: On the theoretical
    specification and sampling properties of autocorrelated time-series, 1946).
    """
    for independent, errors in zip(judged.effective, judged.fit.errors, strict=True):
        n = np.maximum(np.isfinite(errors).sum(axis=0), 1)
        if (independent * (1.0 + 2.0 * _CHANCE / np.sqrt(n)) < n)[independent > 0.0].any():
            return False
    return True


def _is_linearised_anew(found: Found) -> bool:
    """Linearise a model where its best fits are, if it is linear; return whether it was not yet."""
    model = found.subject.problem.model
    known = True
    for one in (found.base, *found.best(_BEST), *_faults(found)):
        problem = one.fit.problem
        known &= not model.linearise_at(problem.parameters(one.fit.point.q))
    return not known


def _with_base_anew(subject: Subject) -> Subject:
    """Return a subject with the fit without terms made anew."""
    base = fit_base(subject.problem, subject.base.point.q)
    return subject if base is None else replace(subject, base=base)


def _faults(found: Found) -> list[Judged]:
    """Return the best fits of a fault of one sensor alone, each of another fault."""
    best: dict[object, Judged] = {}
    for one in sorted(found.fits, key=lambda one: one.fit.misfit):
        if len(one.parts) == 1 and isinstance(one.parts[0], SensorTerm):
            best.setdefault(one.parts[0].cause, one)
    return list(best.values())[:_FAULTS]


def _on_all_samples(found: Found) -> Found:
    """Return the fits among which a conclusion is drawn, of all samples if there are more."""
    whole = found.subject.complete()
    if whole is None or whole.judge(whole.base) is None:
        return found
    readings = {one.reading for one in _finalists(found)}
    again = [read_again(whole, few) for few in found.read if few.reading in readings]
    return _refitted(found, whole, [one for one in again if one is not None])


def _refitted(
    found: Found, whole: Subject, read: Sequence[Subject], others: Sequence[Judged] = ()
) -> Found:
    """Return the fits among which a conclusion is drawn, and others, fitted anew.

    To the whole of the file as it was read, and in other readings of it.
    """
    finalists = _finalists(found)
    finalists += [one for one in others if one not in finalists]
    base = whole.judge(whole.base)
    if base is None:
        return found
    subjects = {one.reading: one for one in (whole, *read)}

    def refitted(one: Judged) -> Judged | None:
        subject = subjects.get(one.reading)
        if subject is None:
            return None
        if not one.terms:
            return subject.judge(subject.base)
        start, weights = [one.fit.point], weights_of(one.fit.errors)
        return _judged(subject, one.terms, start, weights, _LAST_STEPS, FLAT)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        fits = [one for one in pool.map(refitted, finalists) if one is not None]
    chosen_from = found.chosen_from + len(found.fits) - len(finalists)
    return Found(whole, base, tuple(fits), tuple(read), chosen_from)


def _finalists(found: Found) -> list[Judged]:
    """Return the fits among which a conclusion is drawn: all that may change it.

    The best; the best sets with all that were fitted of their parts, by which causes are put in
    order; the best without each of the causes; and the one that gains most where it was fitted.
    """
    ranked = found.compared()
    good = [entry.judged for entry in ranked if not entry.comparison.is_worse]
    sets: dict[frozenset[object], Judged] = {}
    for one in good:
        sets.setdefault(frozenset(part.source for part in one.parts), one)
    leading = dict(list(sets.items())[:_LEADING])
    gaining = sorted(ranked, key=lambda entry: entry.comparison.cost - entry.comparison.fitted)
    chosen = [
        *good[:_FINALISTS],
        *found.best(1),
        *leading.values(),
        *(one for key, one in sets.items() if any(key < whole for whole in leading)),
        *_without_causes(good, leading.values()),
        *_shapes_of_best_term(good),
        *(entry.judged for entry in gaining[:1]),
    ]
    # sets that differ in the constants from which they were fitted are one
    same = {(o.reading, frozenset((t.source, t.shape) for t in o.terms)): o for o in chosen[::-1]}
    return list(same.values())


def _without_causes(fits: Sequence[Judged], leading: Iterable[Judged]) -> Iterator[Judged]:
    """Yield the best fit without each cause of the leading ones, and without the first of them."""
    causes = list(dict.fromkeys(part.cause for one in leading for part in one.parts))
    counts = range(2, len(causes) + 1)
    for some in [*({cause} for cause in causes), *(set(causes[:count]) for count in counts)]:
        others = (one for one in fits if some.isdisjoint(part.cause for part in one.parts))
        yield from itertools.islice(others, 1)


def _shapes_of_best_term(fits: Sequence[Judged]) -> list[Judged]:
    """Return the best fits of the best single term.

    Which of its shapes is right depends on more samples than other choices do.
    """
    alone = [one for one in fits if len(one.parts) == 1]
    return [one for one in alone if one.parts[0].source == alone[0].parts[0].source][:_FORMS]


def _between_samples(found: Found) -> Subject | None:
    """Return the subject whose inputs go the other way between samples, if that is far likelier.

    A model that lacks a law hides it: what inputs do within a step is less than the law does, until
    that is there.
    """
    ours = [judged.fit for judged in found.best(_BEST)]
    other = found.subject.otherwise() if ours else None
    if other is None:
        return None
    samples = np.sum(found.common.fitted, axis=0)

    def evidence(fitted: Fit) -> float:
        left = np.log(variance_of(fitted.errors))
        columns = fitted.freedom * np.log(max(samples.sum(), 1.0))
        return -0.5 * float(np.nansum(samples * left) + columns)

    sets = [(one, terms) for one in ours for terms in (one.terms, *_with_one_less(one.terms))]
    theirs = (
        fit(other.problem, terms, [_extended(one, terms)], weights_of(one.errors), _FEWER_STEPS)
        for one, terms in sets
    )
    best = max((evidence(one) for one in theirs if one is not None), default=-np.inf)
    clearly = WEIGHTS.least + found.temper
    return other if best - max(map(evidence, ours)) > clearly else None


def _read_otherwise(
    found: Found,
    progress: Callable[[str], None],
    is_over: Callable[[], bool],
    is_candidate: Callable[[Term], bool],
) -> Found:
    """Return what is found with fits of the file in other readings, with a few terms or none.

    None are tried of a file that a model near nominal explains as it was read, up to white noise.
    """
    if is_over() or (is_white(found.base) and not _is_far(found.base.fit)):
        return found
    progress("other readings of the file")
    for subject in misreadings(found.subject, found.base):
        base = subject.judge(subject.base)
        if base is None:
            continue
        rounds = _Rounds(Found(subject, base), progress, is_over, is_candidate)
        rounds.propose(subject.base, tuple(_OF_READING), _OF_READING)
        rounds.subsets()
        rounds.polish()
        found = found.with_fits([base, *rounds.found.fits], [subject])
    return found


class _Rounds:
    """Rounds of proposals and fits."""

    def __init__(
        self,
        found: Found,
        progress: Callable[[str], None],
        is_over: Callable[[], bool] = lambda: False,
        is_candidate: Callable[[Term], bool] = lambda term: True,
        *,
        thorough: bool = True,
    ):
        self.found = found
        self._thorough = thorough
        self._progress = progress
        self._is_over = is_over
        self._is_candidate = is_candidate
        self._tried: set[frozenset[Term]] = set()
        self._terms: list[Term] = []
        self._weights = weights_of(found.subject.base.errors)

    def propose(
        self, fitted: Fit, pieces: Sequence[int], quotas: dict[int, dict[int, int]]
    ) -> None:
        """Propose sets along courses in so many pieces, and fit them with what is there."""
        for count in pieces:
            screen = None if self._is_over() else self._screen(fitted, count)
            if screen is None:
                continue
            self._terms += [c.term for c in screen.candidates if not isinstance(c.term, SensorTerm)]
            room = _MOST_TERMS - len(fitted.terms)
            alone = self._tried_alone(fitted) if count == 1 else ()
            asked = list(_by_quota(screen, quotas[count], room, fitted.terms, alone))
            along = "the record" if count == 1 else f"{count} pieces of the record"
            asking = f"{len(screen.candidates)} terms along {along}, {len(asked)} sets"
            self._progress(f"{asking}{self._so_far()}")
            for _, same in itertools.groupby(sorted(asked, key=len), key=len):
                self._fit_all([_starts_of(screen, chosen, fitted) for chosen in same])

    def _tried_alone(self, fitted: Fit) -> tuple[type[Term], ...]:
        """Return the kinds of which each term is tried alone, along the whole of the record.

        Faults of sensors: parameters that do their work beside the truth may hide them from the
        screen, and they are few. Effects of the catalogue if parameters went far: dry friction
        looks like another damping and inductance.
        """
        if not self._thorough:
            return ()
        return (SensorTerm, NamedTerm) if _is_far(fitted) else (SensorTerm,)

    def _so_far(self) -> str:
        """Return the terms of the best fit so far, for a report of progress; empty without any."""
        names = " and ".join(t.name for one in self.found.best(1)[:1] for t in one.terms)
        return f"; best so far: {names}" if names else ""

    def leave_more(self) -> bool:
        """Return whether the best so far leaves more than noise."""
        return all(map(leaves_more, self.found.best(1)[:1]))

    def _screen(self, fitted: Fit, count: int) -> Screen | None:
        """Return the responses along the free run, or along pieces whose starts are estimated.

        None if the model runs away, or nothing may be a cause.
        """
        if count == 1:
            along = courses_of_fit(fitted)
        else:
            pieces, starts = _pieces(fitted, count)
            along = courses_of(fitted, pieces, starts) if pieces else None
        if along is None:
            return None
        screen = screen_of(along, count == 1, self._is_candidate)
        return screen if screen.candidates else None

    def _fit_all(
        self, asked: Iterable[tuple[tuple[Term, ...], list[Point]]], most: int = _STEPS
    ) -> None:
        """Fit sets on all cores, each from its own starts and from fits of its subsets."""
        new = []
        for terms, points in asked:
            key = frozenset(terms)
            if key in self._tried or len({t.source for t in terms}) < len(terms):
                continue
            self._tried.add(key)
            new.append((terms, [*points, *self._nested(terms)]))
        subject = self.found.subject

        def judged(job: tuple[tuple[Term, ...], list[Point]]) -> Judged | None:
            return None if self._is_over() else _judged(subject, *job, self._weights, most)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            fits = [one for one in pool.map(judged, new) if one is not None]
        self.found = self.found.with_fits(fits)

    def _nested(self, terms: tuple[Term, ...]) -> list[Point]:
        """Return points of fits whose terms are some of these, the others being small."""
        points = []
        for judged in self.found.fits:
            own = set(judged.terms)
            if own < set(terms):
                points.append(_extended(judged.fit, terms))
        return points[-3:]

    def subsets(self) -> None:
        """Fit what is left of the best sets without some of their terms."""
        asked = [part for one in self.found.best(_SUBSETS) for part in _parts_of(one.fit)]
        self._fit_all(asked, _FEWER_STEPS)

    def parts_of_best(self) -> None:
        """Fit what is left of the best set without some of its terms from where it ended.

        Parts that were fitted from elsewhere may have ended at less than they explain.
        """
        for one in self.found.best(1)[:1]:
            parts = _parts_of(one.fit)
            self._tried -= {frozenset(terms) for terms, _ in parts}
            self._fit_all(parts, _LAST_STEPS)

    def shapes(self) -> None:
        """Fit the best sets with other shapes and other memories of each of their terms."""
        asked = []
        for one in self.found.best(_SHAPES):
            fitted = one.fit
            along = courses_of_fit(fitted)
            if along is None:
                continue
            for term in filter(_is_function, one.terms):
                for other, values in replacements(along, term):
                    asked.append(_replaced(fitted, term, other, values))
                asked += [_replaced(fitted, term, other) for other in other_memories(term)]
        self._fit_all(asked, _FEWER_STEPS)

    def owners(self) -> None:
        """Fit the best sets with each of their terms in every other law, or as a known effect."""
        asked = [
            _replaced(one.fit, term, other)
            for one in self.found.best(_SHAPES)
            for term in filter(_is_function, one.terms)
            for other in (*self._in_other_laws(term), *self._effects_like(term))
        ]
        self._fit_all(asked, _FEWER_STEPS)

    def _effects_like(self, term: Term) -> Iterator[NamedTerm]:
        """Yield the effects of the catalogue in the law of a term, of its signal.

        They are plainer, and in a screen a term that can do more may stand before them.
        """
        for other in dict.fromkeys(self._terms):
            if isinstance(other, NamedTerm) and (other.law, other.signal) == (
                term.law,
                term.signal,
            ):
                yield other

    def _in_other_laws(self, term: Term) -> Iterable[Term]:
        """Return a term of a signal in each of the other laws that a screen had it in."""
        in_laws = (other for other in self._terms if other.law)  # an effect may be in none
        same = {other.law: other for other in in_laws if _view_of(other) == _view_of(term)}
        return [
            replace(term, law=law, factor=other.factor, size=other.size)
            for law, other in same.items()
            if law != term.law
        ]

    def polish(self) -> None:
        """Fit the best on, in the noise that they leave."""
        subject = self.found.subject
        for one in self.found.best(_SUBSETS):
            if self._is_over():
                return
            weights = weights_of(one.fit.errors)
            fitted = fit(subject.problem, one.terms, [one.fit.point], weights, _LAST_STEPS)
            judged = None if fitted is None else subject.judge(fitted)
            if judged is not None:
                self.found = self.found.with_fits([judged])


def _judged(
    subject: Subject,
    terms: tuple[Term, ...],
    points: Sequence[Point],
    weights: Sequence[Array],
    most: int,
    flat: float = _NEARLY_FLAT,
) -> Judged | None:
    """Fit a set of terms from points; see `fit`."""
    begun = fit(subject.problem, terms, points, weights, 0, flat)
    if begun is None:
        return None
    # in the noise of a worse model an end is flat that is not one in its own
    fitted = fit(subject.problem, terms, [begun.point], weights_of(begun.errors), most, flat)
    return None if fitted is None else subject.judge(located(fitted))


def _parts_of(fitted: Fit) -> list[tuple[tuple[Term, ...], list[Point]]]:
    """Return the sets of fewer terms of a fit, each with where it ended."""
    counts = range(1, len(fitted.terms))
    parts = [part for n in counts for part in itertools.combinations(fitted.terms, n)]
    return [(part, [_extended(fitted, part)]) for part in parts]


def _with_one_less(terms: tuple[Term, ...]) -> list[tuple[Term, ...]]:
    """Return the sets of all but one of several terms."""
    return list(itertools.combinations(terms, len(terms) - 1)) if len(terms) > 1 else []


def _is_function(term: Term) -> bool:
    """Return whether a term is a function of a signal in a law, of which there are others."""
    return bool(term.signal) and not isinstance(term, NamedTerm | SensorTerm)


def _replaced(
    fitted: Fit, term: Term, other: Term, values: Sequence[Array] = ()
) -> tuple[tuple[Term, ...], list[Point]]:
    """Return the terms of a fit with another in place of one, and points from which it starts.

    Each with values of the other; without any, with a small one.
    """
    terms = tuple(other if one == term else one for one in fitted.terms)
    at = terms.index(other)
    points = []
    for start in values or [other.values(SMALL)]:
        own = [fitted.values_of(one) for one in fitted.terms]
        own[at] = start
        points.append(replace(fitted.point, values=np.concatenate(own)))
    return terms, points


def _view_of(term: Term) -> tuple[object, ...]:
    """Return what a term sees of a signal, in proportion to what: all but its law and shape."""
    return term.signal, term.memory, "law" if term.factor == term.law else term.factor


def _extended(fitted: Fit, terms: Sequence[Term]) -> Point:
    """Return a fit's point for other terms: its own values where it has them, else small ones."""
    values = [fitted.values_of(t) if t in fitted.terms else t.values(SMALL) for t in terms]
    return Point(fitted.point.q, np.concatenate(values), fitted.point.starts)


def _starts_of(
    screen: Screen, chosen: Sequence[int], fitted: Fit
) -> tuple[tuple[Term, ...], list[Point]]:
    """Return a set of terms with starts: small, as the screen has it, and at other instants.

    From nominal parameters, too, if those of the fit are far away.
    """
    terms = tuple(screen.candidates[i].term for i in chosen)
    coefficients, shift = screen.solve(chosen)
    amounts = [np.clip(own, -_CLIP, _CLIP) for own in coefficients]
    point = fitted.point
    moved = _shifted(fitted, shift)
    points = [_beside(point, terms), _beside(moved, terms, amounts), _beside(point, terms, amounts)]
    if _is_far(fitted):
        nominal = _at_nominal(fitted)
        for others in itertools.product(*map(with_shorter_lags, terms)):
            points.append(_beside(nominal, others))
    for k, term in enumerate(terms):
        for other in at_other_instants(term):
            points.append(_beside(moved, (*terms[:k], other, *terms[k + 1 :]), amounts))
    return (*fitted.terms, *terms), points


def _shifted(fitted: Fit, shift: Array) -> Point:
    """Return the point of a fit with parameters shifted by so many deviations, within bounds."""
    problem, q = fitted.problem, fitted.point.q
    step = np.clip(shift[: len(q)] * problem.deviation, -_SHIFT, _SHIFT)
    return replace(fitted.point, q=np.clip(q + step, *problem.bounds))


def _beside(point: Point, terms: Sequence[Term], amounts: Sequence[float | Array] = ()) -> Point:
    """Return a point with further terms, of small amounts by default."""
    pairs = zip(terms, amounts or [SMALL] * len(terms), strict=True)
    values = [term.values(amount) for term, amount in pairs]
    return replace(point, values=np.concatenate([point.values, *values]))


class _Quota:
    """Counts sets of terms, of which few have the same first term, and fewer are trends."""

    def __init__(self, most: Mapping[int, int]) -> None:  # sets by their number of terms
        self._most = most
        self._taken: Counter[object] = Counter()

    def takes(self, terms: Sequence[Term], first: Term) -> bool:
        """Count a set if there is room for it, and return whether there was."""
        size = len(terms)
        is_named = bool(effects_in(terms))
        kind, lead, timed = (size, is_named), (size, first.source), (size, "time")
        is_trend = any(term.is_trend for term in terms)
        most = (_NAMED if is_named else self._most).get(size, 0)
        taken = self._taken
        if taken[kind] >= most or taken[lead] >= _LEADS or (is_trend and taken[timed]):
            return False
        taken.update([lead, timed if is_trend else kind])
        return True


def _by_quota(
    screen: Screen,
    quota: Mapping[int, int],
    most: int,
    there: Sequence[Term],
    alone: tuple[type[Term], ...] = (),
) -> Iterator[tuple[int, ...]]:
    """Yield the best sets of each number of terms, by quota, and all single ones of some kinds."""
    quotas = _Quota(quota)
    sources = {term.source for term in there}
    for value, chosen in screen.propose(min(most, max(quota))):
        terms = [screen.candidates[i].term for i in chosen]
        if len(terms) == 1 and not there and isinstance(terms[0], alone):
            yield chosen
        elif value > _WORTH and sources.isdisjoint(term.source for term in terms):
            first = max(chosen, key=lambda i: screen.value([i]))
            if quotas.takes(terms, screen.candidates[first].term):
                yield chosen


def _pieces(fitted: Fit, count: int) -> tuple[list[Record], list[Array]]:
    """Cut the records to pieces that follow the measurement, each from a start of its own."""
    problem = fitted.problem
    if fitted.terms:
        return [], []
    weight = np.full(len(problem.spread), _PIECE_WEIGHT)
    pieces, starts = [], []
    for record, start in zip(problem.records, fitted.point.starts, strict=True):
        course = problem.run(record, fitted.point, (), start, False)
        if course is None:
            return [], []
        for first, last in itertools.pairwise(piece_ends(record, count)):
            piece = record.part(first, last)
            prior = _prior_at(problem.model, record, course.states, first, start)
            own = fit_start(problem, fitted.point, (), piece, prior, weight)
            if own is None:
                return [], []
            pieces.append(piece)
            starts.append(own[1])
    return pieces, starts


def _prior_at(
    model: LawModel, record: Record, states: Array, first: int, start: Array
) -> StartPrior:
    """Return the prior of the states at a sample: of the course (n, nx) of a run, or measured.

    At the first one it is the start, which is known well.
    """
    nominal = model.nominal_states
    if first == 0:
        return StartPrior(start.copy(), np.maximum(0.02 * nominal, 1e-9))
    mean = states[first].copy()
    for state, output in model.measured_states.items():
        if np.isfinite(record.outputs[first, output]):
            mean[state] = record.outputs[first, output]
    return StartPrior(mean, np.clip(states.std(axis=0), nominal, 30.0 * nominal))
