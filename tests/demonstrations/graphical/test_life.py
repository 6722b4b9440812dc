"""Claims: a forecast of life is where a line crosses, its interval holds the truth as often as it
says, and it has no end where nothing grows.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from demonstrations.graphical import forecast_life
from fmus.kit.errors import UserError

TIME = 100.0 * np.arange(120)
RATE = 6e-6  # ohm/s


def test_a_line_without_noise_is_continued():
    """0.5 ohm and 25 % of it at 6 uohm/s, after a minimum at 2100 s as in section 4.3."""
    impedance = np.where(TIME < 2100, 0.5 - 1e-5 * TIME, 0.479 + RATE * (TIME - 2100))
    found = forecast_life(TIME, impedance, 0.25)
    assert found.begin == 2100.0
    assert found.limit == pytest.approx(0.625)
    assert found.rate.value == pytest.approx(RATE)
    assert found.life.value == pytest.approx(2100 + 0.146 / RATE)
    assert found.life.interval == pytest.approx([found.life.value] * 2, rel=1e-6)
    assert "0.625 ohm after" in str(found)


@pytest.mark.parametrize("memory", [0.0, 0.6])
def test_the_interval_holds_the_life_nearly_as_often_as_it_says(memory):
    """Of 400 records, 95 % less what eight stretches cannot tell of noise that remembers."""
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(400):
        fresh = rng.standard_normal(220)
        noise = 2e-3 * np.sqrt(1 - memory**2) * lfilter([1.0], [1.0, -memory], fresh)[100:]
        noise[0] = 0.0  # the first value is what the rise is of
        low, high = forecast_life(TIME, 0.5 + RATE * TIME + noise, 0.25, begin=0.0).life.interval
        held += low <= 0.125 / RATE <= high
    assert 0.89 < held / 400 < 0.98


def test_what_does_not_surely_grow_has_no_end():
    noise = 1e-3 * np.random.default_rng(1).standard_normal(120)
    found = forecast_life(TIME, 0.5 + noise, 0.25, begin=0.0)
    assert found.life.interval[1] == np.inf


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"rise": 0.0}, r"^rise = 0: must be above 0$"),
        ({"begin": 1.1e4}, r"^10 impedances from 11000 s on: at least 24 show a growth$"),
    ],
)
def test_what_cannot_be_forecast_is_told(given, said):
    with pytest.raises(UserError, match=said):
        forecast_life(TIME, 0.5 + RATE * TIME, **given)
