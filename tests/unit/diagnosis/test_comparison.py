"""Claims: gains are log likelihoods, errors those of block means, and plain terms come first."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm

from fmus.kit.arrays import Array, Indices
from orchestration.diagnosis import Shape, Term
from orchestration.diagnosis.comparison import (
    WEIGHTS,
    Common,
    Comparison,
    Judged,
    are_same,
    common_of,
    compare,
    difference,
    inexact,
    shortfall,
    words,
)
from orchestration.diagnosis.readings import Reading, ReadingKind
from orchestration.diagnosis.subject import words_of
from orchestration.diagnosis.terms import Memory, SensorTerm
from tests.support.diagnosed_mass import mass

RNG = np.random.default_rng(5)
NONE = Comparison(0.0, 0.0, 0.0, 1.0, 0.0, 0, 0.0, 0.0)


def judged(
    fitted: Array,
    left_out: Array,
    prior: float = 0.0,
    phases: Indices | None = None,
    **fit: Any,
) -> Judged:
    """Return errors as those of a fit with so much freedom."""
    given = {"freedom": 0, "distance": 0.0, "terms": (), "misfit": fitted.std()} | fit
    given = {"explanations": len(given["terms"])} | given
    problem = SimpleNamespace(records=(SimpleNamespace(phases=phases),))
    of_errors = SimpleNamespace(errors=(fitted,), problem=problem, **given)
    return Judged(of_errors, *3 * [left_out], prior)


def shared(fitted: list[float], left_out: list[float]) -> Common:
    """Return so many effective samples of each output."""
    return Common([np.array(fitted)], np.array(left_out), 0.0)


def likelihood(errors: Array) -> float:
    """Return the log likelihood of white noise with its own deviation."""
    return float(sum(norm.logpdf(e, scale=np.sqrt(np.mean(e**2))).sum() for e in errors.T))


def test_gains_are_differences_of_log_likelihoods() -> None:
    """Of two outputs, all samples of which are independent."""
    errors = [RNG.standard_normal((n, 2)) * [1.0, 0.3] for n in (400, 300)]
    better = [0.8 * errors[0] + 0.1, 0.9 * errors[1]]
    counts = shared([400.0, 400.0], [300.0, 300.0])
    found = compare(judged(*better), judged(*errors), counts)
    assert found.fitted == pytest.approx(likelihood(better[0]) - likelihood(errors[0]))
    assert found.left_out == pytest.approx(likelihood(better[1]) - likelihood(errors[1]))
    half = shared([200.0, 200.0], [150.0, 150.0])
    assert compare(judged(*better), judged(*errors), half).fitted == pytest.approx(found.fitted / 2)


def test_gaps_count_for_nothing() -> None:
    errors, better = RNG.standard_normal((400, 1)), RNG.standard_normal((400, 1)) * 0.7
    gaps = np.arange(0, 400, 4)
    counts = shared([300.0], [300.0])
    whole = compare(
        *(judged(np.delete(e, gaps, 0), np.delete(e, gaps, 0)) for e in (better, errors)), counts
    )
    for e in (errors, better):
        e[gaps] = np.nan
    found = compare(judged(better, better), judged(errors, errors), counts)
    assert found.fitted == pytest.approx(whole.fitted)
    assert found.rise == pytest.approx(whole.rise)


def test_columns_distance_and_words_are_those_beyond_the_other() -> None:
    errors = RNG.standard_normal((200, 1))
    term = Term("spring", "x", Shape.CUBE)
    one = judged(errors, errors, 3.0, freedom=5, distance=2.0, terms=(term, term))
    other = judged(errors, errors, 1.0, freedom=2, distance=0.5, terms=(term,))
    found = compare(one, other, shared([150.0], [50.0]))
    assert found.columns == pytest.approx(0.5 * 3 * np.log(150.0))
    assert (found.terms, found.distance, found.words) == (1, 1.5, 2.0)
    assert found.fitted == 0.0


def test_a_change_in_a_later_record_counts_as_a_term() -> None:
    errors = RNG.standard_normal((200, 1))
    one = judged(errors, errors, explanations=2)
    assert compare(one, judged(errors, errors), shared([150.0], [50.0])).terms == 2


def test_evidence_is_what_both_parts_agree_on() -> None:
    """Columns cost of what is fitted, which gains by any of them."""
    one = replace(NONE, fitted=30.0, left_out=20.0, columns=4.0)
    assert one.evidence == 20.0
    assert replace(one, fitted=10.0).evidence == 6.0
    assert replace(one, distance=3.0).evidence == 20.0
    assert replace(one, distance=3.0, rereads=True).evidence == 17.0


def test_between_readings_parameters_are_worth_a_diagnosis_within_a_factor_of_three() -> None:
    """A prior of a factor of ten lets a fit of one reading go on."""
    errors = RNG.standard_normal((200, 1))
    half = 0.5 * (np.log(2.0) / np.log(10.0)) ** 2
    one, other = judged(errors, errors, distance=half), judged(errors, errors)
    counts = shared([150.0], [50.0])
    assert compare(one, other, counts).distance == pytest.approx(half)
    turned = replace(one, reading=Reading(ReadingKind.SIGN, ("force",), factor=-1.0))
    within = 0.5 * (np.log(2.0) / np.log(3.0)) ** 2
    found = compare(turned, other, counts)
    assert found.rereads
    assert found.distance == pytest.approx(within, rel=0.1)


def test_the_error_of_a_rise_is_that_of_a_mean() -> None:
    """Of white errors: the deviation of the squares over the root of their number."""
    base = np.zeros((6000, 1))
    errors = []
    for seed in range(20):
        one = np.random.default_rng(seed).standard_normal((6000, 1))
        rise, error = difference(judged(one, one), judged(base, base))
        assert rise == pytest.approx(np.mean(one**2))
        errors.append(error)
    assert np.mean(errors) == pytest.approx(np.sqrt(2.0 / 6000.0), rel=0.1)


def test_the_error_of_a_rise_allows_for_correlation() -> None:
    """The squares of AR(1) with rho have the autocorrelation rho^2."""
    rho, errors = 0.9, []
    for seed in range(20):
        white = np.random.default_rng(seed).standard_normal((6000, 1))
        one = lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], white, axis=0)
        errors.append(difference(judged(one, one), judged(0.0 * one, 0.0 * one))[1])
    expected = np.sqrt(2.0 / 6000.0 * (1.0 + rho**2) / (1.0 - rho**2))
    assert np.mean(errors) == pytest.approx(expected, rel=0.15)


def test_a_rise_beyond_its_error_is_worse() -> None:
    assert not replace(NONE, rise=0.9).is_worse
    assert replace(NONE, rise=1.1).is_worse
    assert not replace(NONE, rise=-1.1).is_worse
    short = judged(np.ones((3, 1)), np.ones((3, 1)))
    assert difference(short, judged(np.zeros((3, 1)), np.zeros((3, 1)))) == (0.0, np.inf)


@pytest.mark.parametrize("part", [0.0, 500.0])
@pytest.mark.parametrize(
    ("feature", "sign"),
    [
        ("fitted", 1),
        ("left_out", 1),
        ("columns", -1),
        ("terms", -1),
        ("distance", -1),
        ("words", -1),
    ],
)
def test_the_score_rises_with_gains_and_falls_with_costs(
    feature: str, sign: int, part: float
) -> None:
    scores = [replace(NONE, **{feature: value}).score(part) for value in (1, 2, 3)]
    assert np.all(sign * np.diff(scores) > 0.0)


def test_what_is_fitted_counts_half() -> None:
    assert replace(NONE, left_out=10.0).gain == pytest.approx(10.0)
    assert replace(NONE, fitted=10.0).gain == pytest.approx(5.0)


def test_strong_evidence_is_twenty_to_one() -> None:
    """After Kass and Raftery."""
    assert np.exp(WEIGHTS.least) == pytest.approx(20.0, rel=0.01)


def test_a_term_costs_less_than_its_column_in_a_long_record() -> None:
    """Two thirds of what a column costs by Schwarz in 10,000 independent samples."""
    assert replace(NONE, terms=1).cost == pytest.approx(0.5 * np.log(10_000.0) * 2.0 / 3.0, rel=0.1)


def test_words_and_further_terms_cost_a_share_of_what_is_inexact() -> None:
    plain, wordy = replace(NONE, terms=1), replace(NONE, terms=1, words=1.0)
    assert plain.score(0.0) - wordy.score(0.0) < plain.score(900.0) - wordy.score(900.0)
    two = replace(NONE, terms=2)
    assert plain.score(0.0) - two.score(0.0) < plain.score(900.0) - two.score(900.0)
    assert plain.score(0.0) == plain.score(900.0), "a first plain term has no share"


def test_plain_terms_come_first() -> None:
    model = mass()
    plain = words(model, Term("spring", "x", Shape.SQUARE), True)
    assert plain == 0.0
    for odd, depends in (
        (Term("spring", "x", Shape.CURVE), True),
        (Term("spring", "x", Shape.SQUARE, Memory.LAG, (1.0,)), True),
        (Term("spring", "v", Shape.SQUARE), False),
        (Term("spring", "friction", Shape.SQUARE), True),
        (Term("spring", "time", Shape.SQUARE), True),
        (Term("spring", "x", Shape.SQUARE, factor="spring"), True),
    ):
        assert words(model, odd, depends) > plain, odd
    assert words(model, Term("spring", "", Shape.CONSTANT), False) == 0.0
    called = Term("acceleration", "friction", Shape.SQUARE)
    assert words_of(model, called) == 0.0
    late = words(model, Term("spring", "time", Shape.SQUARE), True)
    assert late > words(model, Term("spring", "friction", Shape.CURVE), False)


LAW = Term("spring", "x", Shape.SQUARE)
PLAINER = {
    "of a signal than of its past": (LAW, replace(LAW, memory=Memory.LAG, constants=(1.0,))),
    "of one constant than of two": (
        replace(LAW, memory=Memory.LAG, constants=(1.0,)),
        replace(LAW, memory=Memory.TWO_LAGS, constants=(1.0, 2.0)),
    ),
    "of what stays than of what fades": (
        replace(LAW, memory=Memory.LAG, constants=(1.0,)),
        replace(LAW, memory=Memory.FADING, constants=(1.0,)),
    ),
    "of a signal than of all its past": (LAW, replace(LAW, memory=Memory.THROUGHPUT)),
    "of a power than of a corner": (LAW, replace(LAW, shape=Shape.MODULUS)),
    "of a corner than of a curve": (
        replace(LAW, shape=Shape.MODULUS),
        replace(LAW, shape=Shape.CURVE),
    ),
    "of what a law reads than of another": (LAW, replace(LAW, signal="v")),
    "of a state than of a law": (replace(LAW, signal="v"), replace(LAW, signal="friction")),
    "of a law than of a share of it": (LAW, replace(LAW, factor="spring")),
    "of what an output is than of its sensor": (
        SensorTerm("spring", "spring", Shape.LINEAR),
        SensorTerm("position", "position", Shape.LINEAR),
    ),
    "of a sign than of a size": (
        Reading(ReadingKind.SIGN, ("force",), factor=-1.0),
        Reading(ReadingKind.OFFSET, ("force",), levels=(1.0,)),
    ),
}


@pytest.mark.parametrize(("plain", "other"), PLAINER.values(), ids=PLAINER)
def test_a_part_is_plainer(plain: Reading | Term, other: Reading | Term) -> None:
    """By at least half a nat, and by no more than strong evidence twice."""
    more = words_of(mass(), other) - words_of(mass(), plain)
    assert 0.5 <= more <= 2.0 * np.log(20.0)


def test_the_time_needs_strong_evidence_twice_over() -> None:
    """It is no cause, but may stand for one that nobody recorded."""
    foreign, timed = (words_of(mass(), replace(LAW, signal=name)) for name in ("v", "time"))
    assert 2.0 < (timed - foreign) / np.log(20.0) < 3.0


@pytest.mark.parametrize("more", [{"words": 8.0}, {"terms": 3}])
def test_shares_of_what_is_inexact_are_felt_and_outweigh_no_half_of_a_gain(
    more: dict[str, float],
) -> None:
    """Of the wordiest term, and of three terms."""
    one = replace(NONE, **more)
    assert 0.02 < (one.score(0.0) - one.score(1000.0)) / 1000.0 < 0.5


def test_what_a_model_receives_is_plainly_a_law_of_anything_but_its_input() -> None:
    """Over that input it is a column that was misread."""
    received = SimpleNamespace(
        received=frozenset({"force_in_fmu"}),
        laws=["force_in_fmu"],
        plain_laws=frozenset({"force_in_fmu"}),
        reads=lambda law: {"force"},
    )
    over_input, over_other = (Term("force_in_fmu", s, Shape.LINEAR) for s in ("force", "speed"))
    sign = words_of(mass(), Reading(ReadingKind.SIGN, ("force",), factor=-1.0))
    assert words_of(received, over_input) == pytest.approx(sign)
    assert words_of(received, over_other) < sign


@pytest.mark.parametrize(("factor", "same"), [(1.04, True), (-1.04, True), (1.06, False)])
def test_two_models_say_the_same_whose_errors_differ_by_a_twentieth_at_most(
    factor: float, same: bool
) -> None:
    """But for their sign, and where both are known."""
    errors = RNG.standard_normal((400, 2))
    other = factor * errors
    other[::7] = np.nan
    assert are_same(judged(other, other), judged(errors, errors)) == same


def test_two_models_say_the_same_that_leave_the_same_in_each_row_of_the_file() -> None:
    """One reads a column as late, so that its errors are of other instants."""
    errors = RNG.standard_normal((400, 1))
    late = Reading(ReadingKind.LATE, ("y",), shift=3.0)
    model = SimpleNamespace(outputs=[SimpleNamespace(name="y")])
    problem = SimpleNamespace(model=model, records=[SimpleNamespace(time=np.arange(400.0))])
    moved = np.concatenate([errors[3:], np.full((3, 1), np.nan)])
    fit = SimpleNamespace(errors=(moved,), problem=problem)
    one = Judged(fit, moved, moved, moved, 0.0, late)
    other = replace(one, fit=SimpleNamespace(errors=(errors,), problem=problem), reading=None)
    assert are_same(one, other)
    assert not are_same(replace(one, reading=None), other)


def test_the_figure_is_of_samples_by_which_nothing_is_chosen() -> None:
    one = judged(np.ones((9, 1)), np.ones((9, 1)))
    assert replace(one, measuring=2.0 * np.ones((9, 1))).left_out == 2.0
    assert replace(one, measuring=np.full((9, 1), np.nan)).left_out == 1.0


def test_common_samples_are_medians_of_the_nearest_fits() -> None:
    """Samples that are left out have as large a share of them, however slow their errors are."""
    many = []
    for k, rho in enumerate([0.0, 0.5, 0.9, 0.99]):
        error = lfilter([1.0], [1.0, -rho], RNG.standard_normal((2000, 1)), axis=0)
        many.append(judged(error, np.full((1000, 1), 3.0), misfit=float(k)))
    common = common_of(many[::-1])
    assert common.fitted[0] == many[1].effective[0]
    assert common.left_out == pytest.approx(common.fitted[0] / 2.0)
    assert common.structure == pytest.approx(1.0 - common.fitted[0][0] / 2000.0)


def test_an_error_of_a_periodic_input_counts_once_for_all_periods() -> None:
    error = np.tile(np.random.default_rng(4).standard_normal((100, 1)), (20, 1))
    phases = np.tile(np.arange(100), 20)
    assert judged(error, error, phases=phases).effective[0] == pytest.approx([100.0], rel=0.2)


def test_a_gain_is_inexact_as_far_as_what_is_left_has_structure() -> None:
    comparisons = [replace(NONE, left_out=gain) for gain in (-5.0, 40.0, np.nan)]
    assert inexact(comparisons, 0.25) == pytest.approx(10.0)
    assert inexact(comparisons, 0.0) == 0.0
    assert inexact(comparisons[:1], 0.9) == 0.0


def test_a_shortfall_is_of_predictions_in_widths_of_the_noise() -> None:
    """Plain errors say nothing of it; the second output is ten times as noisy as the first."""
    noise = np.array([1.0, 10.0])
    likely = judged(np.ones((400, 2)), RNG.standard_normal((400, 2)) * noise)
    one = replace(likely, beyond=likely.beyond * np.array([1.0, 1.1]), choosing=0.0 * likely.beyond)
    behind, _ = shortfall(one, likely, noise)
    assert behind == pytest.approx(0.5 * 0.21 * np.mean((likely.beyond[:, 1] / 10.0) ** 2))
    rise, _ = difference(one, likely)
    assert rise == pytest.approx(0.105 * np.mean(likely.beyond[:, 1] ** 2))
