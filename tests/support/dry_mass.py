"""Records of a mass drawn by SciPy: with dry friction, a law outside, and with nothing wrong."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fmus.kit.arrays import Array
from orchestration.diagnosis import Record
from orchestration.diagnosis.conclude import Conclusion, conclude
from orchestration.diagnosis.search import Found, search
from orchestration.diagnosis.subject import subject_of
from tests.support.diagnosed_mass import D, K, M, integrated, mass, pushed

NOISE = 0.001
AT_REST = np.array([0.02, 0.0])  # as is declared, or more than the addition would be wrong
Addition = Callable[[Array, float, float], float]


def dry(x: Array, u: float, t: float) -> float:
    """Coulomb friction of 2 N."""
    return 2.0 * np.tanh(x[1] / 0.02)


def outside(x: Array, u: float, t: float) -> float:
    """A push in bursts that no term is."""
    return 2.5 * np.sign(np.sin(0.9 * t * t)) * (t % 3.0 < 1.5)


def nothing(x: Array, u: float, t: float) -> float:
    """Nothing wrong."""
    return 0.0


def drawn(addition: Addition, count: int = 300, seed: int = 0) -> Record:
    """Return a record of the mass with an addition to its forces, N."""
    record = pushed(count, 0.04)

    def rates(x: Array, u: float, t: float) -> list[float]:
        return [x[1], (u - K * x[0] - D * x[1] - addition(x, u, t)) / M]

    states = integrated(record, rates, AT_REST, 1e-5)
    noise = NOISE * np.random.default_rng(seed).standard_normal((count, 1))
    return replace(record, outputs=states[:, :1] + noise)


@cache
def searched(addition: Addition) -> tuple[Found, Conclusion]:
    """Return search and conclusion of a record."""
    subject = subject_of(mass(), [drawn(addition)])
    assert subject is not None
    found = search(subject)
    assert found is not None
    return found, conclude(found)


def small_search(monkeypatch: pytest.MonkeyPatch, addition: Addition, count: int = 240) -> Found:
    """Return a search along the free run alone, of few sets."""
    names = sys.modules[Found.__module__]
    monkeypatch.setattr(names, "_PIECES", ())
    monkeypatch.setattr(names, "_QUOTAS", {1: {1: 3, 2: 1}})
    monkeypatch.setattr(names, "_SECOND", {1: 1})
    monkeypatch.setattr(names, "_BEST", 1)
    return _small(addition, count)


@cache
def _small(addition: Addition, count: int) -> Found:
    subject = subject_of(mass(), [drawn(addition, count)])
    assert subject is not None
    found = search(subject)
    assert found is not None
    return found
