"""A file says what it is, and is whole at any time."""

from __future__ import annotations

import json
import math
import os
import shutil
from pathlib import Path

import pyarrow.parquet
import pytest

from orchestration.rig.archive import Archive
from tests.support.rig.archived import ABOUT, AHEAD, filled, samples, voltage, writer


def test_a_file_says_in_its_metadata_and_columns_what_it_is(tmp_path):
    filled(tmp_path, samples([1, 2, 3, 8, 9]))
    (path,) = tmp_path.iterdir()
    schema = pyarrow.parquet.read_schema(path)  # another library than the archive's own reader
    about = json.loads(schema.metadata[b"ppy_rig_archive"])
    assert about["rig"] == ABOUT
    for piece, first, last in zip(about["pieces"], (1, 8), (3, 9), strict=True):
        wall = [AHEAD + 0.01 * first, AHEAD + 0.01 * last]
        assert piece == [first, pytest.approx(wall[0]), last, pytest.approx(wall[1])]
    values = [voltage(k) for k in (1, 2, 3, 8, 9)]
    assert about["extremes"] == {"current": [0.5, 0.5], "voltage": [min(values), max(values)]}
    assert schema.field("voltage").metadata == {b"unit": b"V"}
    assert schema.field("voltage_age").metadata == {b"unit": b"s"}


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_writer_that_ends_amid_a_batch_leaves_the_rows_before(step, tmp_path, monkeypatch):
    """As by a kill: the folder is copied at each step that shows on the disk."""
    archive = filled(tmp_path / "archive", samples(range(1, 31)))
    made = getattr(os if step == "fsync" else Path, step)

    def act(*arguments):
        shutil.copytree(tmp_path / "archive", tmp_path / "left")
        return made(*arguments)

    with monkeypatch.context() as patched:
        patched.setattr(os if step == "fsync" else Path, step, act)
        archive.add("samples", samples(range(31, 91)), AHEAD)
    again = writer(tmp_path / "left")
    assert again.last["samples"] == 30
    again.add("samples", samples(range(31, 41)), AHEAD)
    for folder, last in (("archive", 90), ("left", 40)):
        assert {path.suffix for path in (tmp_path / folder).iterdir()} == {".parquet"}
        read = Archive(tmp_path / folder)
        assert read.damaged == read.gaps() == []
        table = read.rows("samples", -math.inf, math.inf)
        assert table["number"].to_pylist() == list(range(1, last + 1))
