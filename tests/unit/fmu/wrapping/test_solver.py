"""Claims: an FMU for model exchange alone is integrated with its events. Oracle: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.fmu.simulation import FmuSource, RepeatedFmu
from tests.support.fmi3_fmus import foreign, of_interface


def test_events_of_model_exchange_are_found(tmp_path):
    """A sawtooth, which falls at time events: its values and its count on paper."""
    path = of_interface(foreign("sawtooth"), "ModelExchange", tmp_path)
    time = 0.07 * np.arange(20)
    with RepeatedFmu(path) as fmu:
        found = fmu.run(time, {}, {"slope": 2.0}, ["x", "count"])
    assert found[:, 0] == pytest.approx(2.0 * (time % 0.3), abs=1e-5)
    assert found[:, 1].tolist() == (time // 0.3).tolist()


def test_robertsons_problem_is_solved_over_eleven_decades(tmp_path):
    """Oracle: the test set for initial value problems (F. Mazzia, C. Magherini), problem ROBER."""
    path = of_interface(foreign("roberts"), "ModelExchange", tmp_path)
    start, stop, step = FmuSource(path).default_experiment
    with RepeatedFmu(path) as fmu:
        found = fmu.run(np.arange(start, stop + step, step), {}, {}, ["y[1]", "y[2]", "y[3]"])
    expected = [0.2083340149701255e-7, 0.8333360770334713e-13, 0.9999999791665050]
    assert found[-1] == pytest.approx(expected, rel=1e-4)
