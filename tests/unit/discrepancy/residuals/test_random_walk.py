"""Whether a residual wanders beneath its noise."""

from __future__ import annotations

import numpy as np
import pytest

from demonstrations.records import draw
from fmus.ppy_actuator.model import PpyActuator
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import searched_parameters
from orchestration.discrepancy.residuals.random_walk import random_walk_test
from orchestration.discrepancy.selection.search import Search
from tests.support.pace import slow_but
from tests.support.residuals import COLOURS, N, noise


@pytest.mark.parametrize("colour", slow_but([0.0, 0.5, 0.9, 0.95], 0.0, 0.95))
def test_noise_does_not_wander(colour):
    assert not any(random_walk_test(noise(colour, seed)).significant for seed in range(300))


@COLOURS
def test_a_walk_beneath_noise_is_found_and_followed(colour):
    walk = np.cumsum(np.random.default_rng(8).standard_normal(N)) * 0.15 / (1.0 - colour)
    walk -= walk.mean()
    test = random_walk_test(noise(colour, 1) + walk)
    assert test.significant
    assert test.rms == pytest.approx(walk.std(), rel=0.2)
    assert np.corrcoef(test.trend, walk)[0, 1] > 0.95


def test_nothing_is_said_of_too_little():
    for residual in (np.zeros(500), np.empty(0), np.ones(20)):
        assert random_walk_test(residual).ratio == 0.0


@pytest.mark.slow
@COLOURS
def test_restless_air_is_slow_and_a_clean_bench_is_not(colour):
    for hidden, wanders in ((None, False), ("restless_air", True)):
        drawn = draw(hidden, 1, noise_colour=colour, duration=300.0, rate=5.0)
        data = Dataset(drawn.time, drawn.inputs, drawn.outputs)
        residual = (
            Search(data, PpyActuator, searched_parameters(PpyActuator)).nominal().fit.residual
        )
        assert random_walk_test(residual["displacement"]).significant is wanders
        assert not random_walk_test(residual["voltage"]).significant
