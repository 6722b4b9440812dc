"""Claims: what leaves least to first order is fitted first, and what leaves far more is not fitted.

The oracle is a table of what each fit leaves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.discrepancy.laws.discovery import _fitted
from orchestration.discrepancy.laws.fitting import FittedEntry
from tests.support.law_reports import entry


class Fits:
    """Fits that leave so many times what an entry leaves to first order."""

    def __init__(self, worse):
        self.worse = worse
        self.tried = []
        self.waves = np.inf  # for which there is time

    def out_of_time(self):
        self.waves -= 1
        return self.waves < 0

    def first(self, one):
        self.tried.append(one.left)
        return FittedEntry(one, one.curve, self.worse * one.left, {"left": self.worse * one.left})

    def settled(self, one):
        return one

    def squares(self, residual):
        return float(np.sum(residual["y"] ** 2))


@pytest.fixture(autouse=True)
def residuals(monkeypatch):
    monkeypatch.setattr(
        FittedEntry, "residual", property(lambda one: {"y": np.sqrt([one.values["left"]])})
    )


LEFT = [50.0, 1.0, 3000.0, 2.0, 1.5, 40.0, 30.0, 1.1, 1.3, 60.0]


@pytest.mark.parametrize(("worse", "fitted"), [(1.0, 6), (100.0, 9), (1e6, 10)])
def test_entries_that_cannot_come_as_near_are_not_fitted(worse, fitted):
    """In waves of six, in the order of what they leave, up to 1.2 times what the best fit does."""
    fits = Fits(worse)
    entries = [replace(entry(), left=left) for left in LEFT]
    found = _fitted(fits, fits, entries, [])
    assert sorted(fits.tried) == sorted(LEFT)[:fitted]
    assert len(found) == fitted
    more = replace(entry(), left=1.21 * worse)
    assert len(_fitted(fits, fits, [more], found)) == len(found)


@pytest.mark.parametrize("waves", [0, 1])
def test_no_wave_begins_when_time_is_up(waves):
    fits = Fits(1e6)
    fits.waves = waves
    found = _fitted(fits, fits, [replace(entry(), left=left) for left in LEFT], [])
    assert sorted(fits.tried) == sorted(LEFT)[: 6 * waves]
    assert len(found) == 6 * waves
