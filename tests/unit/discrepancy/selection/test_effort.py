"""Which effects are fitted, and to what end; oracle: regression, which tells what share of the best
gain each effect has.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fmus.kit import Parameter
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection import ranking
from orchestration.discrepancy.selection.ranking import ranked
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.fitting import FIXED_COLOUR, FULL, SCREEN
from tests.support.regression_model import GAIN, SPREAD, STEP, Amplifier, shaped

COUNT = 6000


def hidden_shape(s):
    return (s * s - 1.0) / np.sqrt(2.0)


def across(s):
    return (s * s * s * s - 6.0 * s * s + 3.0) / np.sqrt(24.0)


def mixed(name, share):
    """An effect that gains about a share of what the hidden one does."""

    def shape(s):
        return np.sqrt(share) * hidden_shape(s) + np.sqrt(1.0 - share) * across(s)

    effect = shaped(name, shape)
    return effect, shape


def record(seed=1):
    random = np.random.default_rng(seed)
    signal = random.standard_normal(COUNT)
    shown = GAIN * signal + SPREAD * (0.25 * hidden_shape(signal) + random.standard_normal(COUNT))
    return Dataset(STEP * np.arange(COUNT), {"signal": signal}, {"shown": shown})


def gained(data, shape):
    """The fall of the sum of squares over the variance, by regression."""
    signal, shown = data.inputs["signal"], data.measured["shown"]
    columns = [signal, shape(signal)]
    left = [np.linalg.lstsq(np.column_stack(c), shown)[1][0] for c in (columns[:1], columns)]
    return COUNT * np.log(left[0] / left[1])


@pytest.fixture
def wanted(monkeypatch):
    """Effects and methods of every fit that a ranking wants, known or not."""
    seen = []

    def noted(name, effects_of):
        original = getattr(Search, name)

        def noting(self, first, *others):
            seen.extend((effect.id, self.method) for effect in effects_of(first))
            return original(self, first, *others)

        monkeypatch.setattr(Search, name, noting)

    noted("fit_from", lambda candidate: candidate.effects)
    noted("fit_extended", lambda screened: [screened.effect])
    return seen


def ranked_beside(shares):
    """Rank the right effect and others with these shares of its gain; return their shares, too."""
    data = record()
    shapes = {"right": hidden_shape}
    effects = [shaped("right", hidden_shape)]
    for k, share in enumerate(shares):
        effect, shape = mixed(f"other{k}", share)
        effects.append(effect)
        shapes[effect.id] = shape
    gains = {name: gained(data, shape) for name, shape in shapes.items()}
    begun = Search(data, Amplifier, ["gain"])
    base = begun.nominal()
    ranked(begun, base, [score(begun, base, effects)], effects)
    return {name: gain / gains["right"] for name, gain in gains.items()}


def fitted(wanted, method=None, times=1):
    """Return the effects that are to be fitted so often, or more often."""
    often = Counter(name for name, used in wanted if method in (None, used))
    return {name for name, count in often.items() if count >= times}


def test_an_effect_is_fitted_if_it_promises_a_sixth_of_the_best(wanted):
    shares = ranked_beside([0.10, 0.21])
    assert shares["other0"] < 0.13
    assert 0.17 < shares["other1"] < 0.24
    assert fitted(wanted) == {"right", "other1"}


def test_an_effect_is_fitted_from_every_start_that_promises_half_of_its_best(monkeypatch):
    tried = []
    monkeypatch.setattr(
        ranking, "_tried", lambda plain, below, start: tried.append(start.predicted.beyond)
    )
    effect = shaped("right", hidden_shape)
    starts = [SimpleNamespace(predicted=SimpleNamespace(beyond=b)) for b in (100.0, 55.0, 45.0)]
    ranking._screened(Search(record(), Amplifier, ["gain"]), None, {effect: starts})
    assert tried == [100.0, 55.0]


def test_a_contender_is_made_sure_of_that_gains_half_of_the_best(wanted):
    shares = ranked_beside([0.42, 0.60])
    assert shares["other0"] < 0.47
    assert shares["other1"] > 0.53
    # in white noise to the end, and in that of the nearest
    assert fitted(wanted, FIXED_COLOUR) == {"right", "other1"}
    assert fitted(wanted, FIXED_COLOUR, times=2) == {"right", "other1"}


class Course:
    """A fit that falls by so much in every stage, until it has converged."""

    def __init__(self, falls, bic=0.0):
        self._falls = falls
        self.fit = SimpleNamespace(bic=bic, converged=not falls)

    def on(self):
        first, *others = self._falls
        return Course(others, self.fit.bic - first)


def stages(monkeypatch, *courses, gained=50.0):
    """Fit on along courses that begin where so much is gained; return how many stages each took."""
    taken = Counter()
    mine = [Course(falls, -gained) for falls in courses]
    number = {id(course): k for k, course in enumerate(mine)}

    def again(search, course):
        if search.method is FIXED_COLOUR:
            return course
        after = course.on()
        number[id(after)] = number[id(course)]
        alive.append(after)
        taken[number[id(after)]] += 1
        return after

    alive = []
    monkeypatch.setattr(ranking, "_again", again)
    monkeypatch.setattr(ranking, "parallel_map", lambda work, items: [work(i) for i in items])
    below = Course([])
    ranking._ended(Search(record(), Amplifier, ["gain"]), below, mine, below)
    return [taken[k] for k in range(len(mine))]


def test_a_fit_ends_that_can_be_no_contender(monkeypatch):
    """The best gains 1000, a contender half of that."""
    best = [500.0, 450.0]
    slow = [80.0] * 6  # after two stages 210, and 400 more at that pace: it may come to 500
    hopeless = [60.0] * 6  # 170, and 300 more
    assert stages(monkeypatch, best, slow, hopeless) == [2, 6, 2]


def test_a_fit_ends_that_gains_nothing(monkeypatch):
    creeping = [900.0, 0.6, 0.4, 0.3, 0.3]
    assert stages(monkeypatch, creeping) == [3]


@pytest.mark.parametrize(("behind", "ended"), [(5.0, False), (7.0, True)])
def test_a_fit_from_beside_ends_that_stays_behind_after_its_first_steps(monkeypatch, behind, ended):
    data = record()
    effect = shaped("right", hidden_shape)
    wide = type("Wide", (effect,), {"right_width": Parameter(1.0, "1", min=0.1, max=9.0)})
    search = Search(data, Amplifier, ["gain"])
    base = search.nominal()
    best = search.fit_from(base.candidate.with_effect(wide), base)
    methods = []

    def scripted(self, candidate, around, start=None):
        methods.append(self.method)
        return replace(best, fit=replace(best.fit, deviance=best.fit.deviance + behind))

    monkeypatch.setattr(Search, "fit_from", scripted)
    search.refine(best)
    assert methods == ([SCREEN] if ended else [SCREEN, FULL]) * 2


def test_the_nearest_three_are_fitted_from_beside_their_optima(monkeypatch):
    refined = []
    monkeypatch.setattr(
        Search, "refine", lambda self, fitted: refined.append(fitted.effect_name) or fitted
    )
    ranked_beside([0.9, 0.7, 0.8, 0.6])
    assert sorted(refined) == ["other0", "other2", "right"]
