"""Claims: a search finds what a record lacks, keeps sets nested, and ranks what it fitted."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration.diagnosis.search  # noqa: F401
from fmus.kit.arrays import Array
from orchestration.diagnosis import Found, Shape, Term, subject_of
from orchestration.diagnosis.conclude import conclude
from orchestration.diagnosis.fitting import Fit, Point
from orchestration.diagnosis.search import search
from orchestration.diagnosis.term_names import sentence
from orchestration.diagnosis.terms import Memory, NamedTerm, SensorTerm
from tests.support.diagnosed_mass import START, D, K, M, exact, integrated, mass, pushed
from tests.support.dry_mass import NOISE, drawn, dry, nothing, outside, searched, small_search

NAMES = sys.modules["orchestration.diagnosis.search"]


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Found:
    return small_search(monkeypatch, dry)


def test_the_missing_friction_is_the_best_fit(found: Found) -> None:
    """With its size of 2 N, and the errors of the noise alone."""
    best = found.compared()[0]
    one = best.judged
    (term,) = one.terms
    assert term.cause == ("friction", "v")
    assert term.shape is Shape.DRY
    assert one.fit.values_of(term)[0] * term.size == pytest.approx(2.0, rel=0.05)
    assert one.left_out < 0.15 * found.base.left_out
    assert best.comparison.left_out > 20.0
    assert best.score > 20.0


def test_a_file_is_read_otherwise_where_the_model_leaves_more_than_white_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(NAMES, "misreadings", lambda *given: asked.append(given) or [])
    small_search(monkeypatch, nothing, 241)  # of other searches results are kept
    assert not asked
    small_search(monkeypatch, dry, 241)
    assert asked


def test_fits_are_compared_best_first(found: Found) -> None:
    scores = [ranked.score for ranked in found.compared()]
    assert scores == sorted(scores, reverse=True)
    assert len(scores) == len(found.fits)


def test_fits_are_compared_once(found: Found, monkeypatch: pytest.MonkeyPatch) -> None:
    """However often they are asked for; what is found later is contrasted alone."""
    calls: list[str] = []

    def counted(name: str) -> None:
        plain = getattr(NAMES, name)
        monkeypatch.setattr(NAMES, name, lambda *given: calls.append(name) or plain(*given))

    counted("compare")
    counted("contrast")
    few = Found(found.subject, found.base, found.fits[:3])
    assert few.compared() == few.compared()
    assert few.temper >= 3.0
    assert calls == 3 * ["contrast"] + 3 * ["compare"]
    more = few.with_fits(found.fits[3:4])
    assert {id(one.judged) for one in more.compared()} == set(map(id, found.fits[:4]))
    assert (calls.count("contrast"), calls.count("compare")) == (4, 3 + 4)


def test_the_best_differ_by_sources_and_are_not_worse(found: Found) -> None:
    best = found.best(4)
    worse = {id(r.judged) for r in found.compared() if r.comparison.is_worse}
    assert not worse & {id(one) for one in best}
    sources = [frozenset(t.source for t in one.terms) for one in best[:4]]
    assert len(set(sources)) == len(sources)
    good = [r.judged for r in found.compared() if not r.comparison.is_worse]
    lowest = min(good, key=lambda one: float(np.nanmean(one.choosing**2)))
    assert any(one is lowest for one in best)


def test_other_shapes_of_the_winner_are_tried(found: Found) -> None:
    shapes = {one.terms[0].shape for one in found.fits if len(one.terms) == 1}
    assert len(shapes) >= 5


def test_a_term_has_other_owners_with_their_sizes(found: Found) -> None:
    """Those laws in which the screen had the same signal, seen in the same way.

    An effect on an input is in no law.
    """
    rounds = NAMES._Rounds(Found(found.subject, found.base), print)
    heat = Term("heat", "v", Shape.SQUARE, size=7.0)
    rounds._terms = [
        Term("friction", "v", Shape.DRY, size=2.0),
        heat,
        replace(heat, law="load", factor="load"),
        replace(heat, law="slow", memory=Memory.LAG, constants=(1.0,)),
        replace(heat, law="other", signal="x"),
        NamedTerm("", "v", Shape.LINEAR, effect="input_lag", family="input_lag"),
    ]
    curve = Term("friction", "v", Shape.CUBE, size=2.0)
    assert rounds._in_other_laws(curve) == [replace(curve, law="heat", size=7.0)]
    change = replace(curve, factor="friction", size=1.0)
    assert rounds._in_other_laws(change) == [replace(change, law="load", factor="load", size=7.0)]


def test_no_set_is_fitted_again_but_to_polish_it_or_as_a_part_of_the_best(found: Found) -> None:
    sets = [frozenset(one.terms) for one in found.fits]
    assert len(sets) - len(set(sets)) <= 2 * 7 + 3


def test_the_part_of_the_best_set_that_explains_is_ahead_of_it(found: Found) -> None:
    """Two terms ended nearer to the friction than it did alone, from where they began."""
    best, *others = (entry.judged for entry in found.compared())
    assert len(best.terms) == 1
    second = next(one for one in others if one.terms != best.terms)
    assert set(best.terms) < set(second.terms)
    assert best.fit.misfit < 1.05 * second.fit.misfit


def test_a_set_that_was_fitted_is_not_fitted_again(found: Found) -> None:
    rounds = NAMES._Rounds(Found(found.subject, found.base), print)
    one = found.compared()[0].judged
    asked = [(one.terms, [one.fit.point])]
    rounds._fit_all(asked, 1)
    assert len(rounds.found.fits) == 1
    rounds._fit_all(asked, 1)
    assert len(rounds.found.fits) == 1


def test_the_lowest_on_what_is_left_out_is_among_the_best(found: Found) -> None:
    """Even where the score of another is higher."""
    first, second = found.best(2)[:2]
    low = replace(second, choosing=0.99 * first.choosing, words=1e3)
    best = Found(found.subject, found.base, (first, low)).best(1)
    assert [one.terms for one in best] == [first.terms, low.terms]


def test_a_larger_set_starts_from_its_parts_too(found: Found) -> None:
    one = found.compared()[0].judged
    other = Term("spring", "x", Shape.CUBE, size=3.0)
    rounds = NAMES._Rounds(Found(found.subject, found.base, (one,)), print)
    (point,) = rounds._nested((other, *one.terms))
    assert point.values[1:] == pytest.approx(one.fit.point.values)
    assert point.q == pytest.approx(one.fit.point.q)
    assert rounds._nested((other,)) == []


def test_values_of_a_part_go_over_to_the_whole(found: Found) -> None:
    one = found.compared()[0].judged
    (term,) = one.terms
    other = Term("spring", "x", Shape.CUBE, size=3.0)
    point = NAMES._extended(one.fit, (other, term))
    assert point.values[0] == pytest.approx(1e-3)
    assert point.values[1:] == pytest.approx(one.fit.values_of(term))


def test_pieces_follow_the_measurement() -> None:
    """Each from the state that its own samples show, where the free run is off."""
    subject = subject_of(mass(), [drawn(dry)])
    assert subject is not None
    pieces, starts = NAMES._pieces(subject.base, 8)
    assert sum(len(p.time) for p in pieces) == len(subject.problem.records[0].time)
    assert len(pieces) == 8
    setting = subject.problem.setting(subject.base.point, ())
    errors = []
    for piece, start in zip(pieces, starts, strict=True):
        course = mass().run(piece, setting, start)
        assert course is not None
        errors.append((piece.outputs - course.outputs) / subject.problem.spread)
    assert np.sqrt(np.mean(np.concatenate(errors) ** 2)) < 0.6 * subject.base.misfit
    for piece, start in zip(pieces, starts, strict=True):
        assert start[0] == pytest.approx(piece.outputs[0, 0], abs=0.05)


def test_a_quota_limits_sets_of_one_size_and_one_lead() -> None:
    subject = subject_of(mass(), [drawn(dry, 200)])
    assert subject is not None
    screen = NAMES._Rounds(Found(subject, subject.judge(subject.base)), print)._screen(
        subject.base, 1
    )
    assert screen is not None
    chosen = list(NAMES._by_quota(screen, {1: 3, 2: 4}, 2, (), (SensorTerm,)))
    alone = [screen.candidates[c[0]].term for c in chosen if len(c) == 1]
    faults = [term.name for term in alone if isinstance(term, SensorTerm)]
    assert len(alone) - len(faults) == 3
    kinds = ("offset", "gain", "drift", "lag")
    assert sorted(faults) == sorted(
        ["transport_delay(position)", *(f"sensor_{kind}(position)" for kind in kinds)]
    ), "each alone, whatever the screen says of it"
    pairs = [c for c in chosen if len(c) == 2]
    leads = [screen.candidates[max(c, key=lambda i: screen.value([i]))].term.source for c in pairs]
    assert 2 <= len(pairs) <= 4
    assert max(map(leads.count, leads)) <= 2
    friction = [c.term for c in screen.candidates if c.term.cause == ("friction", "v")]
    again = NAMES._by_quota(screen, {1: 50}, 1, friction)
    there = {t.source for t in friction}
    assert not any(screen.candidates[i].term.source in there for c in again for i in c)


def test_effects_are_tried_alone_where_parameters_went_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the screen says of one whose work they do."""
    subject = subject_of(mass(), [drawn(dry, 200)])
    assert subject is not None
    rounds = NAMES._Rounds(Found(subject, subject.judge(subject.base)), print)
    screen = rounds._screen(subject.base, 1)
    assert screen is not None
    term = NamedTerm("friction", "v", Shape.LINEAR, effect="braked", family="braked")
    screen.candidates[0] = replace(screen.candidates[0], term=term)
    monkeypatch.setattr(screen, "propose", lambda most: [(-30.0, (0,))])
    assert list(NAMES._by_quota(screen, {1: 3}, 2, ())) == []
    assert list(NAMES._by_quota(screen, {1: 3}, 2, (), (NamedTerm,))) == [(0,)]


