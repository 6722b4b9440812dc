"""Claims: nothing that keeps a run from being delayed outlives it."""

from __future__ import annotations

import gc
import os

import pytest

from orchestration.master.realtime_priority import realtime_priority


@pytest.mark.slow
def test_nothing_is_left_of_what_keeps_a_run_undisturbed():
    affinity = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    assert gc.isenabled()
    gc.unfreeze()  # what the suite has frozen for itself
    before = gc.get_freeze_count(), os.getpriority(os.PRIO_PROCESS, 0)
    with realtime_priority(processor=min(affinity or {0}), priority=True) as notes:
        assert not gc.isenabled()
        assert gc.get_freeze_count() > before[0]
        if affinity is not None:
            assert os.sched_getaffinity(0) == {min(affinity)}
        assert os.getpriority(os.PRIO_PROCESS, 0) == -10 or notes[-1].startswith(
            "a higher priority is not to be had"
        )
    assert gc.isenabled()
    assert (gc.get_freeze_count(), os.getpriority(os.PRIO_PROCESS, 0)) == before
    assert affinity is None or os.sched_getaffinity(0) == affinity
    gc.freeze()
