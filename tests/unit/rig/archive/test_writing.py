"""A writer stays within its size and knows what its run has written."""

from __future__ import annotations

import math
import shutil

import numpy as np

from orchestration.rig.archive import Archive
from tests.support.rig.archived import AHEAD, filled, samples, writer


def test_rows_that_were_written_twice_are_read_once(tmp_path):
    filled(tmp_path, samples(range(1, 11))).close()
    filled(tmp_path, samples(range(6, 21))).close()
    numbers = Archive(tmp_path).rows("samples", -math.inf, math.inf)["number"].to_pylist()
    assert numbers == list(range(1, 21))
    assert Archive(tmp_path).gaps() == []


def test_the_oldest_files_are_removed_beyond_the_size_and_the_newest_row_is_there(tmp_path):
    archive = writer(tmp_path, size=1e6)
    last = 0
    for _ in range(60):
        archive.add("samples", samples(range(last + 1, last + 1001)), AHEAD)
        last += 1000
        assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 1e6
    archive.close()
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 1e6
    numbers = Archive(tmp_path).rows("samples", -math.inf, math.inf)["number"].to_numpy()
    assert numbers[0] > 1
    np.testing.assert_array_equal(numbers, np.arange(numbers[0], last + 1))


def test_a_run_that_goes_on_knows_its_last_row(tmp_path):
    before = tmp_path / "before"
    before.mkdir()
    killed = filled(before, samples(range(1, 11)))
    shutil.copytree(before, tmp_path / "after")
    killed.close()
    again = writer(tmp_path / "after")
    assert (again.last("samples"), again.last("commands")) == (10, 0)
    assert writer(tmp_path / "after", run="0c0c").last("samples") == 0
