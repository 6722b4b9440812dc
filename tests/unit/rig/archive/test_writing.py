"""A writer stays within its size and knows what its run has written."""

from __future__ import annotations

import math

import numpy as np

from orchestration.rig.archive import Archive
from tests.support.rig.archived import AHEAD, filled, samples, writer


def test_the_oldest_files_are_removed_beyond_the_size_and_the_newest_row_is_there(tmp_path):
    archive = writer(tmp_path, size=1e6)
    last = 0
    for _ in range(120):
        archive.add("samples", samples(range(last + 1, last + 1001)), AHEAD)
        last += 1000
        assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 1e6
    numbers = Archive(tmp_path).rows("samples", -math.inf, math.inf)["number"].to_numpy()
    assert numbers[0] > 1
    np.testing.assert_array_equal(numbers, np.arange(numbers[0], last + 1))


def test_a_run_that_goes_on_knows_its_last_row(tmp_path):
    filled(tmp_path, samples(range(1, 11)))
    assert writer(tmp_path).last == {"samples": 10, "commands": 0, "events": 0}
    assert writer(tmp_path, run="0c0c").last["samples"] == 0
