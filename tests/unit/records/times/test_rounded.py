"""Claims: times that are rounded to some digits in any unit get the steps of the clock that wrote
them; times that jitter, or are as coarse as their steps, stay as they are.
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.records import read_samples

UNITS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
PERIODS = [1.0 / 3000.0, 0.005, 0.02, 0.25, 1.0, 1.0 / 60.0, 7.5, 10.0, 60.0]


def read(time, unit, form):
    """Return the record of times (n,) in seconds, written in a unit and a format."""
    rows = "".join(f"{form % (t / UNITS[unit])},{k % 7}\n" for k, t in enumerate(time))
    path = Path("record.csv")
    path.write_text(f"time [{unit}],y [V]\n{rows}")
    return read_samples(path)


@pytest.fixture(scope="module", autouse=True)
def _in_a_folder(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("rounded"))
        yield


@given(
    unit=st.sampled_from(sorted(UNITS)),
    period=st.sampled_from(PERIODS),
    first=st.integers(0, 200),
    digits=st.integers(5, 9),
    decimals=st.booleans(),
    missing=st.sets(st.integers(2, 300), max_size=3),
)
def test_rounded_times_have_the_steps_of_their_clock(
    unit, period, first, digits, decimals, missing
):
    """Of significant digits or of decimals, where the last of them is fine beside a step."""
    places = np.array([k for k in range(first, first + 400) if k - first not in missing])
    last = places[-1] * period / UNITS[unit]
    resolution = 10.0**-digits if decimals else 10.0 ** (np.floor(np.log10(last)) + 1 - digits)
    record = read(places * period, unit, f"%.{digits}{'f' if decimals else 'g'}")
    steps = np.diff(record.time) / np.diff(places)
    if resolution * UNITS[unit] < 0.01 * period:
        assert steps == pytest.approx(period, rel=1e-9)
    assert np.abs(record.time - places * period).max() <= 1.01 * resolution * UNITS[unit]


def test_a_minute_of_seven_digits_is_noted_once():
    """From 10 min on the last digit is 0.6 ms, which the median step would be off by."""
    record = read(np.arange(3000.0), "min", "%.7g")
    assert np.array_equal(record.time, np.arange(3000.0))
    (note,) = (repair for repair in record.repairs if repair.kind == "rounded time")
    assert "column 'time' is rounded: its steps are taken as 1 s" in note.message


def test_a_clock_that_jitters_stays_as_it_is():
    """By more than its last digit."""
    rng = np.random.default_rng(1)
    time = np.arange(500.0) + rng.uniform(0.0, 0.01, 500)
    record = read(time, "min", "%.7f")
    assert record.time == pytest.approx(time, abs=6e-6)
    assert not [repair for repair in record.repairs if repair.kind == "rounded time"]


@pytest.mark.parametrize("time", [[0.0, 10.0, 21.0], [0.0, 1.0, 3.0, 4.0], [0.5, 0.7, 1.0]])
def test_times_as_coarse_as_their_steps_stay_as_they_are(time):
    assert read(time, "s", "%g").time.tolist() == time
