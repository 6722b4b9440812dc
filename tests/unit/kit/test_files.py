import os
import re
from pathlib import Path

import pytest

from fmus.kit import UserError, files


def test_writing_makes_the_folder_and_replaces(tmp_path):
    target = tmp_path / "new" / "folder" / "x.fmu"
    files.write(target, b"one")
    files.write(target, b"two")
    assert target.read_bytes() == b"two"
    assert list(target.parent.iterdir()) == [target]


def test_interrupted_writing_leaves_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "x.fmu"
    files.write(target, b"old")

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UserError, match=r"cannot write .*x\.fmu: No space left on device"):
        files.write(target, b"new")
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_unwritable_places_are_told_in_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    for target in (tmp_path / "file" / "x.fmu", Path("/proc/none/x.fmu")):
        with pytest.raises(UserError, match=f"cannot write {re.escape(str(target))}: ") as caught:
            files.write(target, b"")
        assert "\n" not in str(caught.value)
    (tmp_path / "x.fmu").mkdir()
    with pytest.raises(UserError, match="cannot write"):
        files.write(tmp_path / "x.fmu", b"")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "x.fmu"]
