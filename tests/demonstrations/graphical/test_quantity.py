"""Claims: the interval of repeated measurements is Student's, as SciPy has it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import sem, t

from demonstrations.graphical.quantity import mean, quantity

VALUES = [2.1, 1.9, 2.4, 2.0]


def test_a_mean_has_the_interval_of_scipy():
    found = mean(VALUES, "ohm")
    assert found.value == pytest.approx(2.1)
    assert found.interval == pytest.approx(t.interval(0.95, 3, np.mean(VALUES), sem(VALUES)))
    assert str(found) == "2.1 ohm (95 % interval 1.756 to 2.444)"


def test_what_was_measured_once_has_no_interval():
    for once in (mean([2.1], "V"), quantity(2.1, 0.3, 1, "V")):
        assert once.interval == (-np.inf, np.inf)


def test_of_many_repetitions_it_is_nearly_that_of_a_normal_distribution():
    assert quantity(0.0, 1.0, 10_000, "1").interval == pytest.approx((-1.96, 1.96), abs=1e-3)
