"""Claims: noise as it comes decides no verdict, and structure beneath it does.

Every test that can decide a verdict is run on what a perfect model leaves of records drawn with
NumPy: Gaussian, coloured and heavy-tailed noise, outliers, converters, levels that vary, closed
loops. None may be called structure.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from tests.support.battery import analysed, found
from tests.support.noises import (
    KINDS,
    LOOPS,
    SAMPLES,
    TIME,
    clean,
    controlled,
    gaussian,
    growing_with_size,
    outliers,
    slowly_varying,
    student,
)
from tests.support.pace import slow_but

FEW, MANY = 12, 100  # records of each kind
SMOOTH = (2, 4, 8, 10)  # chirps and multisines
FRESH = 10_000  # seeds that nothing was tuned on
MOST = 0.01  # false alarms of all the tests of one output together
HEAVY = {
    "t3": student(),
    "outliers": outliers(),
    "level in time": slowly_varying(),
    "level by size": growing_with_size(),
}


@pytest.mark.parametrize(
    "kind",
    slow_but(
        [*KINDS, *LOOPS],
        "Gaussian, AR 0.9",
        "Student t3, AR 0",
        "1 % outliers, AR 0.9",
        "level in time, AR 0.9",
        "level by size, AR 0",
        "12 bit, noise of a step, AR 0.9",
        "steps of 10 noise",
        "steps, no noise",
        "loop, gain 0.5, 0 late, AR 0",
        "loop, gain 2, 1 late, AR 0.9",
    ),
)
def test_noise_as_it_comes_is_no_structure(kind):
    """At 1 % none of a dozen is to be expected; two would be one chance in two hundred."""
    make = (KINDS | LOOPS)[kind]
    alarms = [seed for seed in range(FRESH, FRESH + FEW) if found(analysed(make(seed)))]
    assert len(alarms) <= 1, alarms


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_false_alarms_of_the_battery(capsys):
    """The table: how often anything is found where nothing is, of every kind."""
    shares = {}
    for kind, make in (KINDS | LOOPS).items():
        each = [found(analysed(make(seed))) for seed in range(FRESH, FRESH + MANY)]
        shares[kind] = sum(map(bool, each)) / MANY
        with capsys.disabled():
            print(
                f"{kind:38s} {shares[kind]:6.1%} "
                f" {dict(Counter(name for names in each for name in names))}"
            )
    assert {kind: share for kind, share in shares.items() if share > MOST} == {}


@pytest.mark.parametrize("noise", HEAVY)
@pytest.mark.parametrize("seed", slow_but(range(4), 1, 2))
class TestPower:
    """Structure is found beneath such noise, of a standard deviation of 0.05, or of that of its
    bulk.
    """

    def test_a_slip_is_a_level_shift(self, noise, seed):
        record = clean(SMOOTH[seed], HEAVY[noise])  # the model is to blame where an input steps
        analysis = analysed(record, np.where(TIME >= 120.0, 2.0, 0.0))
        assert [shift.time for shift in analysis.level_shifts] == pytest.approx([120.0])

    def test_a_hum_is_a_line(self, noise, seed):
        analysis = analysed(clean(seed, HEAVY[noise]), 0.06 * np.sin(2.0 * np.pi * 1.7 * TIME))
        assert analysis.lines[0].frequency == pytest.approx(1.7, abs=1.0 / TIME[-1])

    def test_a_walk_is_found(self, noise, seed):
        walk = 0.01 * np.cumsum(np.random.default_rng(seed).standard_normal(SAMPLES))
        assert "RandomWalkTest" in found(analysed(clean(seed, HEAVY[noise]), walk))

    def test_what_depends_on_a_state_is_found(self, noise, seed):
        record = clean(6 * seed, HEAVY[noise])
        missing = 0.05 * (record.states["fast"] / record.states["fast"].std()) ** 2
        assert {"ConditionalMean", "CrossCorrelation"} & set(found(analysed(record, missing)))


def test_outliers_are_told_and_a_varying_level_is():
    analysis = analysed(clean(3, outliers()))
    assert analysis.outliers == pytest.approx(0.01 * SAMPLES, abs=10)
    varying = analysed(clean(3, growing_with_size()))
    assert varying.regions[0].p_value < 1e-6
    assert analysed(clean(3, gaussian())).outliers == 0


@pytest.mark.parametrize("late", [0, 1, 3])
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_feedback_is_recognised_with_its_sign_and_delay(late, pole):
    (one,) = analysed(controlled(2, gaussian(pole), 2.0, late)).feedback
    assert (one.output, one.input) == ("y", "u")
    assert one.lag == pytest.approx(0.1 * late, abs=0.101)
    assert one.strength < -0.2


def test_an_input_that_nobody_feeds_back_is_none():
    assert sum(bool(analysed(clean(seed, gaussian(0.9))).feedback) for seed in range(30)) <= 1


def test_a_loop_hides_no_structure():
    """A residual that depends on the input some samples before is held against the model, whoever
    moved the input.
    """
    record = controlled(1, gaussian(), 2.0, 1)
    late = np.concatenate([np.zeros(5), record.input[:-5]])
    assert "CrossCorrelation" in found(analysed(record, 0.03 * late / late.std()))
