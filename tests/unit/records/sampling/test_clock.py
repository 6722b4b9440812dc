"""Claims: a clock that jitters is even, one that changes its rate is not; rows are put in order,
averaged or refused, and what is even is diagnosed as such.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import orchestration as ppy
from fmus.kit import UserError
from orchestration.identify.noise.autoregression import fit_autoregression
from orchestration.records import Source, read_record
from orchestration.records.sampling.clock import JITTER, evenly_sampled, sample_period
from tests.support.intersample_records import TRUE, record
from tests.support.record_rows import read, refusal, varied_rows, write_rows


@pytest.mark.parametrize("rate", [1.0, 10.0, 50.0])
def test_five_milliseconds_of_jitter_are_even(rate):
    random, time = np.random.default_rng(1), np.arange(3000) / rate
    for shift in (random.uniform(-5e-3, 5e-3, time.size), 5e-3 * random.standard_normal(time.size)):
        assert evenly_sampled(np.sort(time + shift))


def test_the_period_of_a_clock_that_keeps_one():
    time = 0.1 * np.arange(200.0)
    jitter = np.random.default_rng(1).uniform(-4e-4, 4e-4, time.size)
    assert sample_period(Path("r.csv"), time + jitter, "this") == pytest.approx(0.1, rel=1e-4)
    time[150:] += 0.05
    with pytest.raises(UserError, match=r"r.csv: samples are 0.1 s apart, but 0.15 s after 14.9 s"):
        sample_period(Path("r.csv"), time, "this")


def test_other_clocks_are_not():
    random = np.random.default_rng(1)
    assert not evenly_sampled(np.geomspace(1.0, 3000.0, 500))
    assert not evenly_sampled(np.cumsum(random.exponential(size=3000)))
    assert not evenly_sampled(np.cumsum(np.repeat([0.1, 0.02], 1500)))
    assert evenly_sampled(np.cumsum(np.where(np.arange(3000) == 1000, 50.0, 0.1)))


@pytest.mark.parametrize("pole", [0.3, 0.45, 0.7, 0.9, 0.97])
def test_an_autoregression_bears_as_much_jitter_as_is_called_even(pole):
    """An exact Ornstein-Uhlenbeck process, sampled unevenly: what the innovations lose against an
    even clock.
    """
    random, n = np.random.default_rng(3), 100_000
    steps = np.clip(1.0 + JITTER * random.standard_normal(n), 0.05, None)
    kept = pole**steps
    white, noise = np.sqrt(1.0 - kept**2) * random.standard_normal(n), np.zeros(n)
    for k in range(1, n):
        noise[k] = kept[k] * noise[k - 1] + white[k]
    found = fit_autoregression(noise)
    innovation = lfilter(np.concatenate([[1.0], -found.coefficients]), [1.0], noise)
    variance = found.deviation**2
    assert variance == pytest.approx(np.mean(white**2), rel=0.09)
    assert abs(np.mean(innovation[1:] * innovation[:-1])) < 0.03 * variance


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["chirp", "multilevel"])
def test_a_clean_record_with_jitter_is_diagnosed_like_any(kind):
    deviations = []
    options = {"duration": 60.0, "rate": 50.0, "force": "multilevel", "jitter": 5e-3}
    for seed in range(40, 45):
        data = record(kind, kind == "multilevel", seed, **options)
        assert np.ptp(np.diff(data.time)) > 0.015
        columns = {"time": data.time, **data.inputs, **data.outputs}
        said = ppy.diagnose(columns, effects=["double_layer"], laws=False)
        assert said.causes == []
        assert said.verdict == "recalibrate"
        assert said.details.subject.problem.records[0].smooth[0] is (kind == "chirp")
        for name in ("R1", "R2", "C", "alpha"):
            low, high = np.log(said.parameters[name].interval)
            error = np.log(said.parameters[name].value / TRUE[name])
            deviations.append(error / ((high - low) / 3.92))
    assert np.mean(np.abs(deviations) < 1.96) >= 0.85
    assert np.abs(deviations).max() < 4.0


def test_repeated_times_are_averaged_and_counted(tmp_path):
    record, kinds = read(
        write_rows(tmp_path, [[0, 1, 2], [1, 1, 2], [1, 3, ""], [1, 5, 4], [2, 0, 1]])
    )
    assert record.time.tolist() == [0, 1, 2]
    assert record.signals["u"].tolist() == [1, 3, 0]
    assert record.signals["y"].tolist() == [2, 3, 1]
    assert set(kinds) == {"duplicates"}
    assert kinds["duplicates"].rows == (4, 5)
    assert "5 rows became 3" in kinds["duplicates"].message


def test_prescribed_values_jump_between_rows_of_one_time(tmp_path):
    rows = [[0, 1, 2], [1, 1, 2], [1, 3, 4], [2, 5, 6], [2, 0, 1]]
    record = read_record(write_rows(tmp_path, rows), {"u": "V", "y": "m"}, jumps=True)
    assert record.time.tolist() == [0, 1, 2]
    assert record.signals["u"].tolist() == [1, 3, 0]
    assert record.signals["y"].tolist() == [2, 4, 1]
    (repair,) = (repair for repair in record.repairs if repair.kind == "duplicates")
    assert repair.rows == (3, 5)


def test_rows_that_repeat_exactly_keep_their_exact_value(tmp_path):
    record, kinds = read(
        write_rows(
            tmp_path, [[0, 0.1, 0.3], [1, 0.7, 0.1], [1, 0.7, 0.1], [1, 0.7, 0.1], [2, 0.2, 0.3]]
        )
    )
    assert record.signals["u"].tolist() == [0.1, 0.7, 0.2]
    assert "identical values" in kinds["duplicates"].message


def test_a_few_late_rows_are_sorted(tmp_path):
    rows = varied_rows(100)
    rows[50], rows[53] = rows[53], rows[50]
    record, kinds = read(write_rows(tmp_path, rows))
    assert np.all(np.diff(record.time) > 0)
    assert kinds["order"].rows == (53, 54, 55)
    expected = np.array(sorted(rows))
    np.testing.assert_array_equal(record.signals["y"], expected[:, 2])


def test_a_late_packet_that_fits_a_hole_is_sorted(tmp_path):
    rows = varied_rows(100)
    record, kinds = read(write_rows(tmp_path, rows[:40] + rows[60:80] + rows[40:60] + rows[80:]))
    np.testing.assert_array_equal(record.time, np.arange(100))
    assert len(kinds["order"].rows) == 20


@pytest.mark.parametrize("tail", [1, 3, 100])
def test_a_restarted_clock_is_refused_with_the_row_to_split_at(tmp_path, tail):
    message = refusal(write_rows(tmp_path, varied_rows(100) + varied_rows(tail)))
    assert "the clock restarts" in message
    assert "split the file before row 102" in message


def test_a_clock_set_back_is_refused(tmp_path):
    rows = varied_rows(100)
    message = refusal(write_rows(tmp_path, rows + [[t - 30, u, y] for t, u, y in rows[80:]]))
    assert "the clock jumps back: row 101 is at 99 s, row 102 at 50 s" in message


def test_a_shuffled_or_reversed_record_is_refused(tmp_path):
    rows = varied_rows(100)
    assert "in reverse order: the first" in refusal(write_rows(tmp_path, rows[::-1]))
    swapped = [row for pair in zip(rows[1::2], rows[::2], strict=True) for row in pair]
    assert "do not order" in refusal(write_rows(tmp_path, swapped))


def test_gaps_are_kept_and_said(tmp_path):
    rows = varied_rows(100)
    record, kinds = read(write_rows(tmp_path, rows[:30] + rows[60:]))
    assert record.time.size == 70
    assert kinds["gap"].rows == (32,)
    assert "a gap of 31 s before row 32, longer than" in kinds["gap"].message
    _, kinds = read(write_rows(tmp_path, rows[:20] + rows[40:60] + rows[90:]))
    assert "before rows 22, 42, the longest 31 s before row 42" in kinds["gap"].message


def test_logarithmic_sampling_is_uneven_and_not_full_of_gaps(tmp_path):
    rows = varied_rows(100)
    _, kinds = read(write_rows(tmp_path, [[1e-3 * 1.15**k, u, y] for k, u, y in rows]))
    assert set(kinds) == {"uneven sampling"}


def test_a_row_without_time_is_dropped_and_said(tmp_path):
    rows = varied_rows(200)
    rows[3][0], rows[7][0] = "", "inf"
    record, kinds = read(write_rows(tmp_path, rows))
    assert record.time.size == 198
    assert kinds["missing time"].rows == (5, 9)


def test_more_rows_without_time_than_a_hundredth_are_refused_with_what_allows_it(tmp_path):
    rows = varied_rows(100)
    rows[3][0], rows[7][0] = "", "inf"
    path = write_rows(tmp_path, rows)
    assert "2 of 100 rows have no valid time (rows 5, 9)" in refusal(path)
    assert "discard='2%' allows it" in refusal(path)
    record, _ = read(Source.of(path, discard=2.0))
    assert record.time.size == 98


def test_averaged_values_say_by_how_much_they_differ(tmp_path):
    _, kinds = read(write_rows(tmp_path, [[0, 1, 2], [1, 1, 2], [1, 3, 2], [2, 0, 1]]))
    assert "which differ: u by up to 2)" in kinds["duplicates"].message


def test_a_part_of_the_time_is_read(tmp_path):
    path = write_rows(tmp_path, varied_rows(100))
    record, _ = read(Source.of(path, begin=10.0, end=20.0))
    assert record.time.tolist() == list(range(10, 21))
    assert "no row is between 200 s and inf s" in refusal(Source.of(path, begin=200.0))


def test_a_limit_beyond_the_clock_is_said_to_leave_nothing_out(tmp_path):
    path = write_rows(tmp_path, [[k + 5000.0, u, y] for k, u, y in varied_rows(100)])
    record, kinds = read(Source.of(path, begin=25.0, end=5050.0))
    assert record.time[[0, -1]].tolist() == [5000.0, 5050.0]
    assert kinds["span"].message == "begin='25s' leaves nothing out of 5000 s to 5099 s"
    assert "span" not in read(Source.of(path, begin=5000.0, end=5099.0))[1]