def point_of(found: Found, term: Term) -> tuple[Array, Array, tuple[Array, ...]]:
    """Return the point of the base with a small term."""
    point = found.base.fit.point
    return point.q, term.values(0.1), point.starts


def test_effects_in_the_law_of_a_term_and_of_its_signal_are_tried_in_its_place(
    found: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In place of a term of best sets; not what is of another law or of another signal."""
    rounds = NAMES._Rounds(Found(found.subject, found.base), print)
    braked = NamedTerm("friction", "v", Shape.LINEAR, effect="braked", family="braked")
    others = [replace(braked, law="spring"), replace(braked, signal="x"), replace(braked, law="")]
    rounds._terms = [Term("friction", "v", Shape.DRY), *others, braked, braked]
    heated = Term("friction", "v", Shape.LINEAR, Memory.HEAT, (1.0,), "friction")
    assert list(rounds._effects_like(heated)) == [braked]
    fitted = replace(found.base.fit, terms=(heated,), point=Point(*point_of(found, heated)))
    best = [replace(found.base, fit=fitted)]
    monkeypatch.setattr(type(rounds.found), "best", lambda self, count: best)
    asked: list[Any] = []
    monkeypatch.setattr(rounds, "_fit_all", lambda sets, most: asked.extend(sets))
    rounds.owners()
    assert (braked,) in [terms for terms, _ in asked]


def test_a_search_begins_along_pieces_where_a_model_is_astray() -> None:
    """A quarter of the natural frequency, and little damping."""
    record = pushed(2000)
    push = np.random.default_rng(6).normal(0.0, 5.0, len(record.time))
    truth = (M, K / 16.0, 0.02 * D)
    outputs = exact(record, truth, START, push)[:, :1]
    subject = subject_of(mass(), [replace(record, inputs=push[:, None], outputs=outputs)])
    assert subject is not None
    assert subject.base.misfit > 0.5
    found = search(subject, is_over=lambda: True)
    assert found is not None
    fitted = found.base.fit
    assert fitted.problem.parameters(fitted.point.q)[:3] == pytest.approx(truth, rel=1e-2)


def test_a_model_that_runs_away_over_what_is_left_out_is_not_searched() -> None:
    subject = subject_of(mass(), [drawn(nothing, 120)])
    assert subject is not None
    away = replace(subject.base.point, values=np.array([-3000.0, np.log(0.01)]))
    term = Term(
        "friction", "time", Shape.ABOVE, middle=pushed(85, 0.04).time[-1], factor="friction"
    )
    lost = replace(subject, base=replace(subject.base, terms=(term,), point=away))
    assert search(lost) is None


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [True, False])
def test_how_inputs_go_is_seen_once_the_missing_law_is_there(smooth: bool) -> None:
    """Without it both ways leave the same; with it a force that is held is half a step late."""
    record = pushed(300, 0.1, smooth)

    def rates(x: Array, u: float, t: float) -> list[float]:
        return [x[1], (u - K * x[0] - D * x[1] - dry(x, u, t)) / M]

    noise = 0.001 * np.random.default_rng(2).standard_normal((300, 1))
    record = replace(record, outputs=integrated(record, rates, START, 1e-6)[:, :1] + noise)
    subjects = [subject_of(mass(), [record], interpolate=way) for way in (False, True)]
    first, other = (one for one in subjects if one is not None)
    subject = replace(first, otherwise=lambda: other)
    base = subject.judge(subject.base)
    assert base is not None
    rounds = NAMES._Rounds(Found(subject, base), print)
    friction = Term("friction", "v", Shape.DRY, size=2.0, scale=1.0, width=0.05)
    start = Point(first.base.point.q, friction.values(1.0), first.base.point.starts)
    rounds._fit_all([((friction,), [start])])
    assert NAMES._between_samples(rounds.found) is (other if smooth else None)


def test_a_search_that_begins_anew_has_the_same_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    subject = subject_of(mass(), [drawn(dry, 120)])
    assert subject is not None
    others = iter([replace(subject)])
    monkeypatch.setattr(NAMES, "_between_samples", lambda found: next(others, None))
    monkeypatch.setattr(NAMES, "misreadings", lambda one, base: [])
    told: list[str] = []
    found = search(subject, told.append, is_candidate=lambda term: False)
    assert found is not None
    assert not found.fits
    assert "inputs go otherwise between samples" in told


def test_a_conclusion_is_drawn_of_all_samples_alone(found: Found) -> None:
    """Of 200 fitted samples where 160 were searched; friction is that of 2 N that was drawn."""
    whole = subject_of(mass(), [drawn(dry, 300)])
    few = replace(found, subject=replace(found.subject, complete=lambda: whole))
    last = NAMES._on_all_samples(few)
    assert last.subject is whole
    assert {len(one.fit.errors[0]) for one in (last.base, *last.fits)} == {200}
    assert len(last.fits) + last.chosen_from == len(found.fits)
    (term,) = last.compared()[0].judged.terms
    assert term.cause == ("friction", "v")
    assert last.compared()[0].judged.fit.values_of(term)[0] * term.size == pytest.approx(
        2, rel=0.05
    )
    assert NAMES._on_all_samples(found) is found


def test_the_fits_that_are_chosen_lead_to_the_same_conclusion(found: Found) -> None:
    chosen = NAMES._finalists(found)
    left = len(found.fits) - len(chosen)
    assert left > 5
    few = Found(found.subject, found.base, tuple(chosen), chosen_from=left)
    assert few.gain_where_fitted() == pytest.approx(found.gain_where_fitted(), rel=0.2)
    ours, theirs = conclude(few), conclude(found)
    assert ours.verdict == theirs.verdict
    assert [c.name for c in ours.causes] == [c.name for c in theirs.causes]
    probabilities = [c.probability for c in theirs.causes]
    assert [c.probability for c in ours.causes] == pytest.approx(probabilities, abs=0.01)


@pytest.mark.parametrize("left", ["noise", "correlated noise", "friction"])
def test_further_rounds_are_of_what_leaves_more_than_noise(
    left: str, found: Found, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pieces of the record are asked where it is slow and large, and what is there beside the best
    of the whole where it is not white.

    The record has noise of a known size; dry friction leaves hardly more, and another shape of
    friction ten times as much.
    """
    alone = [one.judged for one in found.compared() if len(one.judged.terms) == 1]
    friction = alone[0]
    other = next(one for one in alone if one.left_out > 0.5 * found.base.left_out)
    spread = found.subject.problem.spread[0]
    assert friction.left_out * spread < 2.0 * NOISE
    assert other.left_out * spread > 10.0 * NOISE
    errors = friction.fit.errors[0]
    white = errors.std() * np.random.default_rng(5).standard_normal(errors.shape)
    correlated = lfilter([1.0], [1.0, -0.4], white, axis=0)
    best = {
        "noise": replace(friction, fit=replace(friction.fit, errors=(white,))),
        "correlated noise": replace(friction, fit=replace(friction.fit, errors=(correlated,))),
        "friction": other,
    }[left]
    asked: list[tuple[tuple[int, ...], int]] = []

    def watched(self: Any, fitted: Fit, pieces: tuple[int, ...], _: object) -> None:
        asked.append((pieces, len(fitted.terms)))
        self.found = self.found.with_fits([best])

    monkeypatch.setattr(NAMES, "_PIECES", (8, 40))
    monkeypatch.setattr(NAMES, "_FAR", np.inf)
    monkeypatch.setattr(NAMES, "misreadings", lambda one, base: [])
    monkeypatch.setattr(NAMES._Rounds, "propose", watched)
    for work in ("subsets", "shapes", "owners", "polish", "parts_of_best"):
        monkeypatch.setattr(NAMES._Rounds, work, lambda self: None)
    whole, pieces, second = ((1,), 0), ((8, 40), 0), ((1,), 1)
    further = {"noise": [], "correlated noise": [second], "friction": [pieces, second]}
    search(found.subject)
    assert asked == [whole, *further[left]]
    asked.clear()
    search(found.subject, thorough=False)
    assert asked == ([whole, second] if left == "friction" else [whole])


@pytest.mark.slow
def test_a_whole_search_names_friction_and_nothing_else() -> None:
    found, conclusion = searched(dry)
    assert conclusion.verdict == "cause"
    assert conclusion.causes[0].name == "friction(v)"
    assert found.compared()[0].judged.terms[0].shape is Shape.DRY
    assert searched(nothing)[1].verdict == "consistent"
    assert searched(outside)[1].verdict != "cause"


@pytest.mark.slow
def test_a_law_that_changes_is_found_with_its_instant() -> None:
    """The damper doubles after 4.3 s."""
    record = pushed(400)

    def rates(x: Array, u: float, t: float) -> list[float]:
        damping = D * (2.0 if t > 4.3 else 1.0)
        return [x[1], (u - K * x[0] - damping * x[1]) / M]

    noise = 0.003 * np.random.default_rng(3).standard_normal((400, 1))
    outputs = integrated(record, rates, START, 1e-7)[:, :1] + noise
    subject = subject_of(mass(), [replace(record, outputs=outputs)])
    assert subject is not None
    found = search(subject)
    assert found is not None
    (term,) = found.compared()[0].judged.terms
    assert (term.law, term.shape, term.factor) == ("friction", Shape.STEP, "friction")
    assert term.width * term.scale == pytest.approx(4.3, abs=0.3)
    assert sentence(mass().cls, term) == f"friction changes at {term.width * term.scale:.4g} s"


def test_a_search_that_is_not_thorough_goes_along_the_whole_record(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Around the best set that leaves more than noise it goes once more."""
    one = subject_of(mass(), [drawn(dry)])
    assert one is not None
    asked: list[tuple[tuple[int, ...], int]] = []
    plain = NAMES._Rounds.propose

    def watched(self: object, fitted: Fit, pieces: tuple[int, ...], quotas: object) -> None:
        asked.append((pieces, len(fitted.terms)))
        plain(self, fitted, pieces, quotas)

    monkeypatch.setattr(NAMES._Rounds, "propose", watched)
    found = search(one, thorough=False)
    assert found is not None
    assert found.compared()[0].judged.terms[0].cause == ("friction", "v")
    assert asked[0] == ((1,), 0)
    assert len(asked) <= 3
    assert {pieces for pieces, _ in asked} == {(1,)}
    assert not found.read


def test_terms_are_proposed_along_nominal_parameters_where_fitted_ones_went_far(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the phases of clocks that were fitted, of which a mass has none."""
    one = subject_of(mass(), [drawn(dry)])
    assert one is not None
    asked: list[Fit] = []
    monkeypatch.setattr(NAMES._Rounds, "propose", lambda self, fitted, *given: asked.append(fitted))
    monkeypatch.setattr(NAMES, "_FAR", np.inf)
    search(one, thorough=False)
    assert [fitted.point.q.tolist() for fitted in asked] == [one.base.point.q.tolist()]
    monkeypatch.setattr(NAMES, "_FAR", 1e-6)
    asked.clear()
    search(one, thorough=False)
    assert asked[1].point.q == pytest.approx(one.problem.mean)
    assert asked[1].errors[0] != pytest.approx(one.base.errors[0])
    assert not asked[1].terms
