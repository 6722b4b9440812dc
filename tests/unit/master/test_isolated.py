"""Claims: rows are recorded in memory, or in the folder of an isolated process, where a row that is
not whole does not count. (Whole runs: ``tests/unit/fmu/isolation/test_isolation.py``.)
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.fmu.isolation import SharedProgress, shared_progress
from orchestration.master.isolated import RowDescription, RowRecorder, _partial_run

ROWS = np.arange(12.0).reshape(4, 3)


@pytest.mark.parametrize("isolated", [False, True])
def test_rows_are_those_that_were_written(tmp_path, monkeypatch, isolated):
    if isolated:
        monkeypatch.setattr(shared_progress, "current", SharedProgress(tmp_path))
    recorder = RowRecorder()
    recorder.write(ROWS[0].data)
    recorder.write(ROWS[1:].data)
    assert recorder.array(4, 3).tolist() == ROWS.tolist()
    assert recorder.array(2, 3).tolist() == ROWS[:2].tolist()
    if isolated:
        recorder._file.close()


def test_what_is_left_of_a_run_are_its_whole_rows(tmp_path, monkeypatch):
    progress = SharedProgress(tmp_path)
    monkeypatch.setattr(shared_progress, "current", progress)
    recorder = RowRecorder()
    recorder.write(ROWS[:2].tobytes() + b"1234")  # the process ended in the middle of a row
    recorder._file.close()
    points = [0.0, 0.5, 1.0, 1.5]
    description = RowDescription(points, 3, {"a.y": 2, "a.x": 0}, {"a.y": "m", "a.x": "N"}, {})
    progress.describe_rows(description)
    run = _partial_run(progress, 0, "it ended")
    assert run.time.tolist() == [0.0, 0.5]
    assert {name: values.tolist() for name, values in run.signals.items()} == {
        "a.y": [2.0, 5.0],
        "a.x": [0.0, 3.0],
    }
    assert (run.complete, run.message, run.statistics.steps) == (False, "it ended", 1)


def test_of_a_run_that_had_not_begun_nothing_is_left(tmp_path):
    run = _partial_run(SharedProgress(tmp_path), 0, "it ended")
    assert (run.time.size, run.signals, run.complete) == (0, {}, False)
