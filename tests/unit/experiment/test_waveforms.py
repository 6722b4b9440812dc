import numpy as np
import pytest
from scipy import signal

from fmus.kit import UserError
from orchestration.experiment import waveforms

TIME = np.arange(0, 100, 0.1)


def test_square_wave_matches_scipy_away_from_the_switches():
    time = TIME + 0.03
    expected = 0.2 + 0.9 * signal.square(2 * np.pi * 0.2 * time)
    np.testing.assert_allclose(waveforms.square_wave(time, 0.9, 0.2, offset=0.2), expected)


@pytest.mark.parametrize("frequency", [0.1, 0.15, 0.2, 0.3])
def test_square_wave_switches_on_the_sample_despite_rounding(frequency):
    ticks = np.arange(6000)  # time in units of a sixtieth of a half period: integers, exact
    wave = waveforms.square_wave(ticks / (120 * frequency), 1.0, frequency)
    np.testing.assert_array_equal(wave, np.where((ticks // 60) % 2 == 0, 1.0, -1.0))


def test_square_wave_before_zero_continues_the_pattern():
    np.testing.assert_array_equal(
        waveforms.square_wave([-1.5, -0.5, 0.5, 1.5], 1.0, 0.5), [1.0, -1.0, 1.0, -1.0]
    )


def test_force_staircase_is_the_thesis_sequence():
    middles = (
        np.arange(-1, 22) * 50.0 + 25.0
    )  # the middle of every half period of 50 s, one before the start
    force = waveforms.force_staircase(middles, period=100.0)
    levels = [0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75]
    expected = [0.5, *[value for level in levels for value in (level, 0.5)], 0.5, 0.5, 0.5, 0.5]
    np.testing.assert_allclose(force, expected, rtol=1e-12)


def test_force_staircase_switches_on_the_sample():
    ticks = np.arange(20_000)
    force = waveforms.force_staircase(ticks * 0.1, period=60.0)
    jumps = np.flatnonzero(np.diff(force)) + 1
    np.testing.assert_array_equal(jumps, np.arange(1, 18) * 300)


def test_force_staircase_stops_below_a_maximum_that_is_no_level():
    assert (
        np.max(waveforms.force_staircase(TIME, period=2.0, bias=0.0, increment=1.0, maximum=3.9))
        == 3.0
    )


def test_multilevel_dwells_and_never_repeats():
    time = np.arange(0, 20_000, 0.1)
    wave = waveforms.multilevel(time, [-1.0, 0.0, 2.0], dwell=(2.0, 6.0), seed=3)
    switches = np.flatnonzero(np.diff(wave)) + 1
    dwell = np.diff(time[switches])
    # Sampling moves each switch by less than one step.
    assert dwell.min() > 2.0 - 0.1
    assert dwell.max() < 6.0 + 0.1
    spread = 4.0 / np.sqrt(12)  # of a uniform distribution 4 s wide
    assert np.mean(dwell) == pytest.approx(4.0, abs=4 * spread / np.sqrt(dwell.size))
    assert np.std(dwell) == pytest.approx(spread, rel=0.05)
    visits = wave[switches]
    for level in (-1.0, 0.0, 2.0):
        followers = visits[1:][visits[:-1] == level]
        others = [other for other in (-1.0, 0.0, 2.0) if other != level]
        assert set(followers) == set(others)
        assert np.mean(followers == others[0]) == pytest.approx(
            0.5, abs=4 * 0.5 / np.sqrt(followers.size)
        )


def test_multilevel_repeats_by_seed():
    one, same, other = (
        waveforms.multilevel(TIME, [0.0, 1.0], (1.0, 2.0), seed) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert np.any(one != other)


def test_multilevel_covers_time_that_does_not_start_at_zero():
    wave = waveforms.multilevel(TIME + 1e4, [0.0, 1.0], (5.0, 5.0), 0)
    assert np.count_nonzero(np.diff(wave)) == 19


def test_steps_hold_from_their_instants():
    wave = waveforms.steps(
        [0.0, 0.99, 1.0, 1.5, 2.0, 9.0], times=[1.0, 2.0], values=[3.0, -1.0], initial=0.5
    )
    np.testing.assert_array_equal(wave, [0.5, 0.5, 3.0, 3.0, -1.0, -1.0])


def test_ramps_are_lines_between_their_points():
    wave = waveforms.ramps(
        [0.0, 1.0, 2.0, 2.5, 3.0, 3.25, 4.0, 8.0], times=[1.0, 3.0, 4.0], values=[-1.0, 1.0, 5.0]
    )
    np.testing.assert_allclose(wave, [-1.0, -1.0, 0.0, 0.5, 1.0, 2.0, 5.0, 5.0])


def test_sine_is_one_line_of_the_spectrum():
    spectrum = (
        np.fft.rfft(waveforms.sine(TIME, 1.5, 0.37, offset=-0.4)) / TIME.size
    )  # 37 whole periods
    expected = np.zeros(spectrum.size, complex)
    expected[0], expected[37] = -0.4, 1.5 / 2j
    np.testing.assert_allclose(spectrum, expected, atol=1e-12)


def test_chirp_matches_scipy():
    wave = waveforms.chirp(TIME, 0.7, 0.01, 1.5, duration=80.0, offset=0.1)
    expected = 0.1 + 0.7 * signal.chirp(TIME, 0.01, 80.0, 1.5, phi=-90)
    np.testing.assert_allclose(wave, expected, atol=1e-10)


def test_multisine_has_exactly_its_lines():
    frequencies, rms = [0.05, 0.2, 0.33], 0.4
    wave = waveforms.multisine(
        TIME, frequencies, rms, seed=9, offset=1.0
    )  # 100 s hold whole periods of all
    assert np.mean(wave) == pytest.approx(1.0, abs=1e-12)
    assert np.std(wave) == pytest.approx(rms, rel=1e-12)
    amplitudes = 2 * np.abs(np.fft.rfft(wave - 1.0)) / wave.size
    expected = np.zeros_like(amplitudes)
    expected[[5, 20, 33]] = rms * np.sqrt(2 / 3)
    np.testing.assert_allclose(amplitudes, expected, atol=1e-12)
    np.testing.assert_array_equal(
        wave, waveforms.multisine(TIME, frequencies, rms, seed=9, offset=1.0)
    )
    assert np.any(wave != waveforms.multisine(TIME, frequencies, rms, seed=10, offset=1.0))


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: waveforms.square_wave(TIME, 1.0, 0.0), "frequency"),
        (lambda: waveforms.force_staircase(TIME, period=0.0), "period"),
        (lambda: waveforms.force_staircase(TIME, period=1.0, maximum=0.5), "maximum"),
        (lambda: waveforms.force_staircase(TIME, period=1.0, increment=-1.0), "increment"),
        (lambda: waveforms.multilevel(TIME, [1.0, 1.0], (1.0, 2.0), 0), "levels"),
        (lambda: waveforms.multilevel(TIME, [0.0, 1.0], (2.0, 1.0), 0), "dwell"),
        (lambda: waveforms.steps(TIME, [1.0, 1.0], [0.0, 1.0]), "steps"),
        (lambda: waveforms.steps(TIME, [1.0], [0.0, 1.0]), "steps"),
        (lambda: waveforms.ramps(TIME, [1.0, 1.0], [0.0, 1.0]), "ramps"),
        (lambda: waveforms.ramps(TIME, [1.0, 2.0], [0.0]), "ramps"),
        (lambda: waveforms.ramps(TIME, [1.0], [0.0]), "ramps"),
        (lambda: waveforms.sine(TIME, 1.0, -0.1), "frequency"),
        (lambda: waveforms.chirp(TIME, 1.0, 0.1, 1.0, duration=0.0), "duration"),
        (lambda: waveforms.multisine(TIME, [], 1.0, 0), "frequencies"),
        (lambda: waveforms.multisine(TIME, [0.1, 0.1], 1.0, 0), "frequencies"),
        (lambda: waveforms.multisine(TIME, [0.1], -1.0, 0), "rms"),
    ],
)
def test_refusals_name_what_is_wrong(call, text):
    with pytest.raises(UserError, match=text):
        call()


def test_a_step_that_is_limited_is_a_ramp_from_the_old_value():
    """From t0 on: the old value and slew * (t - t0), until the new one is reached."""
    time = np.linspace(0.0, 8.0, 33)
    wanted = waveforms.steps(time, [1.0, 5.0], [3.0, -2.0], initial=2.0)
    found = waveforms.slewed(time, wanted, 0.75)
    rises = 2.0 + np.clip(0.75 * (time - 1.0), 0.0, 1.0)
    expected = np.where(time < 5.0, rises, 3.0 - np.clip(0.75 * (time - 5.0), 0.0, 5.0))
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    assert found[20] == 3.0  # to the bit


def test_a_limit_without_a_rate_is_refused():
    with pytest.raises(UserError, match=r"slew = 0\.0 per second: must be above 0"):
        waveforms.slewed([0.0, 1.0], [0.0, 1.0], 0.0)
