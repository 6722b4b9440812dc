"""Claims: joined records are those that were joined, and nothing that is filtered reaches from one
into the next.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.discrepancy.data.dataset import GAP, PIECE, Dataset
from orchestration.discrepancy.residuals.correlation import LAGS
from orchestration.identify.noise.autoregression import ORDER, segments
from orchestration.identify.noise.model import Noise
from tests.support.several import several, with_gaps


@st.composite
def records(draw):
    """Records by label: steps, starts of the clock and lengths of any kind; some lack an output."""
    result = {}
    for label in draw(st.lists(st.text(min_size=1), min_size=1, max_size=5, unique=True)):
        steps = draw(st.lists(st.floats(0.01, 100.0), min_size=1, max_size=40))
        time = draw(st.floats(-1e3, 1e3)) + np.concatenate([[0.0], np.cumsum(steps)])
        seed = draw(st.integers(0, 99))
        values = np.random.default_rng(seed).standard_normal((3, time.size))
        outputs = {
            name: values[k] for k, name in enumerate(("y", "z")) if k == 0 or draw(st.booleans())
        }
        result[label] = Dataset(time, {"u": values[2]}, outputs)
    return result


@given(records())
def test_records_come_apart_as_they_were_joined(given_records):
    whole = Dataset.joined(given_records)
    assert (np.diff(whole.time) > 0.0).all()
    apart = whole.by_run()
    assert list(apart) == list(given_records)
    for label, record in given_records.items():
        part = apart[label]
        assert part.time == pytest.approx(
            record.time, abs=1e-9 * max(1.0, np.abs(whole.time).max())
        )
        assert np.array_equal(part.inputs["u"], record.inputs["u"])
        for name in whole.measured:
            expected = record.measured.get(name, np.full(record.time.size, np.nan))
            assert np.array_equal(part.measured[name], expected, equal_nan=True)


@given(records())
def test_between_records_nothing_is_measured_and_every_input_has_a_value(given_records):
    whole = Dataset.joined(given_records)
    assert whole.within.sum() == sum(record.time.size for record in given_records.values())
    assert all(np.isnan(y[~whole.within]).all() for y in whole.measured.values())
    assert all(np.isfinite(u).all() for u in whole.inputs.values())


@given(records(), st.data())
def test_a_selection_of_samples_knows_to_which_record_each_belongs(given_records, data):
    whole = Dataset.joined(given_records)
    mask = np.array(
        data.draw(st.lists(st.booleans(), min_size=len(whole.time), max_size=len(whole.time)))
    )
    some = whole.where(mask)
    for run in some.several:
        (original,) = [other for other in whole.runs if other.label == run.label]
        assert np.array_equal(
            some.time[run.samples], whole.time[original.samples][mask[original.samples]]
        )
    kept = sum(run.last - run.first for run in some.several)
    assert kept == int((mask & whole.within).sum())


@given(records())
def test_no_stretch_without_gaps_reaches_from_one_record_into_the_next(given_records):
    whole = Dataset.joined(given_records)
    present = np.isfinite(whole.measured["y"])
    at = np.flatnonzero(present)
    for first, last in segments(present):
        assert any(run.first <= at[first] and at[last - 1] < run.last for run in whole.runs)


def test_the_beginning_of_several_runs_is_that_of_each():
    data = several("ab")
    half = data.beginning(0.5)
    assert [run.last - run.first for run in half.runs] == [200, 200]
    for run, whole in zip(half.runs, data.runs, strict=True):
        first = data.measured["voltage"][whole.first : whole.first + 200]
        assert np.array_equal(half.measured["voltage"][run.samples], first)


def test_what_is_whitened_of_one_record_hangs_on_no_other():
    rng, time = np.random.default_rng(1), np.arange(50.0)
    parts = [rng.standard_normal(50) for _ in range(3)]
    whole = Dataset.joined({str(k): Dataset(time, {}, {"y": y}) for k, y in enumerate(parts)})
    noise = Noise(np.array([0.5, 0.2]), 0.7)
    y, present = whole.measured["y"], np.isfinite(whole.measured["y"])
    everywhere = np.ones(50, dtype=bool)
    assert noise.whiten(y[present], present) == pytest.approx(
        np.concatenate([noise.whiten(part, everywhere) for part in parts])
    )


def test_the_gap_is_longer_than_anything_that_looks_back():
    assert GAP > LAGS + ORDER


def test_some_of_the_records_are_joined_anew():
    time = np.arange(10.0)
    whole = Dataset.joined(
        {k: Dataset(time, {"u": time}, {"y": time + len(k)}) for k in ("a", "bb", "ccc")}
    )
    some = whole.runs_of(["ccc", "a"])
    assert [run.label for run in some.runs] == ["ccc", "a"]
    assert some.measured["y"][some.runs[1].samples] == pytest.approx(time + 1.0)


def test_a_record_that_is_complete_or_comes_in_bursts_stays_as_it_is():
    assert list(with_gaps().pieces("a")) == ["a"]
    assert with_gaps(*((k, k + 20) for k in range(10, 900, 30))).pieces().keys() == {""}
    few = with_gaps((100, 120), (100 + PIECE, 200))
    assert [len(part.time) for part in few.pieces("a").values()] == [100, 700]
    assert list(few.pieces("a")) == ["a.1", "a.2"]
