"""Claims: of several records whole ones are held out, and what is judged of them was not fitted
to.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.data.dataset import PIECE, Dataset
from orchestration.discrepancy.data.holdout import ValidationData
from tests.support.several import STEP, joined_pieces, measured, several, with_gaps


@pytest.mark.parametrize(
    ("records", "out"), [("ab", "b"), ("abc", "c"), ("abcd", "d"), ("abcdef", "ef")]
)
def test_of_several_records_the_last_third_is_held_out(records, out):
    estimation, validation = ValidationData.split(several(records))
    assert "".join(run.label for run in estimation.runs) == records.removesuffix(out)
    assert "".join(run.label for run in validation.data.runs) == out
    assert not validation.continued


def test_what_is_held_out_of_one_record_continues_it():
    record = measured(0, 1.0)
    estimation, validation = ValidationData.split(record)
    assert validation.continued
    assert validation.judged.sum() + len(estimation.time) == len(record.time)
    assert validation.first == len(estimation.time)


@pytest.mark.parametrize(("driven_to_the_end", "fitted_before"), [(True, 2.0 / 3.0), (False, 1.0)])
def test_of_what_nothing_drives_blocks_from_all_over_are_held_out(driven_to_the_end, fitted_before):
    """A step at the start moves an output to the end, but what it shows there it has shown."""
    time = np.arange(900.0)
    u = np.sin(time) if driven_to_the_end else np.minimum(time, 1.0)
    record = Dataset(time, {"u": u}, {"y": np.exp(-time / 900.0)})
    estimation, validation = ValidationData.split(record)
    last = np.flatnonzero(np.isfinite(estimation.measured["y"]))[-1]
    assert last == pytest.approx(fitted_before * 900.0, abs=2.0)
    fitted = int(np.isfinite(estimation.measured["y"]).sum())
    assert fitted == pytest.approx(600, abs=2)
    assert (
        int((validation.judged & np.isfinite(validation.data.measured["y"])).sum()) == 900 - fitted
    )


def test_the_first_sixth_of_each_record_held_out_is_not_judged():
    data = several("ab")
    validation = ValidationData.separate_record(data)
    for run in data.runs:
        judged = validation.judged[run.samples]
        assert judged.sum() == pytest.approx(5.0 / 6.0 * judged.size, abs=1)
        assert (np.diff(judged.astype(int)) >= 0).all()
    assert not validation.judged[~data.within].any()
    before = validation.run_in
    assert [run.last - run.first for run in before.runs] == [67, 67]
    assert np.isfinite(before.measured["voltage"]).all()


def test_where_more_than_the_start_is_its_own_it_is_estimated_all_over_the_record():
    data = several("ab")
    validation = ValidationData.separate_record(data, each=True)
    for run in data.runs:
        judged = validation.judged[run.samples]
        assert judged.mean() == pytest.approx(5.0 / 6.0, abs=0.02)
        assert np.count_nonzero(np.diff(judged.astype(int)) > 0) == 10
    fitted = np.isfinite(validation.run_in.measured["voltage"]).sum()
    assert fitted + validation.judged.sum() == data.within.sum()


def test_errors_are_of_the_samples_that_are_judged():
    data = several("ab")
    validation = ValidationData.separate_record(data)
    wrong = np.where(validation.judged, data.measured["voltage"] + 1.0, 1e3)
    spread = np.nanstd(data.measured["voltage"])
    assert validation.nrmse({"voltage": wrong})["voltage"] == pytest.approx(1.0 / spread)


def test_an_error_is_told_over_the_spread_of_all_that_was_held_out():
    """Oracle: a ramp from 0 to 1 has the spread 1 / sqrt(12), however much of it tells the
    start.
    """
    ramp = np.linspace(0.0, 1.0, 60001)
    record = Dataset(np.arange(60001.0), {}, {"y": ramp})
    alone = ValidationData.separate_record(record)
    assert alone.first == 10000
    assert alone.nrmse({"y": ramp + 0.1})["y"] == pytest.approx(0.1 * np.sqrt(12.0), rel=1e-4)
    tail = ValidationData.tail(record)  # of which the rest was fitted to
    assert tail.nrmse({"y": ramp + 0.1})["y"] == pytest.approx(0.1 * np.sqrt(12.0) * 3.0, rel=1e-4)


@pytest.mark.parametrize(
    ("missing", "fitted"),
    [
        ([(300, 450)], [300, 200]),  # 750 are left, of which 500 are fitted to
        ([(60, 160)], [60, 473]),
        ([(600, 650), (750, 780)], [547]),
        ([(560, 640)], [560]),  # and so would what is left of the first
        ([(540, 640)], [540]),  # what was left of the second piece would be too short
    ],
)
def test_the_last_third_is_held_out_wherever_the_gaps_are(missing, fitted):
    data = joined_pieces(with_gaps(*missing))
    estimation, validation = ValidationData.split(data)
    assert [run.last - run.first for run in estimation.runs] == fitted
    both = int(estimation.within.sum() + validation.data.within.sum())
    assert both == int(data.within.sum())
    assert not validation.continued
    assert np.ptp(validation.data.time[validation.data.runs[0].samples]) > STEP * PIECE


def test_of_several_records_whole_ones_are_held_out():
    records = {"a": with_gaps((300, 450)), "b": with_gaps(), "c": with_gaps((200, 300), (400, 500))}
    pieces = {
        label: part for name, data in records.items() for label, part in data.pieces(name).items()
    }
    of = {label: label[0] for label in pieces if "." in label}
    estimation, validation = ValidationData.split(Dataset.joined(pieces, of))
    assert [run.label for run in estimation.runs] == ["a.1", "a.2", "b"]
    assert [run.label for run in validation.data.runs] == ["c.1", "c.2", "c.3"]
