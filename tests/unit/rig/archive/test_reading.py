"""An archive is read as it was written, with its gaps and the extremes of its signals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.rig.archive import Archive, read_date
from orchestration.rig.archive import reading as reading_module
from tests.support.rig.archived import AHEAD, filled, samples, voltage


def test_rows_are_read_as_they_were_written(tmp_path):
    archive = filled(tmp_path, samples(range(1, 51)), samples(range(51, 101)))
    archive.add("events", [(1, 0.5, "state", "running"), (2, 0.6, "log", "stopped")], AHEAD)
    read = Archive(tmp_path)
    table = read.rows("samples", -math.inf, math.inf)
    assert table["number"].to_pylist() == list(range(1, 101))
    assert table["time"].to_pylist() == [0.01 * k for k in range(1, 101)]
    expected = [math.nan if k % 10 == 0 else voltage(k) for k in range(1, 101)]
    np.testing.assert_array_equal(table["voltage"], expected)
    assert [event[1:] for event in read.events()] == [("state", "running"), ("log", "stopped")]
    assert read.events()[0].time == pytest.approx(AHEAD + 0.5, abs=1e-6)
    assert read.gaps() == []
    (span,) = read.spans()
    assert (span.samples, span.run) == (100, "0a0a")
    assert span.begin == pytest.approx(AHEAD + 0.01, abs=1e-6)
    assert {path.suffix for path in tmp_path.iterdir()} == {".parquet"}


def test_gaps_in_a_file_between_files_and_between_runs_are_told(tmp_path):
    filled(tmp_path, samples([1, 2, 5]), samples([6, 7], pause=3.0))
    filled(tmp_path, samples(range(20, 23)))
    filled(tmp_path, samples([1, 2]), run="0b0b")
    told = [(gap.lost, gap.reason) for gap in Archive(tmp_path).gaps()]
    assert told == [(2, "lost"), (0, "no sample taken"), (12, "lost"), (0, "not served")]
    with pytest.raises(UserError, match="several runs"):
        Archive(tmp_path).rows("samples", -math.inf, math.inf)


@pytest.mark.parametrize("is_long", [False, True])
def test_extremes_are_those_of_the_values_also_by_the_metadata_alone(
    is_long, tmp_path, monkeypatch
):
    archive = filled(tmp_path)
    for first in range(1, 100_001, 5_000):  # of which two fill a file
        archive.add("samples", samples(range(first, first + 5_000)), AHEAD)
    if is_long:
        monkeypatch.setattr(reading_module, "_MOST_ROWS", 0)
    begin, end = AHEAD, AHEAD + 1000.0
    time, low, high = Archive(tmp_path).extremes("voltage", begin, end, 10)
    values = np.array([math.nan if k % 10 == 0 else voltage(k) for k in range(1, 100_001)])
    parts = np.array_split(values, 10)
    np.testing.assert_allclose(time, begin + 50.0 + 100.0 * np.arange(10), atol=1e-3)
    np.testing.assert_array_equal(low, [np.nanmin(part) for part in parts])
    np.testing.assert_array_equal(high, [np.nanmax(part) for part in parts])
    assert high[0] > 2.0, "the one peak is seen"


def test_a_damaged_file_is_named_and_the_others_are_read(tmp_path):
    filled(tmp_path, samples([1, 2, 3]))
    filled(tmp_path, samples([4, 5, 6]))
    first, _ = sorted(tmp_path.iterdir())
    first.write_bytes(first.read_bytes()[:100])
    read = Archive(tmp_path)
    assert read.damaged == [first]
    assert read.rows("samples", -math.inf, math.inf)["number"].to_pylist() == [4, 5, 6]


def test_a_folder_without_an_archive_is_refused(tmp_path):
    for folder in (tmp_path, tmp_path / "missing"):
        with pytest.raises(UserError, match=folder.name):
            Archive(folder)


def test_dates_are_local_unless_they_say_another_zone():
    assert read_date("1970-01-01T00:00:10+00:00", "--from", 0.0) == 10.0
    assert read_date(None, "--from", 3.0) == 3.0
    with pytest.raises(UserError, match="--to 'soon': write a date"):
        read_date("soon", "--to", 0.0)
