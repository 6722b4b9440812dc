"""A closed file says what it is; a file that is cut off keeps its whole batches."""

from __future__ import annotations

import json
import math

import pyarrow.parquet
import pytest

from orchestration.rig.archive import Archive
from tests.support.rig.archived import ABOUT, AHEAD, filled, samples, writer


def test_a_closed_file_says_in_its_metadata_and_columns_what_it_is(tmp_path):
    filled(tmp_path, samples([1, 2, 3, 8, 9])).close()
    (path,) = tmp_path.iterdir()
    schema = pyarrow.parquet.read_schema(path)  # another library than the archive's own reader
    about = json.loads(schema.metadata[b"ppy_rig_archive"])
    assert about.items() >= ABOUT.items()
    assert (about["first"], about["last"]) == (1, 9)
    assert about["gaps"] == [[pytest.approx(AHEAD + 0.03), pytest.approx(AHEAD + 0.08), 4, "lost"]]
    assert schema.field("voltage").metadata == {b"unit": b"V"}
    assert schema.field("voltage_age").metadata == {b"unit": b"s"}


def test_a_file_that_is_cut_off_anywhere_keeps_its_whole_batches(tmp_path):
    """As after a kill or a full disk; the batch sizes are the oracle."""
    grown = tmp_path / "grown"
    grown.mkdir()
    archive = writer(grown)
    ends = []
    (first, second, third) = (range(1, 31), range(31, 91), range(91, 101))
    for rows in (first, second, third):
        archive.add("samples", samples(rows), AHEAD)
        ends.append(next(grown.iterdir()).stat().st_size)
    (path,) = grown.iterdir()
    content = path.read_bytes()
    archive.close()
    for size in (
        0,
        10,
        *(end + more for end in ends for more in (-1, 0, 7) if end + more <= len(content)),
    ):
        cut = tmp_path / f"cut{size}"
        cut.mkdir()
        (cut / path.name).write_bytes(content[:size])
        whole = [
            rows[-1] for rows, end in zip((first, second, third), ends, strict=True) if end <= size
        ]
        last = max(whole, default=0)
        assert writer(cut).last("samples") == last
        assert {each.suffix for each in cut.iterdir()} == ({".parquet"} if last else set())
        if last:
            table = Archive(cut).rows("samples", -math.inf, math.inf)
            assert table["number"].to_pylist() == list(range(1, last + 1))
