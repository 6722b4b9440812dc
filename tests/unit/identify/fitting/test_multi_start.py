"""Claims: searches begin at several points where a deeper minimum may exist, and only there.

Oracle: a sine, whose frequency is known.
"""

import numpy as np
import pytest

from orchestration.identify.fitting import FitData
from tests.support.linear_fits import Decay, Wave, columns, fitted, noisy, plane_data


def test_more_starts_find_the_deepest_valley():
    time = np.linspace(0.0, 20.0, 200)
    data = [FitData(time, {"t": time}, {"y": np.sin(3.0 * time)})]
    start = {"w": 1.0}
    one = fitted(data, ["w"], Wave, start, starts=1)
    several = fitted(data, ["w"], Wave, start, starts=None)
    assert one.values["w"] != pytest.approx(3.0, rel=0.1)
    assert several.values["w"] == pytest.approx(3.0, rel=1e-6)
    assert several.searches > 1
    assert "several minima" in several.warnings[0]


def test_a_residual_that_is_white_ends_the_searches():
    x = columns(400)
    fit = fitted([plane_data(x, noisy(x, [2.0, -1.0, 0.5]))], starts=None)
    assert fit.searches == 1


def test_a_residual_of_the_solver_ends_the_searches():
    time = np.linspace(0.0, 3.0, 300)
    data = [FitData(time, {}, {"y": np.exp(-0.7 * time)})]
    assert fitted(data, ["rate"], Decay, starts=None).searches == 1
