"""Claims: a forecast of life is where a known growth reaches its limit, its interval holds the
truth as often as it says, and it has no end where nothing grows.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from fmus.kit.errors import UserError
from orchestration.identify.ageing import forecast_life

TIME = 100.0 * np.arange(120)
RATE = 6e-6  # ohm/s
LENGTH = TIME[-1]


def test_a_line_without_noise_is_continued():
    found = forecast_life(TIME, 0.5 + RATE * TIME, 0.25)
    assert found.limit == pytest.approx(0.625, rel=1e-6)
    assert found.life == pytest.approx(0.125 / RATE, rel=1e-4)
    assert found.interval == pytest.approx((found.life, found.life), rel=1e-3)
    assert found.course(TIME) == pytest.approx(0.5 + RATE * TIME, rel=1e-5)
    assert "0.625 ohm after" in str(found)


def test_a_fall_at_first_does_not_count_as_growth():
    """The rise is of the first value, from which a warming actuator falls (section 4.3)."""
    impedance = 0.5 + RATE * TIME + 0.02 * np.exp(-TIME / 800.0)
    noise = 1e-4 * np.random.default_rng(7).standard_normal(TIME.size)
    low, high = forecast_life(TIME, impedance + noise, 0.2).interval
    assert low <= (0.52 * 1.2 - 0.5) / RATE <= high
    assert high - low < 0.2 * LENGTH


def test_the_course_is_that_of_the_data_and_the_limit_of_its_first_value():
    """In noise of a thousandth of the rise, of which the mean of the fits is far within."""
    noise = 3e-4 * np.random.default_rng(5).standard_normal(TIME.size)
    line = 0.9 + RATE * TIME
    found = forecast_life(TIME, line + noise, 0.15)
    assert found.course(TIME) == pytest.approx(line, abs=3e-4)
    assert found.limit == pytest.approx(1.15 * line[0], abs=1.15 * 3e-4)


def test_units_and_the_beginning_of_the_clock_do_not_count():
    """Values of a record that is moved and scaled are moved and scaled."""
    noise = 1e-3 * np.random.default_rng(3).standard_normal(TIME.size)
    values = 0.5 + RATE * TIME + noise
    one = forecast_life(TIME, values)
    other = forecast_life(5e4 + 3.0 * TIME, 1e3 * values)
    assert other.life == pytest.approx(5e4 + 3.0 * one.life, rel=1e-4)
    assert other.interval == pytest.approx([5e4 + 3.0 * end for end in one.interval], rel=1e-4)
    assert other.limit == pytest.approx(1e3 * one.limit, rel=1e-6)


def _white(rng: np.random.Generator) -> np.ndarray:
    return rng.standard_normal(TIME.size)


def _remembering(rng: np.random.Generator) -> np.ndarray:
    """AR(1) with coefficient 0.9, and unit variance."""
    fresh = np.sqrt(1.0 - 0.81) * rng.standard_normal(TIME.size + 200)
    return lfilter([1.0], [1.0, -0.9], fresh)[200:]


def _flicker(rng: np.random.Generator) -> np.ndarray:
    """1/f noise by random phases and amplitudes of a spectrum that is eight times as long."""
    count = 8 * TIME.size
    frequency = np.fft.rfftfreq(count)[1:]
    lines = rng.standard_normal((2, frequency.size)) / np.sqrt(frequency)
    noise = np.fft.irfft(np.concatenate([[0.0], lines[0] + 1j * lines[1]]), count)
    return noise[: TIME.size] / np.sqrt(4.0 * np.sum(1.0 / frequency) / count**2)


def _outlying(rng: np.random.Generator) -> np.ndarray:
    """One of twenty values with eight times the deviation."""
    return rng.standard_normal(TIME.size) * np.where(rng.random(TIME.size) < 0.05, 8.0, 1.0)


def _line(share: np.ndarray) -> np.ndarray:
    return share


def _exponential(share: np.ndarray) -> np.ndarray:
    return np.expm1(share)


def _root(share: np.ndarray) -> np.ndarray:
    return np.sqrt(share)


def _held(growth, noise, seeds) -> tuple[int, int]:
    """Return how often intervals hold the life, and how often they have an end.

    Lives are 1.3 to 2 record lengths, and noise is 1/250 to 1/75 of the rise.
    """
    held = bounded = 0
    for seed in seeds:
        rng = np.random.default_rng([2026, seed])
        life, deviation = rng.uniform(1.3, 2.0), np.exp(rng.uniform(*np.log([3e-4, 1e-3])))
        impedance = 0.5 * (1.0 + 0.15 * growth(TIME / LENGTH) / growth(np.float64(life)))
        low, high = forecast_life(TIME, impedance + deviation * noise(rng)).interval
        held += low <= life * LENGTH <= high
        bounded += np.isfinite(high)
    return held, bounded


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize(
    ("growths", "noises"),
    [
        ((_line, _exponential), (_white, _remembering, _flicker)),
        ((_line, _root), (_white, _remembering, _outlying)),
    ],
    ids=["exponential and 1/f", "root and outliers"],
)
def test_the_interval_holds_the_life_as_often_as_it_says(growths, noises):
    """Of 300 lives of two shapes and three noises, none of which is told."""
    held = bounded = 0
    for growth in growths:
        for noise in noises:
            found = _held(growth, noise, range(50))
            print(f"{growth.__name__} {noise.__name__}: {found[0]} of 50, {found[1]} with an end")
            held += found[0]
            bounded += found[1]
    print(f"{held} of 300")
    assert 0.93 <= held / 300 <= 0.97
    assert bounded > 200


def test_the_first_value_is_as_uncertain_as_all_others():
    """An error of the first value alone, of ten deviations, hardly moves the forecast."""
    values = 0.5 + RATE * TIME + 1e-3 * np.random.default_rng(5).standard_normal(TIME.size)
    moved = values.copy()
    moved[0] += 1e-2  # 2 % of the limit: a rise relative to it moves the end by 1900 s
    one, other = forecast_life(TIME, values), forecast_life(TIME, moved)
    assert abs(other.life - one.life) < 0.1 * one.life


def test_what_does_not_surely_grow_has_no_end():
    noise = 1e-3 * np.random.default_rng(1).standard_normal(120)
    found = forecast_life(TIME, 0.5 + noise, 0.25)
    assert found.interval[1] == np.inf
    assert found.to_dict()["ci95"][1] is None


@pytest.mark.parametrize(
    ("time", "impedance", "rise", "said"),
    [
        (TIME, TIME + 1.0, 0.0, r"^rise = 0: must be above 0$"),
        (TIME[:5], TIME[:5], 0.1, r"of one length, of 6 values or more$"),
        (TIME, TIME[:9], 0.1, r"\(120,\) and \(9,\): must be vectors"),
        (TIME, TIME * np.nan, 0.1, r"^time and impedance: every value must be a finite number$"),
        (-TIME, TIME, 0.1, r"^time: must increase, and does not after sample 0$"),
    ],
)
def test_what_cannot_be_forecast_is_told(time, impedance, rise, said):
    with pytest.raises(UserError, match=said):
        forecast_life(time, impedance, rise)
