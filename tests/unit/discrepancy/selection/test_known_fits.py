"""No fit is made twice, and each that differs in anything is a fit of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection import known_fits, search
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.fitting import FIXED_COLOUR
from tests.support.regression_model import COUNT, GAIN, SPREAD, STEP, Amplifier


def record(seed=1):
    random = np.random.default_rng(seed)
    signal = random.standard_normal(COUNT)
    shown = GAIN * signal + SPREAD * random.standard_normal(COUNT)
    return Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": shown})


@pytest.fixture
def fits(monkeypatch):
    """Every fit that is made, and its method."""
    made = []
    original = search.fit_prediction_error

    def noted(problem, q, noise, has_prior, std, method, **limits):
        made.append(method)
        return original(problem, q, noise, has_prior, std, method, **limits)

    monkeypatch.setattr(search, "fit_prediction_error", noted)
    return made


def test_a_fit_from_the_same_place_is_made_once(fits):
    begun = Search(record(), Amplifier, ["gain"])
    base = begun.nominal()
    first = begun.fit_from(base.candidate, base)
    made = len(fits)
    assert begun.fit_from(base.candidate, base).fit is first.fit
    assert replace(begun, patience=2.0).fit_from(base.candidate, base).fit is first.fit
    assert len(fits) == made


def test_a_fit_in_other_noise_from_elsewhere_or_of_other_data_is_another(fits):
    begun = Search(record(), Amplifier, ["gain"])
    base = begun.nominal()
    begun.fit_from(base.candidate, base)
    made = len(fits)
    other = Search(record(2), Amplifier, ["gain"], known=begun.known)
    for changed in (
        begun.in_white_noise(),
        replace(begun, colour={"shown": np.array([0.5])}),
        replace(begun, freedom={"shown": 4.0}),
        replace(begun, method=FIXED_COLOUR),
        replace(begun, farthest=1e9),
        other,
    ):
        changed.fit_from(base.candidate, base)
    begun.fit_from(base.candidate, base, {"gain": 1.1 * GAIN})
    assert len(fits) == made + 7


def test_a_fit_that_time_has_ended_is_none_that_is_known(fits):
    begun = Search(record(), Amplifier, ["gain"])
    base = begun.nominal()
    late = replace(begun, budget=Budget(0.0))
    late.fit_from(base.candidate, base)
    made = len(fits)
    begun.fit_from(base.candidate, base)
    assert len(fits) == made + 1


def test_the_latest_fits_are_kept_as_far_as_memory_allows(monkeypatch, fits):
    monkeypatch.setattr(known_fits, "_KEPT", 2 * 4 * COUNT)
    begun = Search(record(), Amplifier, ["gain"])
    base = begun.nominal()
    starts = [{"gain": factor * GAIN} for factor in (1.1, 1.2, 1.3)]
    for start in starts:
        begun.fit_from(base.candidate, base, start)
    made = len(fits)
    begun.fit_from(base.candidate, base, starts[2])
    begun.fit_from(base.candidate, base, starts[1])
    assert len(fits) == made
    begun.fit_from(base.candidate, base, starts[0])
    assert len(fits) == made + 1
