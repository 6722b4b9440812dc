"""Claims: noise of the clock and of inputs is taken away, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmus.kit.arrays import Array
from orchestration.diagnosis import Record, subject_of
from orchestration.diagnosis.recording import evenly, with_quiet_inputs, without_outliers
from orchestration.diagnosis.subject import Subject
from tests.support.diagnosed_mass import START, D, K, M, exact, mass, pushed

NOISE = 0.02


def forced(force: Array) -> Record:
    count = len(force)
    return Record(0.05 * np.arange(count), force[:, None], np.zeros((count, 1)), (False,))


def noisy(force: Array, seed: int = 0) -> Array:
    return force + NOISE * np.random.default_rng(seed).standard_normal(len(force))


def quiet(force: Array) -> Array:
    return with_quiet_inputs(mass(), forced(force)).inputs[:, 0]


def jittered(count: int = 300) -> tuple[Record, Record]:
    """Return an even record and the same with noisy time stamps, of nearly half a step at most."""
    even = forced(np.zeros(count))
    late = 0.45 * np.random.default_rng(1).uniform(-1.0, 1.0, count)
    return even, replace(even, time=even.time + 0.05 * late)


def test_a_noisy_clock_is_the_even_one_next_to_it() -> None:
    even, record = jittered()
    read = evenly(mass(), record)
    assert read.denoised == ("time",)
    assert np.diff(read.time) == pytest.approx(np.full(299, 0.05), rel=1e-3)
    assert read.time[0] == record.time[0]
    assert evenly(mass(), even) is even


def test_time_stamps_may_be_later_than_the_next_sample_now_and_then() -> None:
    even, _ = jittered()
    late = 0.25 * np.random.default_rng(5).standard_normal(300)
    read = evenly(mass(), replace(even, time=even.time + 0.05 * late))
    assert np.diff(read.time) == pytest.approx(np.full(299, 0.05), rel=1e-3)


def test_a_clock_that_is_not_even_stays() -> None:
    even, _ = jittered()
    drifting = replace(even, time=even.time + 0.1 * np.sin(even.time))
    assert evenly(mass(), drifting) is drifting
    short = Record(
        *(np.delete(a, 150, axis=0) for a in (even.time, even.inputs, even.outputs)), (False,)
    )
    assert evenly(mass(), short) is short


def test_an_input_at_levels_is_their_mean() -> None:
    """To what is certain of a mean of so many samples, also of short levels."""
    levels = np.repeat(np.random.default_rng(3).choice([-2.0, 0.0, 5.0], 80), 5)
    assert np.abs(quiet(noisy(levels)) - levels).max() < 5.0 * NOISE / np.sqrt(100)


def test_levels_nearer_than_the_noise_are_no_single_one() -> None:
    """A mean of both would be a slow error, which is worse than noise."""
    force = np.repeat([1.0, 4.0, 1.0 + 3.0 * NOISE, 4.0 + 3.0 * NOISE], 200)
    assert (
        np.abs(np.mean((quiet(noisy(force)) - force).reshape(4, 200), axis=1)).max() < 0.5 * NOISE
    )


def test_a_smooth_input_is_smoothed_between_its_jumps() -> None:
    """Of a wave of 60 samples with jumps more than half of the noise goes, and no jump."""
    k = np.arange(600)
    force = np.sin(2.0 * np.pi * k / 60.0) + np.where(k % 250 < 130, 0.0, 2.0)
    errors = quiet(noisy(force)) - force
    assert np.sqrt(np.mean(errors**2)) < 0.5 * NOISE
    assert np.abs(errors).max() < 3.0 * NOISE


def test_parabolas_between_jumps_are_as_smooth_as_can_be() -> None:
    """Their third differences vanish: errors are nearly those of a fit of both by least squares."""
    k = np.arange(400)
    force = np.where(k < 200, 1e-4 * (k - 90.0) ** 2, 9.0 - 2e-4 * (k - 310.0) ** 2)
    measured = noisy(force)
    pieces = (slice(0, 200), slice(200, 400))
    fitted = np.concatenate([np.polyval(np.polyfit(k[p], measured[p], 2), k[p]) for p in pieces])
    assert np.sqrt(np.mean((quiet(measured) - fitted) ** 2)) < 0.25 * NOISE


def test_an_input_is_as_stiff_as_it_is_smooth_there() -> None:
    """Stiffness for the fast half would leave in the slow one twice the noise that need be."""
    k = np.arange(1000)
    force = np.where(k < 500, np.sin(2.0 * np.pi * k / 500.0), np.sin(2.0 * np.pi * k / 20.0))
    errors = (quiet(noisy(force)) - force).reshape(2, 500)
    assert np.sqrt(np.mean(errors[0, 50:-50] ** 2)) < 0.3 * NOISE
    assert np.sqrt(np.mean(errors[1, 50:-50] ** 2)) < 0.8 * NOISE


def test_an_input_without_noise_and_one_that_stands_still_stay() -> None:
    for force in (np.repeat([0.0, 1.0, -1.0], 50), np.full(100, 3.0), np.ones(4)):
        record = forced(force)
        assert with_quiet_inputs(mass(), record) is record


def measured(force: Array) -> Record:
    """Return a record of the mass under a force, with little noise of its position."""
    record = forced(force)
    states = exact(record, (M, K, D), START, force)
    noise = 1e-4 * np.random.default_rng(5).standard_normal(len(force))
    return replace(record, outputs=states[:, :1] + noise[:, None])


def made(record: Record) -> Subject:
    subject = subject_of(mass(), [record])
    assert subject is not None
    return subject


def test_noise_of_an_input_or_of_the_clock_is_taken_away_where_the_model_follows_better() -> None:
    force = 5.0 * np.sign(np.sin(0.7 * 0.05 * np.arange(300)) + 0.2)
    record = measured(force)
    plain = made(record)
    assert plain.problem.records[0].denoised == ()
    shaken = (force + 15.0 * noisy(0.0 * force))[:, None]
    of_mean = 0.3 / 5.0 / np.sqrt(100)  # that a mean of so many samples leaves of its level
    for other, names, left in (
        (replace(record, inputs=shaken), ("force",), of_mean),
        (replace(record, time=jittered()[1].time), ("time",), 0.0),
    ):
        subject = made(other)
        assert subject.problem.records[0].denoised == names
        assert subject.left_out[0].record.denoised == names
        assert subject.base.misfit < 1.1 * plain.base.misfit + left


def test_an_input_that_acts_with_its_noise_keeps_it() -> None:
    """The mass was pushed by what was measured."""
    force = 5.0 * np.sign(np.sin(0.7 * 0.05 * np.arange(300)) + 0.2)
    record = measured(force + 15.0 * noisy(0.0 * force))
    assert made(record).problem.records[0].denoised == ()


def test_time_stamps_that_are_true_stay() -> None:
    """Samples were taken when they say."""
    _, record = jittered()
    force = pushed(300, 0.05).inputs[:, 0]
    states = [START]
    for k, step in enumerate(np.diff(record.time)):
        pair = Record(np.array([0.0, step]), np.zeros((2, 1)), np.zeros((2, 1)), (False,))
        states.append(exact(pair, (M, K, D), states[-1], force[[k, k]])[1])
    positions = np.array(states)[:, :1]
    noise = 1e-4 * np.random.default_rng(5).standard_normal((300, 1))
    own = replace(record, inputs=force[:, None], outputs=positions + noise)
    assert made(own).problem.records[0].denoised == ()


def test_single_values_far_from_their_neighbours_are_gaps() -> None:
    """A run of such, what is left at a jump of the input, and the tails of noise stay."""
    force = np.where(np.arange(400) < 200, 0.0, 3.0)
    errors = noisy(0.0 * force)[:, None]
    errors[[50, 120, 301], 0] += [20.0 * NOISE, -40.0 * NOISE, 12.0 * NOISE]
    errors[200, 0] += 30.0 * NOISE
    errors[330:350, 0] += 20.0 * NOISE
    read = without_outliers(mass(), forced(force), errors)
    assert np.flatnonzero(np.isnan(read.outputs[:, 0])).tolist() == [50, 120, 301]
    assert read.denoised == ("position",) * 3


def test_many_are_no_outliers() -> None:
    """Nor is any of an output that was not measured."""
    errors = noisy(np.zeros(400))[:, None]
    record = forced(np.zeros(400))
    assert without_outliers(mass(), record, np.full((400, 1), np.nan)) is record
    errors[::10] += 30.0 * NOISE
    assert without_outliers(mass(), record, errors) is record


def test_outliers_are_fitted_by_nothing() -> None:
    """Neither on fitted samples nor on those that are left out."""
    record = measured(5.0 * np.sin(0.7 * 0.05 * np.arange(300)))
    plain = made(record)
    spoilt = record.outputs.copy()
    spoilt[[30, 111, 250]] += 0.02
    subject = made(replace(record, outputs=spoilt))
    assert subject.problem.records[0].denoised == ("position",) * 2
    assert np.flatnonzero(np.isnan(subject.left_out[0].record.outputs[200:, 0])).tolist() == [50]
    assert subject.base.misfit == pytest.approx(plain.base.misfit, rel=0.05)
