"""Chunks: every case is handed out once, in chunks that grow towards the time they should take."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestration.fmu.simulation import FmuSource
from orchestration.sweeps.chunking import LARGEST, SECONDS, Chunks
from orchestration.sweeps.task import Task


def task(points: int = 10) -> Task:
    return Task(
        FmuSource(Path("x.fmu")), ("a",), {}, np.arange(float(points)), {}, ("y",), ("last",)
    )


def handed_out(chunks: Chunks, seconds_a_case: float) -> list[list[int]]:
    every = []
    while chunks:
        rows = chunks.next()
        every.append(rows)
        chunks.adapt(len(rows), seconds_a_case * len(rows))
    return every


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("seconds", [0.0, 1e-4, 1.0])
def test_every_case_is_handed_out_once_and_in_order(count, seconds):
    which = [5, 3, *range(10, 3000)]
    chunks = handed_out(Chunks(task(), which, count), seconds)
    assert [row for chunk in chunks for row in chunk] == which


def test_chunks_grow_fourfold_until_they_take_their_time():
    sizes = [len(chunk) for chunk in handed_out(Chunks(task(), range(100_000)), SECONDS / 100)]
    assert sizes[:5] == [1, 4, 16, 64, 100]
    assert max(sizes) == 100


def test_cases_that_take_long_are_handed_out_one_by_one():
    sizes = {len(chunk) for chunk in handed_out(Chunks(task(), range(20)), 1.0)}
    assert sizes == {1}


def test_a_chunk_has_a_largest_number_of_cases_and_of_bytes():
    sizes = [len(chunk) for chunk in handed_out(Chunks(task(), range(20_000)), 0.0)]
    assert max(sizes) == LARGEST
    points = 16_000_000 // 8 // 3  # three traces fit
    sizes = [len(chunk) for chunk in handed_out(Chunks(task(points), range(100)), 0.0)]
    assert max(sizes) == 3


def test_no_worker_gets_more_than_its_share():
    chunks = Chunks(task(), range(1000), 4)
    for _ in range(10):
        chunks.adapt(1000, 0.0)  # as if cases took no time
    assert len(chunks.next()) == 125  # half of a quarter
