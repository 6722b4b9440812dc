"""Where no model is right, the best is the one that predicts blocks that it was not fitted to;
oracle: regression.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit.inputs import dead_zone
from fmus.kit.sensors import measurement_effects
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection import ranking, stepwise
from orchestration.discrepancy.selection.block_cross_validation import (
    Blocks,
    cv_errors,
    movement,
    predicts_better,
)
from orchestration.discrepancy.selection.ranking import Ranking, ranked
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import select
from tests.support.regression_model import GAIN, OTHERS, SPREAD, STEP, Amplifier, shaped

COUNT = 1600  # 16 blocks of 100
TIMES = 4


def even(s):
    return s * s - 1.0


def odd(s):
    return s * s * s - 3.0 * s


def quartic(s):
    return s * s * s * s - 6.0 * s * s + 3.0


EVEN, ODD, QUARTIC = shaped("even", even), shaped("odd", odd), shaped("quartic", quartic)
SHAPES = {EVEN: even, ODD: odd, QUARTIC: quartic}
OF_OUTPUT = {effect.id: effect for effect in measurement_effects(Amplifier)}


def record(hidden, seed=1):
    random = np.random.default_rng(seed)
    signal, block = random.standard_normal(COUNT), np.arange(COUNT) // 100
    shown = GAIN * signal + hidden(signal, block) + SPREAD * random.standard_normal(COUNT)
    return Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": shown})


def searched(data, effects):
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    return search, base, score(search, base, effects)


def by_regression(data, shapes):
    """Logarithm of the mean squared error of every block, fitted without every fourth one."""
    signal, shown, block = data.inputs["signal"], data.measured["shown"], np.arange(COUNT) // 100
    table = np.column_stack([signal, *(shape(signal) for shape in shapes)])
    errors = np.empty(16)
    for time in range(TIMES):
        out = block % TIMES == time
        residual = shown - table @ np.linalg.lstsq(table[~out], shown[~out])[0]
        for k in range(time, 16, TIMES):
            errors[k] = np.log(np.mean(residual[block == k] ** 2))
    return errors


@pytest.mark.parametrize("named", [None, EVEN, ODD])
def test_errors_of_blocks_left_out_are_those_of_regression(named):
    data = record(lambda s, k: 0.5 * even(s) + 0.1 * odd(s) * (k % 3))
    search = Search(data, Amplifier, ["gain"])
    base, plain = search.nominal(), replace(search.in_white_noise(), freedom={"shown": np.inf})
    chosen = plain.fit_from(base.candidate.with_effect(named) if named else base.candidate, base)
    found = cv_errors(plain, chosen, Blocks.of(data, False, movement(chosen)), chosen)
    noise = chosen.fit.noise["shown"].deviation ** 2
    assert noise == pytest.approx(np.mean(chosen.fit.residual["shown"] ** 2), rel=0.01)
    expected = np.log(np.exp(by_regression(data, [SHAPES[named]] if named else [])) + noise)
    assert found == pytest.approx(expected, abs=2e-3)


def test_a_run_is_left_out_whole_but_for_what_tells_where_it_starts():
    parts = {f"run {k}": record(lambda s, _: 0.0 * s, k) for k in range(5)}
    data = Dataset.joined(parts)
    even = np.full(len(data.time), 1.0 / len(data.time))
    blocks = Blocks.of(data, False, even)
    assert blocks.count == 5
    for k, run in enumerate(data.runs):
        number = blocks.number[run.samples]
        assert set(number) == {-1, k}
        assert number[0] == -1 < number[-1]
    two = Dataset.joined(dict(list(parts.items())[:2]))
    few = Blocks.of(two, False, np.full(len(two.time), 1.0 / len(two.time)))
    assert few.count == 16
    assert set(few.number) == {*range(-1, 16)}  # between two runs is no block


def test_a_step_of_a_record_that_rests_is_in_several_blocks():
    data = record(lambda s, _: 0.0 * s)
    decay = np.where(np.arange(COUNT) >= 800, np.exp(-(np.arange(COUNT) - 800.0) / 20.0), 0.0)
    blocks = Blocks.of(data, False, decay / decay.sum())
    assert (np.diff(blocks.number) >= 0).all()
    assert set(blocks.number) == set(range(16))
    # a half of the blocks is for the movement, all but exp(-5) of which is over by then
    assert len(set(blocks.number[800:900])) >= 8
    # and the other half for time: none is longer than an eighth of the record
    assert np.bincount(blocks.number).max() <= COUNT // 8 + 1
    moving = np.where(np.arange(COUNT) % 2, 1.5, 0.5) / COUNT
    assert (Blocks.of(data, False, moving).number == np.arange(COUNT) // 100).all()


@pytest.mark.parametrize(
    ("gains", "better"),
    [
        ([0.1, -0.1] * 8, False),  # in turn
        ([0.01] * 12 + [0.0] * 4, True),  # a little, all along
        ([9.0] + [-0.05] * 15, False),  # one of them, and the others say the opposite
        ([2.0] * 6 + [-0.1, 0.1] * 5, True),  # only where it acts
    ],
)
def test_blocks_agree_or_their_sum_is_sure(gains, better):
    errors = np.zeros(len(gains))
    assert predicts_better(errors - np.array(gains), errors) is better
    assert not predicts_better(errors, errors - np.array(gains)) or not better


def test_what_cannot_be_predicted_is_worse_than_anything():
    errors, never = np.zeros(16), np.full(16, np.inf)
    assert predicts_better(errors, never)
    assert not predicts_better(never, errors)


def far_out(signal, block):
    """One stretch is wrong by much in one way, and all are by a little in another."""
    return np.where((block >= 4) & (block < 9), 1.6 * even(signal), 0.0) + 0.1 * odd(signal)


def test_one_stretch_does_not_choose_the_cause(monkeypatch):
    """By least squares the one stretch outweighs all others, which what was fitted to it makes
    worse.
    """
    data, effects = record(far_out, 3), [EVEN, ODD]
    least = {}
    for e in effects:
        table = np.column_stack([data.inputs["signal"], SHAPES[e](data.inputs["signal"])])
        least[e] = np.linalg.lstsq(table, data.measured["shown"])[1][0]
    assert least[EVEN] < 0.95 * least[ODD]
    assert (
        by_regression(data, [odd]).sum()
        < by_regression(data, []).sum()
        < by_regression(data, [even]).sum()
    )
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    search = replace(
        search, freedom={"shown": np.inf}
    )  # a heavy tail would take the stretch for outliers
    base = search.refit(base)
    scored = score(search, base, effects)
    found = ranked(search, base, [scored], effects)
    assert [row[0].effect for row in found.rows] == [ODD, EVEN]
    assert [found.is_admissible(row) for row in found.rows] == [True, False]
    monkeypatch.setattr(ranking, "has_structure", lambda *_: False)
    assert ranked(search, base, [scored], effects).rows[0][0].effect is EVEN


def test_a_criterion_decides_where_a_model_is_right(monkeypatch):
    data = record(lambda s, _: 0.5 * even(s))
    search, base, scored = searched(data, [EVEN, ODD])
    monkeypatch.setattr(ranking, "COMPARABLE", 0.0)  # both are fitted
    monkeypatch.setattr(ranking, "WORTH", 0.0)
    found = ranked(search, base, [scored], [EVEN, ODD])
    assert found.cv_errors == {}
    (first, gain), (second, other) = found.rows
    assert first.effect is EVEN
    assert found.is_admissible((first, gain))
    assert not found.indistinguishable((first, gain), (second, other))
    assert found.indistinguishable((first, gain), (second, gain - 5.9))
    assert not found.indistinguishable((first, gain), (second, gain - 6.1))


def wrong_in_turn(signal, block):
    """One follows the record where the other does not."""
    return np.where(block // 2 % 2 == 0, 1.05 * even(signal), odd(signal) / np.sqrt(3.0))


def test_models_that_are_wrong_in_turn_are_alternatives():
    data, effects = record(wrong_in_turn, 6), [EVEN, ODD]
    (first, *_) = select(Search(data, Amplifier, ["gain"]), effects).steps
    assert {first.chosen.effect_name, *(e.effect_name for e in first.alternatives)} == {
        "even",
        "odd",
    }


def test_a_model_that_predicts_better_all_along_has_no_alternative():
    data, effects = (
        record(lambda s, k: even(s) + 0.05 * quartic(s) * (1.0 + 0.5 * (k % 2))),
        [EVEN, ODD],
    )
    first = select(Search(data, Amplifier, ["gain"]), effects).steps[0]
    assert first.chosen.effect_name == "even"
    assert first.alternatives == []


def test_what_was_not_predicted_is_neither_named_nor_an_alternative():
    errors, without = np.zeros(16), np.ones(16)
    one, other = (type("Fitted", (), {"effect": e})() for e in (EVEN, ODD))
    found = Ranking([(one, 50.0), (other, 60.0)], {EVEN: errors}, without)
    assert found.is_admissible((one, 50.0))
    assert not found.is_admissible((other, 60.0))
    assert not found.indistinguishable((one, 50.0), (other, 60.0))


def test_blocks_that_agree_are_evidence_where_a_likelihood_is_none(monkeypatch):
    monkeypatch.setattr(FittedCandidate, "robust_fall", lambda *_: 0.0)
    mixed = record(lambda s, k: even(s) + 0.05 * quartic(s) * (1.0 + 0.5 * (k % 2)))
    assert [
        step.chosen.effect_name for step in select(Search(mixed, Amplifier, ["gain"]), [EVEN]).steps
    ] == ["even"]
    right = record(lambda s, _: 0.5 * even(s))  # no block is asked where the model is right
    assert select(Search(right, Amplifier, ["gain"]), [EVEN]).steps == []


def test_a_nearer_fit_that_is_known_stays():
    data = record(wrong_in_turn, 6)
    search, base, scored = searched(data, [EVEN, ODD])
    before = ranked(search, base, [scored], [EVEN, ODD]).near[EVEN]
    nearer = replace(before, fit=replace(before.fit, deviance=before.fit.deviance - 1.0))
    assert ranked(search, base, [scored], [EVEN, ODD], {EVEN: nearer}).near[EVEN] is nearer
    farther = replace(before, fit=replace(before.fit, deviance=before.fit.deviance + 1.0))
    assert ranked(search, base, [scored], [EVEN, ODD], {EVEN: farther}).near[EVEN] is not farther


@pytest.mark.parametrize(
    ("gains", "farther", "first"),
    [((50.0, 51.0), 0.3, 0), ((50.0, 57.0), 0.1, 0), ((50.0, 57.0), 0.3, 1)],
    ids=["as likely", "as near", "neither"],
)
@pytest.mark.parametrize("kind", ["input", "output"])
def test_a_law_comes_before_an_input_or_output_that_explains_as_much(gains, farther, first, kind):
    """As near is up to a tenth of the error, 0.21 of twice its logarithm."""
    law = OTHERS[0]
    other = dead_zone(Amplifier, "signal") if kind == "input" else OF_OUTPUT["sensor_gain"]
    rows = [
        (type("Fitted", (), {"effect": e})(), gain)
        for e, gain in zip((law, other), gains, strict=True)
    ]
    uneven = farther * 16.0 * np.eye(16)[0]  # one block does not make a cause sure
    found = Ranking(rows[::-1], {law: uneven, other: np.zeros(16)}, np.ones(16))
    assert stepwise._in_turn(found)[0] is rows[first]


@pytest.mark.parametrize(
    ("gains", "constant", "starts", "free", "first"),
    [
        ((91.0, 100.0), 40.0, ("memory_start",), False, 0),
        ((89.0, 100.0), 40.0, ("memory_start",), False, 1),
        ((91.0, 100.0), 20.0, ("memory_start",), False, 1),
        ((91.0, 100.0), 40.0, (), False, 1),
        ((91.0, 100.0), 20.0, (), True, 0),
        ((100.0, 99.0), 40.0, ("memory_start",), False, 0),
    ],
)
def test_a_memory_that_decays_all_the_time_takes_no_credit_for_what_needs_none(
    gains, constant, starts, free, first
):
    """A third of a record of 100 s, and nine tenths of the gain."""
    fitted = SimpleNamespace(
        effect=OF_OUTPUT["sensor_lag"],
        candidate=SimpleNamespace(starts=starts),
        problem=SimpleNamespace(largest={"shown_lag_time": 100.0}),
        fit=SimpleNamespace(values={"shown_lag_time": constant}),
    )
    offset = SimpleNamespace(effect=OF_OUTPUT["sensor_offset"])
    rows = list(zip((offset, fitted), gains, strict=True))
    found = Ranking(sorted(rows, key=lambda row: -row[1]), free=free)
    assert stepwise._in_turn(found)[0] is rows[first]


@pytest.mark.parametrize(
    ("lowered", "share", "looks"), [(5.0, 0.0, 1), (20.0, 0.0, 2), (20.0, 0.1, 1)]
)
@pytest.mark.parametrize("late", [False, True])
def test_a_better_optimum_of_the_model_below_asks_for_a_second_look(
    monkeypatch, lowered, share, looks, late
):
    """What the second look finds counts, unless the time was spent in it.

    The effect gains thousands, of which 20 is no tenth.
    """
    monkeypatch.setattr(stepwise, "LOWERED", share)
    plain, nested, seen = stepwise.ranked, Search.nested, []
    search = Search(record(lambda s, _: 0.5 * even(s)), Amplifier, ["gain"])

    def better(self, below, richer):
        found = nested(self, below, richer)
        once = 0.0 if seen[1:] else lowered
        return replace(found, fit=replace(found.fit, deviance=found.fit.deviance - once))

    def looked(*given, **fits):
        seen.append(given)
        if len(seen) < 2:
            return plain(*given, **fits)
        monkeypatch.setattr(search.budget, "spent", lambda: late)
        return Ranking()

    monkeypatch.setattr(Search, "nested", better)
    monkeypatch.setattr(stepwise, "ranked", looked)
    named = [step.chosen.effect_name for step in select(search, [EVEN]).steps]
    assert len(seen) == looks
    assert named == (["even"] if looks == 1 or late else [])
