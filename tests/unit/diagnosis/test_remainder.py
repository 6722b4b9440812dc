"""Claims: what is left is told in noise widths, and a slow error from noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from orchestration.diagnosis.remainder import (
    TESTS,
    Remainder,
    drifts,
    noise_of,
    recurs,
    remainders,
    undersampled,
    with_gaps,
)
from orchestration.diagnosis.runs import Record
from tests.support.oscillator import DRY, diagnosis_with, oscillator_record


def test_what_is_left_is_the_noise_that_was_added():
    diagnosis = diagnosis_with(oscillator_record(1, noise=3e-3))
    (left,) = diagnosis.remainders
    measured = diagnosis.records[0].signals["position"]
    unseen = measured[len(measured) * 2 // 3 :]
    assert left.share == pytest.approx(3e-3 / np.std(unseen), rel=0.25)
    assert left.noise_widths == pytest.approx(1.0, abs=0.3)
    assert left.pace == "fast"


def test_what_a_converter_rounds_off_is_noise():
    """Of a slow output most second differences are zero; steps of 1 deviate by 1 / sqrt 12."""
    record = oscillator_record(1, noise=0.0)
    position = record.signals["position"]
    step = 0.1 * np.ptp(position)
    rounded = record.signals | {"position": step * np.round(position / step)}
    (left,) = diagnosis_with(replace(record, signals=rounded)).remainders
    assert left.noise_widths == pytest.approx(1.0, abs=0.3)


def test_noise_is_told_from_a_slow_error():
    time = np.linspace(0.0, 20.0, 4000)
    noise = np.random.default_rng(3).normal(0.0, 0.2, time.size)
    assert noise_of(noise + np.sin(time)) == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize(
    ("correlation", "pairs", "pace"),
    [
        (0.9, 400, "slow"),
        (0.1, 400, "fast"),
        (1.0, 12, "slow"),
        (1.0, 8, "unknown"),
        (0.0, 0, "unknown"),
    ],
)
def test_few_neighbours_do_not_tell_whether_an_error_is_slow(correlation, pairs, pace):
    """Of 400, 12 and 8 pairs of white noise three standard errors are 0.15, 0.87 and 1.06."""
    assert Remainder("position", 0.1, 3.0, {"correlation": correlation}, pairs).pace == pace


@pytest.mark.parametrize(
    ("correlation", "pairs", "widths", "more"),
    [
        (0.9, 400, 3.0, True),
        (0.9, 400, None, True),
        (0.9, 400, 1.2, False),
        (0.4, 400, 3.0, True),
        (0.1, 400, 3.0, False),
        (0.9, 9, 3.0, False),
    ],
)
def test_more_than_noise_is_large_and_correlates_beyond_chance(correlation, pairs, widths, more):
    """Of 400 and of 9 pairs of white noise correlations have standard errors of 0.05 and 0.33."""
    one = Remainder("position", 0.1, widths, {"correlation": correlation}, pairs)
    assert one.is_more_than_noise is more


def test_the_structure_is_the_size_of_a_slow_error_in_noise():
    rng = np.random.default_rng(4)
    judged, n = diagnosis_with(oscillator_record(1), (DRY,)).found.base, 2000
    slow = 0.2 * np.sin(np.linspace(0.0, 100.0, n))
    noisy = replace(judged, measuring=(slow + rng.normal(0.0, 0.3, n))[:, np.newaxis])
    (left,) = remainders(noisy)
    assert left.structure == pytest.approx(0.2 / np.sqrt(2.0), rel=0.2)
    assert left.pace == "fast"
    assert drifts(noisy)
    white = replace(judged, measuring=rng.normal(0.0, 0.33, (n, 1)))
    assert not drifts(white)


@pytest.mark.parametrize("is_periodic", [False, True])
def test_noise_that_remembers_does_not_recur_with_the_input(is_periodic):
    """An error that is a function of the input does, in each of its sixteen periods."""
    judged = diagnosis_with(oscillator_record(1), (DRY,)).found.base
    problem, n = judged.fit.problem, 2000
    time = 0.01 * np.arange(n)
    force = np.sin(2.0 * np.pi * time / 1.25)
    record = Record(time, force[:, np.newaxis], np.zeros((n, 1)), (True,))
    white = np.random.default_rng(6).normal(0.0, 0.01, n)
    slow = np.sin(2.0 * force + 1.0) if is_periodic else lfilter([1.0], [1.0, -0.9], white)
    errors = 0.03 * (slow / slow.std())[:, np.newaxis] + 0.1 * white[:, np.newaxis]
    fitted = replace(judged.fit, problem=replace(problem, records=(record,)), errors=(errors,))
    assert recurs(replace(judged, fit=fitted, measuring=errors)) is is_periodic


def test_samples_on_both_sides_of_a_gap_are_no_neighbours():
    one, other = np.full((3, 1), 1.0), np.full((3, 1), -1.0)
    pieces = with_gaps([one, other])
    assert TESTS["correlation"](pieces[:, 0]) == 1.0


@pytest.mark.parametrize(("period", "is_coarse"), [(100.0, False), (2.7, True)])
def test_noise_of_coarse_samples_cannot_be_told_from_a_law(period, is_coarse):
    """Errors are as white in both; by its period in samples the model moves between them."""
    judged = diagnosis_with(oscillator_record(1), (DRY,)).found.base
    fitted, problem = judged.fit, judged.fit.problem
    (record,), n = problem.records, len(judged.fit.errors[0])
    noise = np.random.default_rng(5).normal(0.0, 0.3, (2 * n, 1))
    wave = np.sqrt(2.0) * np.sin(2.0 * np.pi * np.arange(n) / period)[:, np.newaxis]
    outputs = problem.spread * (wave + noise[:n])
    problem = replace(problem, records=(replace(record, outputs=outputs),))
    fitted = replace(fitted, problem=problem, errors=(noise[:n],))
    names = undersampled(replace(judged, fit=fitted, measuring=noise[n:]))
    assert names == (["position"] if is_coarse else [])
