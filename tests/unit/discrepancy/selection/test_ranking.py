"""In which order effects come: by how near their simulations are, and not by what a noise model
makes of the rest.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit.functions import cos
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection import ranking
from orchestration.discrepancy.selection.ranking import ranked
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.discrepancy.selection.stepwise import select, whitens_residual
from orchestration.identify.noise.model import estimate_noise
from tests.support.regression_model import COUNT, GAIN, SPREAD, STEP, Amplifier, shaped


def slow(s):
    return s * s - 1.5


def quick(s):
    return cos(40.0 * s)


NEAR, FAR = shaped("near", slow), shaped("far", quick)


def two_parts(seed, quick_part=0.6, count=COUNT):
    """A signal that goes to and fro a few times; what is hidden has a slow part and a lesser quick
    one.
    """
    random = np.random.default_rng(seed)
    signal = 1.7 * np.sin(2.0 * np.pi * np.arange(count) / 180.0)
    hidden = slow(signal) + quick_part * quick(signal)
    shown = GAIN * signal + hidden + SPREAD * random.standard_normal(count)
    return Dataset(STEP * np.arange(count), {"signal": signal}, {"shown": shown})


@pytest.mark.parametrize("seed", [1, 2])
def test_the_nearer_simulation_comes_first_though_a_colour_whitens_what_the_other_leaves(seed):
    """An autoregression predicts the slow part, so that what simulates the quick one has the
    smaller innovations.
    """
    data = two_parts(seed)
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    scored = score(search, base, [NEAR, FAR])
    found = ranked(search, base, [scored], [NEAR, FAR])
    own = {f.effect: search.fit_from(f.candidate, f) for f, _ in found.rows}
    assert own[FAR].fit.bic < own[NEAR].fit.bic  # otherwise this record shows nothing
    assert [f.effect for f, _ in found.rows] == [NEAR, FAR]
    columns = {NEAR: slow, FAR: quick}
    by_regression = {
        e: np.linalg.lstsq(
            np.column_stack([data.inputs["signal"], shape(data.inputs["signal"])]),
            data.measured["shown"],
        )[1][0]
        for e, shape in columns.items()
    }
    assert by_regression[NEAR] < by_regression[FAR]


def test_all_are_held_against_each_other_in_one_noise():
    data = two_parts(3)
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    (first, _), (second, _) = ranked(
        search, base, [score(search, base, [NEAR, FAR])], [NEAR, FAR]
    ).rows
    assert first.fit.noise["shown"].coefficients == pytest.approx(
        second.fit.noise["shown"].coefficients
    )
    assert first.fit.noise["shown"].deviation < second.fit.noise["shown"].deviation


@pytest.mark.parametrize(("share", "named"), [(0.05, ["near"]), (0.25, ["near", "far"])])
def test_a_second_cause_takes_away_a_tenth_of_what_was_wrong(share, named):
    """However much evidence there is for less: a form that is not quite right leaves as much."""
    data = two_parts(4, 0.0)
    signal = data.inputs["signal"]
    of = np.column_stack([signal, slow(signal)])
    across = quick(signal) - of @ np.linalg.lstsq(of, quick(signal))[0]
    alone = slow(signal) - signal * (signal @ slow(signal)) / (signal @ signal)
    size = np.sqrt(share / (1.0 - share) * np.mean(alone**2) / np.mean(across**2))
    shown = data.measured["shown"] + size * across
    assert size * np.std(across) > 2.0 * SPREAD  # there is evidence for it
    search = Search(Dataset(data.time, data.inputs, {"shown": shown}), Amplifier, ["gain"])
    selection = select(search, [NEAR, FAR])
    assert [step.chosen.effect_name for step in selection.steps] == named
    assert selection.unsure == ({"far"} - {*named})


@pytest.mark.parametrize(("quick_part", "fitted"), [(0.6, {NEAR, FAR}), (0.0, {NEAR})])
def test_all_are_fitted_where_the_promising_leave_structure(monkeypatch, quick_part, fitted):
    monkeypatch.setattr(ranking, "PROMISING", 1)
    data = two_parts(8, quick_part)
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    found = ranked(search, base, [score(search, base, [NEAR, FAR])], [NEAR, FAR])
    assert {f.effect for f, _ in found.rows} == fitted


def left_by_a_model(residual):
    """What a fitted model is asked for here: its residual, and the noise that is estimated from
    it.
    """
    every = np.ones(residual.size, dtype=bool)
    noise = estimate_noise(residual, every)
    fit = SimpleNamespace(
        residual={"y": residual},
        noise={"y": noise},
        innovation={"y": noise.whiten(residual, every)},
    )
    return SimpleNamespace(fit=fit)


@pytest.mark.parametrize("count", [300, 1000, 4000])
def test_a_random_walk_keeps_its_memory_whatever_is_simulated(count):
    """An offset, a drift and two waves are taken away from it: an autoregression might be let off
    for none.
    """
    time = np.linspace(0.0, 1.0, count)
    waves = [f(2.0 * np.pi * time) for f in (np.cos, np.sin)]
    seen = []
    for seed in range(40):
        walk = np.cumsum(np.random.default_rng(seed).standard_normal(count))
        for table in (
            np.column_stack([np.ones(count), time]),
            np.column_stack([np.ones(count), time, *waves]),
        ):
            left = walk - table @ np.linalg.lstsq(table, walk)[0]
            seen.append(whitens_residual(left_by_a_model(walk), left_by_a_model(left)))
    assert np.mean(seen) < 0.05


def test_a_slow_error_that_is_simulated_leaves_no_memory_where_an_autoregression_followed_it():
    random, time = np.random.default_rng(1), np.linspace(0.0, 1.0, 1000)
    error, noise = 1.0 - np.exp(-time / 0.4), 0.02 * random.standard_normal(1000)
    straight = np.column_stack([np.ones(1000), time, time**2])
    form = straight @ np.linalg.lstsq(straight, error)[0]
    before, after = left_by_a_model(error + noise), left_by_a_model(error - form + noise)
    assert whitens_residual(before, after)
    assert not whitens_residual(after, before)
    assert not whitens_residual(before, before)
