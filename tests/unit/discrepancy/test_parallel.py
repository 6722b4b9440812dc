"""Claims: items are worked on at the same time, results keep their order, and parts are counted."""

from __future__ import annotations

from threading import Barrier

import pytest

from orchestration.discrepancy.parallel import Counter, parallel_map


class Progress:
    """A callable that is told the step, and how many of its parts are done."""

    def __init__(self):
        self.steps = []
        self.parts = []

    def __call__(self, text):
        self.steps.append(text)

    def done(self, part, whole):
        self.parts.append((part, whole))


def test_results_are_in_the_order_of_the_items():
    assert parallel_map(lambda x: x * x, range(100)) == [x * x for x in range(100)]
    assert parallel_map(str, []) == []


def test_several_items_are_worked_on_at_once(monkeypatch):
    """Neither of two gets past the barrier alone."""
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    barrier = Barrier(2, timeout=30.0)
    assert sorted(parallel_map(lambda _: barrier.wait(), range(2))) == [0, 1]


def test_a_failure_is_raised():
    with pytest.raises(ZeroDivisionError):
        parallel_map(lambda x: 1 / x, [1, 0, 2])


def test_every_part_is_counted_once():
    progress = Progress()
    counter = Counter(progress, "fitting", 40)
    parallel_map(lambda _: counter.one_more(), range(40))
    assert progress.steps == ["fitting"]
    assert progress.parts == [(k, 40) for k in range(1, 41)]


def test_a_progress_that_counts_nothing_is_told_the_step():
    steps = []
    counter = Counter(steps.append, "fitting", 2)
    counter.one_more()
    assert steps == ["fitting"]
