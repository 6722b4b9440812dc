"""Claims: a value is that of its run whatever the label; clocks of several runs may differ."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from orchestration.records.runs.joining import (
    MeasuredRun,
    base_name,
    sampled_alike,
)


def test_runs_of_different_rates_are_not_sampled_alike():
    time = np.concatenate([np.arange(100.0), 200.0 + 0.5 * np.arange(100.0)])
    halves = (MeasuredRun("a", 0, 100), MeasuredRun("b", 100, 200))
    assert [sampled_alike(time, runs) for runs in (halves, halves[:1], halves[1:])] == [
        False,
        True,
        True,
    ]


words = st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1)


@given(
    name=words,
    labels=st.lists(st.text(min_size=1), min_size=1, max_size=5, unique=True),
    value=st.floats(),
)
def test_a_value_is_that_of_its_run_whatever_the_label(name, labels, value):
    runs = [MeasuredRun(label, 10 * k, 10 * k + 5) for k, label in enumerate(labels)]
    (first, *others) = [run.values({name: 0.0, runs[0].own(name): value}) for run in runs]
    assert np.array_equal(first[name], value, equal_nan=True)
    assert all(plain == {name: 0.0} for plain in others)
    assert {base_name(run.own(name)) for run in runs} == {name}


def test_a_record_by_itself_needs_no_name():
    assert MeasuredRun("", 0, 5).own("R0") == "R0"
