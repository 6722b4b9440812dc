"""Claims: the features of a first cause are those that one computes of its fits by hand."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from orchestration.diagnosis.features import features_of
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
        self.choosing = self.size * noise
        self.fit = SimpleNamespace(errors=(noise,))


def _gained(gain, left_out=0.0, worse=False):
    return SimpleNamespace(gain=gain, left_out=left_out, is_worse=worse)


def _features(*others):
    """Return the features of a first cause by two terms, which gains 100, beside others."""
    best = _Fitted((_FADING, _DRY), 1.0, 4.0)
    compared = [(best, _gained(100.0, 59.0), 80.0), *others]
    found = SimpleNamespace(compared=lambda: compared, base=_Fitted((), 2.0))
    cause = SimpleNamespace(
        law="torque",
        signal="current",
        parts=best.terms,
        judged=best,
        comparison=compared[0][1],
        probability=0.8,
    )
    return features_of(found, SimpleNamespace(causes=(cause,)))


def test_what_is_of_the_best_fit_alone():
    values = _features()
    assert values["left_out_gain"] == pytest.approx(np.log(60.0))
    assert values["removed"] == pytest.approx(0.75)
    assert values["widths"] == pytest.approx(0.0, abs=0.05)
    assert values["independence"] == pytest.approx(0.0, abs=0.1)
    assert (values["terms"], values["words"], values["share"]) == (2.0, 4.0, 0.8)
    marks = [values[name] for name in ("memory", "rate", "time", "factor")]
    assert marks == [1.0, 1.0, 0.0, 1.0]


def test_the_margin_is_to_the_best_fit_that_is_not_worse_and_lacks_the_cause():
    assert _features()["margin"] == pytest.approx(0.8)  # to no term at all
    worse = _Fitted((_LINEAR,), 1.0), _gained(90.0, worse=True), 79.0
    with_it = _Fitted((_FADING, _LINEAR), 1.0), _gained(90.0), 75.0
    other = _Fitted((_DRY,), 1.0), _gained(70.0), 50.0
    assert _features(worse, with_it, other)["margin"] == pytest.approx(0.3)


def test_the_first_alone_is_what_fits_of_its_terms_gain():
    alone = _Fitted((_FADING,), 1.0), _gained(40.0), 30.0
    other = _Fitted((_DRY,), 1.0), _gained(70.0), 50.0
    assert _features(other)["alone"] == 0.0
    assert _features(alone, other)["alone"] == pytest.approx(0.4)


def test_correlated_errors_are_wider_than_the_noise_and_not_independent():
    slow = np.sin(np.linspace(0.0, 20.0, 4000))[:, None]
    best = _Fitted((_DRY,), 1.0)
    best.choosing = 0.1 * best.choosing + 2.0 * slow
    best.fit = SimpleNamespace(errors=(best.choosing,))
    found = SimpleNamespace(compared=lambda: [(best, _gained(5.0), 4.0)], base=_Fitted((), 2.0))
    cause = SimpleNamespace(
        law="friction", signal="speed", parts=best.terms, judged=best, comparison=_gained(5.0),
        probability=0.5,
    )  # fmt: skip
    values = features_of(found, SimpleNamespace(causes=(cause,)))
    assert values["widths"] == pytest.approx(np.log(np.sqrt(2.01) / 0.1), abs=0.1)
    assert values["independence"] < -4.0


def test_there_are_none_without_a_cause():
    assert features_of(SimpleNamespace(), SimpleNamespace(causes=())) == {}
