"""Reductions of traces: the same bits, whatever other cases they are made with."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.sweeps.reductions import REDUCTIONS, reduce_traces


@pytest.mark.parametrize("outputs", [1, 2, 9])
@pytest.mark.parametrize("points", [1, 2, 51, 5001])
def test_a_case_is_reduced_to_the_same_bits_whatever_it_is_told_with(points, outputs):
    courses = np.random.default_rng(points).normal(1.0, 1.0, (17, points, outputs))
    together = reduce_traces(courses, [*REDUCTIONS])
    for k in range(17):
        assert (
            reduce_traces(courses[k : k + 1], [*REDUCTIONS])[0].tobytes() == together[k].tobytes()
        )
