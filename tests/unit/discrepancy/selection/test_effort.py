"""Which effects are fitted, to what end, and that none is fitted twice; oracle: regression, which
tells what share of the best gain each effect has.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from orchestration.discrepancy.budget import Budget
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.selection import known_fits, search
from orchestration.discrepancy.selection.ranking import ranked
from orchestration.discrepancy.selection.scoring import score
from orchestration.discrepancy.selection.search import Search
from orchestration.identify.fitting import FIXED_COLOUR
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


def test_a_contender_is_made_sure_of_that_gains_half_of_the_best(wanted):
    shares = ranked_beside([0.42, 0.60])
    assert shares["other0"] < 0.47
    assert shares["other1"] > 0.53
    # once in white noise, and once in that of the nearest
    assert fitted(wanted, FIXED_COLOUR) == {"right", "other0", "other1"}
    assert fitted(wanted, FIXED_COLOUR, times=2) == {"right", "other1"}


def test_the_nearest_three_are_fitted_from_beside_their_optima(monkeypatch):
    refined = []
    monkeypatch.setattr(
        Search, "refine", lambda self, fitted: refined.append(fitted.effect_name) or fitted
    )
    ranked_beside([0.9, 0.7, 0.8, 0.6])
    assert sorted(refined) == ["other0", "other2", "right"]


# --- no fit is made twice
# --------------------------------------------------------------------------------------------------


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
