"""Claims: outputs by another clock, or ahead, are told with rate and lead; what is late is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Verdict, diagnose
from orchestration.discrepancy.note import MIXED_UP, NoteCode
from orchestration.discrepancy.report import wording
from orchestration.discrepancy.selection.output_clock import by_another_clock, output_clocks
from orchestration.discrepancy.selection.search import Search
from tests.support.wired_motor import FRICTION, STEP, Motor, wired


def read_at(data: Dataset, time: np.ndarray) -> Dataset:
    """Return data with what was shown at other times."""
    return replace(data, measured={"shown": np.interp(time, data.time, data.measured["shown"])})


@pytest.mark.parametrize("rate", [0.96, 1.03])
def test_a_clock_that_goes_otherwise_is_told(rate):
    data = wired()
    diagnosis = diagnose(Motor, read_at(data, data.time / rate), [FRICTION])
    (note,) = [note for note in diagnosis.notes if note.code in MIXED_UP]
    assert note.code is NoteCode.OTHER_CLOCK
    assert note.facts["rate"] == pytest.approx(rate - 1.0, abs=0.0015)
    assert diagnosis.verdict is Verdict.UNEXPLAINED
    assert diagnosis.causes == []
    assert f", {100.0 * note.facts['rate']:+.2g} % off" in wording.sentence(diagnosis)


def test_outputs_that_are_ahead_are_told():
    data = wired()
    diagnosis = diagnose(Motor, read_at(data, data.time + 4.0), [FRICTION])
    (note,) = [note for note in diagnosis.notes if note.code in MIXED_UP]
    assert note.code in (NoteCode.RUNS_AHEAD, NoteCode.MOVES_AHEAD)
    if note.code is NoteCode.RUNS_AHEAD:
        assert note.facts["ahead"] == pytest.approx(4.0, abs=2.0 * STEP)
    assert diagnosis.verdict is Verdict.UNEXPLAINED


@pytest.mark.parametrize("late", [1.0, 5.0])
def test_what_is_late_has_no_other_clock(late):
    data = wired()
    search = Search(read_at(data, data.time - late), Motor, ["gain", "drag"])
    assert by_another_clock(search, search.nominal()) == []


def test_a_clock_is_put_right():
    """Oracle: the record before its clock was changed, but for what lies between samples."""
    data = wired(noise=0.0)
    changed = read_at(data, 2.0 + data.time / 1.02)
    clock = output_clocks(changed, data.measured)[-1]
    right = clock.put_right(changed).measured["shown"]
    known = np.isfinite(right)
    assert known.mean() > 0.9
    assert np.std((right - data.measured["shown"])[known]) < 0.2 * np.std(data.measured["shown"])


def test_of_unlike_signals_and_of_those_in_time_no_clock_is_told():
    data = wired()
    other = {"shown": np.random.default_rng(7).standard_normal(len(data.time))}
    assert output_clocks(data, other) == []
    assert output_clocks(data, wired(noise=0.0).measured) == []
