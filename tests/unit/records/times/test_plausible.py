"""Claims: numbers that are dates in days or parts of a second are known by size and step; such
as somebody chose for seconds are none.
"""

import numpy as np
import pytest

from orchestration.records.times.plausible import unit_of_dates

DAY = 86400.0


@pytest.mark.parametrize(
    ("first", "step", "unit"),
    [
        (1.7e12, 100.0, "ms"),
        (1.7e15, 1e5, "us"),
        (1.7e18, 1e8, "ns"),
        (45000.0, 1.0 / DAY, "d"),
        (45000.0, 3600.0 / DAY, "d"),
        (738000.5, 0.1 / DAY, "d"),
        (45000.0, 0.01, None),
        (45000.0, 1.0, None),
        (1.7e9, 1.0, None),
        (0.0, 1.0 / DAY, None),
        (1e12, 1.0, "ms"),
    ],
)
def test_the_unit_of_dates_is_told_by_size_and_step(first, step, unit):
    assert unit_of_dates(first + step * np.arange(50)) == unit


def test_nothing_is_told_by_nothing():
    assert unit_of_dates(np.array([])) is None
    assert unit_of_dates(np.array([np.nan])) is None
