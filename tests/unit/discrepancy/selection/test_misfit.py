"""Claims: misfit is the error over the spread, pooled over the outputs that vary."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection.misfit import (
    nominal_outputs,
    pooled,
    refitted_error,
    share_of_power,
)
from orchestration.discrepancy.selection.search import Search
from tests.support.gain import Gain

U = np.random.default_rng(9).standard_normal(800)


def search_over(y: np.ndarray) -> Search:
    return Search(Dataset(0.1 * np.arange(800), {"u": U}, {"y": y}), Gain, ["factor"])


def test_shares_are_of_the_variance_and_what_does_not_vary_has_none():
    y = np.array([1.0, -1.0, 1.0, -1.0])
    assert share_of_power(5.0 + 2.0 * y, y) == pytest.approx(0.25)
    assert np.isnan(share_of_power(np.ones(4), y))
    assert pooled([0.25, np.nan, 0.75]) == pytest.approx(np.sqrt(0.5))
    assert pooled([np.nan]) == 0.0


def test_the_error_after_a_refit_is_that_of_least_squares():
    """Oracle: a straight line through the origin, by the normal equation."""
    y = 3.0 * U + 0.5 * np.random.default_rng(10).standard_normal(800)
    error = y - U * (U @ y) / (U @ U)
    search = search_over(y)
    expected = np.sqrt(np.mean(error**2)) / np.std(y)
    assert refitted_error(search, search.data) == pytest.approx(expected, rel=1e-4)


def test_nominal_outputs_are_those_of_the_model_as_it_comes():
    assert nominal_outputs(search_over(U), search_over(U).data)["y"] == pytest.approx(U)
