"""Claims: a cause is named where it alone explains what no fit saw, and not otherwise."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter, lsim

from fmus.kit.arrays import Array, Indices
from orchestration.diagnosis import Found, Shape, Term
from orchestration.diagnosis.comparison import Judged, shortfall
from orchestration.diagnosis.conclude import (
    _in_order,
    _is_one_with,
    _minimal,
    _near_the_likeliest,
    _verdict,
    conclude,
    is_lost,
)
from orchestration.diagnosis.fitting import effective_samples
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.terms import Memory, SensorTerm
from tests.support.dry_mass import dry, nothing, outside, small_search
from tests.support.oscillator_model import Oscillator

RNG = np.random.default_rng(8)
REST = SimpleNamespace(outputs=np.zeros((40, 2)))  # a record of outputs that stand still
WHITE, SEEN = RNG.standard_normal((300, 1)), RNG.standard_normal((200, 1))
SLOW = lfilter([1.0], [1.0, -0.5], RNG.standard_normal((1500, 1)), axis=0)
DRY = Term("friction", "v", Shape.DRY)
CURVE = Term("friction", "v", Shape.CURVE, places=(-1.0, 0.0, 1.0))
SPRING = Term("spring", "x", Shape.CUBE)

ANY = {"x", "v", "force", "time", "friction", "charge", "load", "a", "b", "c"}
MODEL = SimpleNamespace(
    laws=[],
    reads=lambda law: ANY,
    targets=[],
    received=(),
    plain_laws=frozenset(),
    outputs=[SimpleNamespace(name="position")],
)
SUBJECT = SimpleNamespace(sizes=np.full(1, 10.0))  # an output that moves by ten times the noise


def judged(
    fitted: float,
    left_out: float | Array,
    *terms: Term,
    words: float = 0.0,
    noise: Array = WHITE,
    phases: Indices | None = None,
) -> Judged:
    """Return a fit with errors of so many times those of the base."""
    errors = fitted * noise
    freedom = sum(t.freedom for t in terms)
    fit = SimpleNamespace(
        errors=(errors,),
        terms=terms,
        misfit=fitted,
        freedom=freedom,
        explanations=len(terms),
        distance=0.0,
        problem=SimpleNamespace(
            model=MODEL,
            spread=np.ones(1),
            records=(
                SimpleNamespace(outputs=errors, phases=phases),
            ),  # of a model that stands still
        ),
    )
    return Judged(fit, *3 * [left_out * SEEN], words)


def found(*fits: Judged, noise: Array = WHITE) -> Found:
    return Found(SUBJECT, judged(1.0, 1.0, noise=noise), fits)


def test_friction_is_named_first_and_surely(monkeypatch: pytest.MonkeyPatch) -> None:
    conclusion = conclude(small_search(monkeypatch, dry))
    assert conclusion.verdict == "cause"
    first = conclusion.causes[0]
    assert first.name == "friction(v)"
    assert first.probability >= 0.9
    assert conclusion.nothing < 0.01


def test_a_record_of_the_model_is_consistent(monkeypatch: pytest.MonkeyPatch) -> None:
    conclusion = conclude(small_search(monkeypatch, nothing))
    assert conclusion.verdict == "consistent"
    assert conclusion.nothing > 0.5


@pytest.mark.slow
def test_a_law_outside_is_no_sure_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    assert conclude(small_search(monkeypatch, outside, 160)).verdict != "cause"


def test_nothing_found_is_consistent() -> None:
    conclusion = conclude(found())
    assert (conclusion.verdict, conclusion.causes, conclusion.nothing) == ("consistent", (), 1.0)


def test_a_model_that_fits_worse_than_one_that_does_not_hold_is_unexplained() -> None:
    """Something is missing in what was fitted, though nothing that was tried goes on."""
    conclusion = conclude(found(judged(0.5, 1.5, DRY)))
    assert (conclusion.verdict, conclusion.causes) == ("unexplained", ())
    conclusion = conclude(found(judged(0.5, 1.0, DRY)))
    assert conclusion.verdict == "unexplained"
    assert conclude(found(judged(0.99, 1.5, DRY))).verdict == "consistent", "no more than its cost"


@pytest.mark.parametrize(
    ("size", "verdict", "has_share"), [(0.1, "consistent", True), (0.3, "unexplained", False)]
)
def test_a_large_slow_error_is_no_consistent_model(
    size: float, verdict: str, has_share: bool
) -> None:
    """However little is gained by the best, which is a guess then, and nothing has no share."""
    wave = np.sqrt(2.0) * np.sin(np.linspace(0.0, 20.0, 200))[:, np.newaxis]
    slow = replace(judged(1.0, 1.0), measuring=size * wave)
    conclusion = conclude(Found(SUBJECT, slow, (judged(0.99, 0.99, DRY),)))
    assert conclusion.verdict == verdict
    assert [c.name for c in conclusion.causes] == ["friction(v)"]
    assert conclusion.nothing > 0.5 if has_share else conclusion.nothing == 0.0


@pytest.mark.parametrize("is_periodic", [False, True])
def test_a_small_slow_error_may_be_noise_unless_it_recurs(is_periodic: bool) -> None:
    """However little is gained, and though it is not large."""
    count = np.arange(600)
    wave = 0.1 * np.sqrt(2.0) * np.sin(2.0 * np.pi * count / 60.0)[:, np.newaxis]
    phases = count % 60 if is_periodic else None
    slow = replace(judged(1.0, 1.0, noise=wave, phases=phases), measuring=wave[:200])
    verdict = conclude(Found(SUBJECT, slow, ())).verdict
    assert verdict == ("unexplained" if is_periodic else "consistent")


@pytest.mark.parametrize(("left", "has_all"), [(0.1, True), (0.2, False)])
def test_where_the_best_leaves_a_large_slow_error_too_it_may_be_something_else(
    left: float, has_all: bool
) -> None:
    """Something is missing; what was not tried has the share of no term."""
    wave = np.sqrt(2.0) * np.sin(np.linspace(0.0, 20.0, 200))[:, np.newaxis]
    base = replace(judged(1.0, 1.0), measuring=0.6 * wave)
    best = replace(judged(0.95, 0.97, DRY), measuring=left * wave)
    (first,) = conclude(Found(SUBJECT, base, (best,))).leading
    assert (first.probability == 1.0) == has_all


def test_beside_white_noise_what_is_plainer_may_be_behind_by_its_words() -> None:
    """By six nats, of which five are its words, and the rest no matter of causes."""
    plain, other = judged(0.5, 0.515, DRY), judged(0.5, 0.5, SPRING, words=5.0)
    shares = {c.name: c.probability for c in conclude(found(plain, other)).leading}
    assert shares["friction(v)"] > 0.0


def test_the_best_of_many_fits_gains_on_what_is_fitted_by_chance() -> None:
    """Some 5 nats beyond its cost are evidence of one fit, and none of the best of 200."""
    one = judged(0.955, 1.5, DRY)
    assert conclude(found(one)).verdict == "unexplained"
    assert conclude(found(*[one] * 200)).verdict == "consistent"


def test_of_fits_of_a_cause_that_are_as_likely_the_plainer_is_told() -> None:
    """A further term that gains less than scores of true causes may differ by is not told."""
    conclusion = conclude(found(judged(0.475, 0.5, DRY, SPRING), judged(0.5, 0.5, DRY)))
    assert [c.name for c in conclusion.causes] == ["friction(v)"]
    assert conclusion.causes[0].parts == (DRY,)
    conclusion = conclude(found(judged(0.4, 0.5, DRY, SPRING), judged(0.5, 0.5, DRY)))
    assert conclusion.causes[0].parts == (DRY, SPRING)


def test_the_probability_is_of_the_cause_with_all_its_shapes() -> None:
    conclusion = conclude(found(judged(0.5, 0.5, DRY), judged(0.5, 0.5, CURVE)))
    assert conclusion.verdict == "cause"
    assert [c.name for c in conclusion.causes] == ["friction(v)"]
    assert conclusion.causes[0].terms == (DRY,), "the plain shape shows it"


def test_causes_that_explain_alike_are_ambiguous() -> None:
    conclusion = conclude(found(judged(0.5, 0.5, DRY), judged(0.5, 0.501, SPRING)))
    assert conclusion.verdict == "ambiguous"
    assert {c.name for c in conclusion.causes} == {"friction(v)", "spring(x)"}
    assert sum(c.probability for c in conclusion.causes) >= 0.9


def test_a_set_that_contains_a_better_one_shares_no_probability() -> None:
    """The rest of it would have a part of the share of the better one."""
    one, other, third = (frozenset(names) for names in ("a", "ab", "bc"))
    kept = _minimal([(one, "first"), (other, "second"), (third, "third")])
    assert kept == ["first", "third"]
    assert _minimal([(other, "first"), (one, "second")]) == ["first", "second"]


def test_more_than_three_that_explain_alike_are_no_explanation() -> None:
    names = ["x", "v", "force", "time", "friction"]
    fits = [judged(0.5, 0.5, Term("spring", name, Shape.CUBE)) for name in names]
    conclusion = conclude(found(*fits))
    assert conclusion.verdict == "unexplained"
    assert len(conclusion.causes) == 3
    assert sum(c.probability for c in conclusion.causes) < 0.9


def test_a_fit_that_is_worse_on_what_is_left_out_is_no_cause() -> None:
    """However well it fits."""
    rising = 1.0 + 0.2 * np.ones((200, 1))
    conclusion = conclude(found(judged(0.1, rising, DRY)))
    assert conclusion.verdict == "unexplained"
    assert conclusion.causes == ()


def test_a_gain_in_what_is_fitted_alone_is_no_cause() -> None:
    conclusion = conclude(found(judged(0.5, 1.0, DRY)))
    assert conclusion.verdict == "unexplained"


def test_a_fit_behind_the_lowest_is_second_even_if_its_score_is_higher() -> None:
    """It is what the cause may be else, by which the two are more probable than the first."""
    rival = judged(0.3, 0.6, SPRING)
    both = found(judged(0.5, 0.5, DRY), rival)
    assert both.compared()[0].judged is rival
    first, second = conclude(both).causes
    assert (first.name, second.name) == ("friction(v)", "spring(x)")
    assert 0.0 < second.probability < first.probability < 0.9
    far = found(judged(0.1, 0.1, DRY), judged(0.5, 0.5, SPRING))
    assert [c.name for c in conclude(far).causes] == ["friction(v)"], "one that is sure is alone"


def test_what_gains_less_than_half_is_not_as_likely_however_uncertain_its_error() -> None:
    """An error in a short burst has an uncertain mean square, by which it is behind no other."""
    burst = SEEN * np.where(np.arange(len(SEEN)) < 8, 30.0, 0.5)[:, np.newaxis]
    ahead, rival = judged(0.5, 0.5, DRY), judged(0.9, burst, SPRING)
    behind, error = shortfall(rival, ahead, 0.5 * np.ones(1))
    assert 0.0 < behind < 2.0 * error
    entries = found(ahead, rival, judged(1.0, 3.0, CURVE))
    near = _near_the_likeliest(entries.compared(), entries)
    assert [entry.judged for entry in near] == [ahead]


@pytest.mark.parametrize(("noise", "near"), [(WHITE, True), (SLOW, False)])
def test_chance_may_put_a_fit_behind_by_more_where_white_noise_is_left(noise, near) -> None:
    """By one and a half errors of the difference: two are allowed there, else hardly one."""
    ahead = judged(0.5, 0.5, DRY, noise=noise)
    for size in np.linspace(0.5, 0.7, 100):
        rival = judged(0.45, size * RNG.permutation(SEEN) / SEEN, SPRING, noise=noise)
        behind, error = shortfall(rival, ahead, 0.5 * np.ones(1))
        if 1.4 < behind / error < 1.8:
            break
    names = {c.name for c in conclude(found(ahead, rival, noise=noise)).causes}
    assert ("spring(x)" in names) == near


def test_a_curve_has_to_pay_for_its_columns_before_it_leads() -> None:
    """Alone it gains more than the spring, by less than what its columns cost."""
    fits = judged(0.5, 0.5, SPRING, DRY), judged(0.6, 0.6, SPRING), judged(0.597, 0.597, CURVE)
    assert conclude(found(*fits)).causes[0].terms == (SPRING, DRY)


def test_scores_are_worth_less_where_more_than_white_noise_is_left() -> None:
    """By a twentieth of the gain, of the share of samples that are not independent."""
    white, slow = (
        found(judged(0.5, 0.5, DRY, noise=noise), noise=noise) for noise in (WHITE, SLOW)
    )
    assert white.structure == 0.0
    assert white.temper == 3.0
    share = 1.0 - effective_samples(SLOW[:, 0]) / len(SLOW)
    assert slow.structure == pytest.approx(share)
    assert slow.temper == pytest.approx(3.0 + 0.05 * share * slow.compared()[0].comparison.gain)


def test_a_fit_that_gains_little_in_all_is_no_measure_of_the_lowest() -> None:
    """Its terms cost more than they explain."""
    dear = judged(0.9, 0.45, SPRING, words=500.0)
    conclusion = conclude(found(judged(0.5, 0.5, DRY), dear))
    assert conclusion.verdict == "cause"
    assert conclusion.causes[0].name == "friction(v)"


def test_a_third_of_the_best_score_is_no_measure_of_the_lowest() -> None:
    """Less than half of it, whatever it leaves of what no fit saw."""
    friction, dear = judged(0.5, 0.5, DRY), judged(0.9, 0.3, SPRING)
    dear.fit.distance = 180.0  # as far are its parameters from nominal
    both = found(friction, dear)
    scores = {ranked.judged.terms: ranked.score for ranked in both.compared()}
    assert 0.2 < scores[dear.terms] / scores[friction.terms] < 0.45
    assert conclude(both).causes[0].name == "friction(v)"


def test_the_term_whose_loss_costs_most_leads() -> None:
    for both in ((DRY, SPRING), (SPRING, DRY)):
        one = conclude(
            found(judged(0.1, 0.1, *both), judged(0.9, 0.9, DRY), judged(0.3, 0.3, SPRING))
        ).causes[0]
        assert one.terms == (SPRING, DRY)
        assert one.name == "spring(x)"


PUSH = Term("acceleration", "force", Shape.CUBE)


@pytest.mark.parametrize(
    ("alone", "lost", "first"),
    [
        # the spring alone has more than half, though the others together have nearly all
        ((0.6, 0.1, 0.1), (0.9, 0.65, 0.7), SPRING),
        # none has half alone, and without friction least is left
        ((0.3, 0.1, 0.1), (0.9, 0.4, 0.7), DRY),
    ],
)
def test_the_first_of_three_has_half_alone_or_is_missed_most(
    alone: tuple[float, ...], lost: tuple[float, ...], first: Term
) -> None:
    three = (SPRING, DRY, PUSH)

    def gaining(share: float, *terms: Term) -> Judged:
        ratio = float(np.exp(-2.0 * share))
        return judged(ratio, ratio, *terms)

    fits = [gaining(1.0, *three)]
    for i, term in enumerate(three):
        fits.append(gaining(alone[i], term))
        fits.append(gaining(lost[i], *(t for t in three if t is not term)))
    assert conclude(found(*fits)).causes[0].terms[0] == first


def test_a_cause_whose_error_rises_where_nothing_is_chosen_by_it_is_not_named() -> None:
    good = judged(0.5, 0.5, DRY)
    assert conclude(found(good)).verdict == "cause"
    assert conclude(found(replace(good, measuring=1.5 * SEEN))).verdict == "unexplained"


def test_what_is_plainer_may_be_behind_by_what_its_words_are_worth() -> None:
    """Only if more than white noise is left: else nats of a likelihood decide."""
    ahead = judged(0.5, 0.5, SPRING, words=3.0, noise=SLOW)
    behind = judged(0.5, 0.52, DRY, noise=SLOW)
    causes = conclude(found(behind, ahead, noise=SLOW)).causes
    assert [c.name for c in causes][:1] == ["friction(v)"]
    wordy = judged(0.5, 0.52, DRY, words=3.0, noise=SLOW)
    assert conclude(found(wordy, ahead, noise=SLOW)).causes[0].name == "spring(x)"
    white = judged(0.5, 0.52, DRY), judged(0.5, 0.5, SPRING, words=3.0)
    assert conclude(found(*white)).causes[0].name == "spring(x)"


def test_an_output_of_large_errors_does_not_decide_alone() -> None:
    """Friction takes the error of the second to a tenth, the spring a little of the first."""

    def of_two(first: float, second: float, *terms: Term) -> Judged:
        one = judged(1.0, 1.0, *terms)
        both = np.array([first, 0.1 * second])
        white, seen = np.hstack([WHITE, WHITE[::-1]]), np.hstack([SEEN, SEEN[::-1]])
        errors = (white * both,)
        return replace(
            one,
            fit=SimpleNamespace(**vars(one.fit) | {"errors": errors}),
            choosing=seen * both,
            beyond=seen * both,
            measuring=seen * both,
        )

    fits = (of_two(0.95, 0.1, DRY), of_two(0.85, 1.0, SPRING))
    conclusion = conclude(Found(SUBJECT, of_two(1.0, 1.0), fits))
    assert conclusion.causes[0].name == "friction(v)"


def test_the_plainer_of_two_that_explain_alike_leads() -> None:
    slow = replace(SPRING, memory=Memory.LAG, constants=(3.0,))
    sizes = ((0.5, slow, DRY), (0.6, DRY), (0.595, slow))
    fits = [judged(size, size, *terms, noise=SLOW) for size, *terms in sizes]
    assert conclude(found(*fits, noise=SLOW)).causes[0].terms == (DRY, slow)


def test_what_is_not_strong_on_what_is_left_out_is_no_cause() -> None:
    """Two nats in two hundred samples: seven to one."""
    weak, strong = (found(judged(0.5, size, DRY)) for size in (0.99, 0.6))
    assert conclude(weak).verdict == "unexplained"
    assert conclude(weak).causes[0].comparison.evidence < 3.0
    assert conclude(strong).verdict == "cause"


def test_where_a_model_leaves_a_large_slow_error_weak_evidence_is_enough() -> None:
    """That something is missing is seen there; it is asked only which of the causes it is."""
    weak, wave = judged(0.5, 0.988, DRY), np.sin(np.linspace(0.0, 20.0, 200))[:, np.newaxis]
    slow = replace(judged(1.0, 1.0), measuring=wave)
    weak = replace(weak, measuring=0.3 * wave)
    conclusion = conclude(Found(SUBJECT, slow, (weak,)))
    assert 0.0 < conclusion.causes[0].comparison.evidence < 3.0
    assert conclusion.verdict == "cause"


def test_causes_that_no_experiment_tells_apart_are_one_with_aliases() -> None:
    fits = found(judged(0.5, 0.5, DRY), judged(0.5, 0.501, SPRING))
    apart = conclude(fits)
    assert [cause.aliases for cause in apart.causes] == [(), ()]
    pair = frozenset(cause.key for cause in apart.causes)
    (one,) = conclude(fits, {pair}).causes
    assert {one.name, *one.aliases} == {cause.name for cause in apart.causes}
    assert one.probability > max(cause.probability for cause in apart.causes)


def test_a_gain_and_a_lag_of_one_sensor_are_two_causes() -> None:
    gain = SensorTerm("place", "place", Shape.LINEAR)
    lag = replace(gain, memory=Memory.FADING, constants=(2.0,))
    conclusion = conclude(found(judged(0.5, 0.5, gain), judged(0.5, 0.501, lag)))
    assert {c.name for c in conclusion.causes} == {"sensor_gain(place)", "sensor_lag(place)"}


@pytest.mark.parametrize(("constant", "is_one"), [(2.0, True), (0.5, False)])
def test_a_signal_that_a_memory_of_another_keeps_is_one_with_it(
    constant: float, is_one: bool
) -> None:
    """The velocity of a mass with drag alone is what a lag of m / d keeps of its force."""
    time = np.linspace(0.0, 40.0, 801)
    force = np.sign(np.sin(time**1.3))
    _, velocity, _ = lsim(([1.0], [2.0, 1.0]), force, time)
    along = SimpleNamespace(values={"force": force, "v": velocity}, times=[time])
    lagging = replace(DRY, signal="force", memory=Memory.LAG, constants=(1.0,))
    fitted = SimpleNamespace(values_of=lambda term: np.array([1.0, np.log(constant)]))
    causes = [
        SimpleNamespace(
            parts=(term,), members=frozenset({term.cause}), judged=SimpleNamespace(fit=fitted)
        )
        for term in (lagging, DRY)
    ]
    assert _is_one_with(*causes, SimpleNamespace(along=along)) == is_one


def judged_by(fitted: Array, measuring: float | Array) -> Judged:
    """Return what is judged of errors where it was fitted, and where nothing was."""
    problem = SimpleNamespace(model=MODEL, spread=np.ones(1), records=(REST,))
    errors = np.broadcast_to(measuring, fitted.shape)
    fit = SimpleNamespace(problem=problem, errors=(fitted,))
    return Judged(fit, errors, errors, errors, 0.0)


def verdict_of(one: Judged, base: Judged, moves: float) -> str:
    """Return the verdict of a sure cause that leaves errors, of an output that moves by so much."""
    comparison = SimpleNamespace(evidence=50.0)
    cause = SimpleNamespace(score=50.0, comparison=comparison, probability=0.95, judged=one)
    subject = SimpleNamespace(sizes=np.array([moves]))
    found = SimpleNamespace(base=base, subject_of=lambda reading: subject)
    return _verdict([cause], found)


@pytest.mark.parametrize(
    ("error", "moves", "before", "verdict"),
    [
        (0.6 * np.ones((40, 1)), 1.0, 3.0, "cause"),
        (0.8 * np.ones((40, 1)), 1.0, 3.0, "unexplained"),
        (0.6 * np.ones((40, 1)), 0.8, 3.0, "unexplained"),
        (0.8 * RNG.standard_normal((40, 1)), 0.8, 3.0, "cause"),
        (0.6 * np.ones((40, 1)), 1.0, 1.0, "unexplained"),
        (0.6 * RNG.standard_normal((40, 1)), 1.0, 1.0, "cause"),
        (0.05 * np.ones((40, 1)), 1.0, 0.06, "unexplained"),
    ],
    ids=(
        *("nearer", "no nearer", "of little that moves", "of noise alone"),
        *("a large part is left", "a large part is noise", "little, but a large part"),
    ),
)
def test_a_cause_is_none_that_predicts_no_better_than_a_mean_or_leaves_much_of_what_is_missing(
    error: Array, moves: float, before: float, verdict: str
) -> None:
    """A mean leaves by how much an output moves there."""
    one, base = (judged_by(e, e) for e in (error, np.full((40, 1), before)))
    assert verdict_of(one, base, moves) == verdict


@pytest.mark.parametrize(
    ("fitted", "verdict"),
    [(0.1, "cause"), (0.9, "unexplained")],
    ids=("explained", "not explained"),
)
def test_a_cause_that_explains_what_was_fitted_may_leave_much_of_another_record(
    fitted: float, verdict: str
) -> None:
    """Friction of a motor that turned both ways, and a record of another day."""
    one, base = judged_by(np.full((40, 1), fitted), 0.7), judged_by(np.ones((40, 1)), 0.9)
    assert verdict_of(one, base, 1.0) == verdict


@pytest.mark.parametrize(("second", "lost"), [(0.1, False), (0.9, True)])
def test_a_model_that_predicts_one_of_its_outputs_is_not_lost(second: float, lost: bool) -> None:
    """In shares of how much each moves; errors are slow."""
    outputs = [SimpleNamespace(name=name) for name in ("place", "heat")]
    model = SimpleNamespace(outputs=outputs)
    problem = SimpleNamespace(model=model, spread=np.ones(2), records=(REST,))
    fitted = SimpleNamespace(problem=problem, errors=())
    one = SimpleNamespace(measuring=np.ones((40, 2)) * [0.9, second], fit=fitted)
    assert is_lost(one, SimpleNamespace(sizes=np.ones(2))) == lost


def test_the_reading_comes_before_terms_in_it_where_no_part_explains_half_alone() -> None:
    reading = Reading(ReadingKind.RATE, ("position",), levels=(0.0,))
    term = Term("friction", "velocity", Shape.DRY)
    fitted = SimpleNamespace(problem=SimpleNamespace(model=LawModel(Oscillator)))
    both = SimpleNamespace(parts=(term, reading), fit=fitted)
    ranked = [
        SimpleNamespace(
            judged=SimpleNamespace(parts=parts), comparison=SimpleNamespace(gain=gain, columns=0.0)
        )
        for parts, gain in (((term,), 20.0), ((reading,), 10.0), ((term, reading), 100.0))
    ]
    found = SimpleNamespace(compared=lambda: ranked, structure=0.0)
    assert _in_order(both, found) == (reading, term)


def test_of_parts_none_of_which_explains_half_alone_the_first_adds_most_over_all_orders() -> None:
    """A pump is late by a sample and slower when it is off: the delay helps only beside the latter,
    and then its loss costs more.
    """
    slower, late, curved = (
        Term("friction", signal, Shape.LINEAR) for signal in ("velocity", "force", "position")
    )
    fitted = SimpleNamespace(problem=SimpleNamespace(model=LawModel(Oscillator)))
    gains = {
        (slower,): 0.7,
        (curved,): 0.5,
        (slower, late): 1.3,
        (slower, curved): 0.75,
        (late, curved): 1.0,
        (slower, late, curved): 2.1,
    }
    ranked = [
        SimpleNamespace(
            judged=SimpleNamespace(parts=parts), comparison=SimpleNamespace(gain=gain, columns=0.0)
        )
        for parts, gain in gains.items()
    ]
    found = SimpleNamespace(compared=lambda: ranked, structure=0.0)
    whole = SimpleNamespace(parts=(late, curved, slower), fit=fitted)
    assert _in_order(whole, found) == (slower, late, curved)
