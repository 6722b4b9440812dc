"""Claims: features of causes are those that one computes of fits by hand, and make odds."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from orchestration.diagnosis.comparison import WEIGHTS
from orchestration.diagnosis.features import confidence, features_of
from orchestration.diagnosis.search import Ranked
from orchestration.diagnosis.terms import Memory, Shape, Term

_DRY = Term("friction", "speed", Shape.DRY)
_LINEAR = Term("friction", "speed", Shape.LINEAR)
_FADING = Term("torque", "current", Shape.LINEAR, Memory.FADING, (0.1,), "torque")


@dataclass(eq=False)
class _Fitted:
    """A fit as the features see it, with errors of a certain size."""

    terms: tuple[Term, ...]
    size: float
    words: float = 1.0

    @property
    def parts(self):
        """As the file is read as it is, its terms."""
        return self.terms

    def __post_init__(self):
        noise = np.random.default_rng(0).standard_normal((4000, 1))
        self.beyond = self.size * noise
        self.fit = SimpleNamespace(errors=(noise,), misfit=1.0)


def _gained(gain, worse=False):
    return SimpleNamespace(gain=gain, is_worse=worse)


def _cause(judged, score, gain):
    lead = judged.terms[0]
    return SimpleNamespace(
        law=lead.law, signal=lead.signal, parts=judged.terms, judged=judged,
        comparison=_gained(gain), score=score, members={lead.cause}, probability=0.4,
        is_effect=False,
    )  # fmt: skip


def _features(*others, more=(), temper=0.0, size=2.0):
    """Return the features of a first cause by two terms, which gains 100, beside others."""
    best = _Fitted((_FADING, _DRY), size)
    compared = [Ranked(best, _gained(100.0), 80.0), *others]
    found = SimpleNamespace(compared=lambda: compared, temper=temper)
    return features_of(found, [_cause(best, 80.0, 100.0), *more])


def test_words_and_rise_are_those_of_the_first_and_shares_are_added():
    values = _features()
    assert values["words"] == 1.0
    assert values["rise"] == pytest.approx(np.log(2.0) - 0.5, abs=0.05)
    assert _features(size=1.5)["rise"] == 0.0
    assert values["share"] == pytest.approx(0.4)
    assert _features(more=[_cause(_Fitted((_DRY,), 1.0), 5.0, 6.0)])["share"] == pytest.approx(0.8)


def test_the_margin_is_to_the_best_fit_that_is_not_worse_and_lacks_the_causes():
    assert _features()["margin"] == pytest.approx(0.8)  # to no term at all
    losing = Ranked(_Fitted((_DRY,), 1.0), _gained(1.0), -30.0)
    assert _features(losing)["margin"] == pytest.approx(0.8), "no term scores higher than that"
    assert _features(temper=20.0)["margin"] == pytest.approx(0.5), "what chance may give"
    worse = Ranked(_Fitted((_LINEAR,), 1.0), _gained(90.0, worse=True), 79.0)
    with_it = Ranked(_Fitted((_FADING, _LINEAR), 1.0), _gained(90.0), 75.0)
    other = Ranked(_Fitted((_DRY,), 1.0), _gained(70.0), 50.0)
    assert _features(worse, with_it, other)["margin"] == pytest.approx(0.3)
    second = _cause(other.judged, 50.0, 70.0)
    assert _features(worse, with_it, other, more=[second])["margin"] == pytest.approx(0.8)


def test_a_wide_margin_is_trusted_and_many_words_are_not():
    plain = {"margin": 0.0, "share": 0.5, "words": 0.0, "rise": 0.0}
    assert confidence(plain | {"margin": 0.9, "share": 0.9}) > 0.9
    assert confidence(plain) > confidence(plain | {"words": 2.0})
    assert confidence(plain) > confidence(plain | {"rise": 1.0})
    assert confidence(plain) > confidence(plain | {"share": 0.2})
    odds = WEIGHTS.confidence
    at = {"constant": 1.0, "margin": 0.5, "share": 0.7, "words": 1.5, "rise": 0.2}
    expected = 1.0 / (1.0 + np.exp(-sum(odds[n] * v for n, v in at.items())))
    del at["constant"]
    assert confidence(at) == pytest.approx(expected)
