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


def test_a_folder_is_there_when_it_is_whole(tmp_path):
    target = tmp_path / "new" / "folder"
    for text in ("one", "two"):
        before = target.exists()
        with files.replacing(target) as folder:
            folder.mkdir()
            (folder / text).touch()
            assert target.exists() == before
        assert [p.name for p in target.iterdir()] == [text]
    assert list(target.parent.iterdir()) == [target]


def write_folder(path, error):
    with files.replacing(path) as folder:
        folder.mkdir()
        (folder / "new").touch()
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_interrupted_writing_leaves_the_old_folder(error, tmp_path):
    target = tmp_path / "folder"
    target.mkdir()
    (target / "old").touch()
    with pytest.raises((KeyboardInterrupt, UserError)) as caught:
        write_folder(target, error)
    if caught.type is UserError:
        assert str(caught.value) == f"cannot write {target}: No space left on device"
    assert [p.name for p in target.iterdir()] == ["old"]
    assert list(tmp_path.iterdir()) == [target]


def test_what_cannot_be_replaced_is_put_back(tmp_path):
    """The new folder was not made."""
    (tmp_path / "folder").mkdir()
    with (
        pytest.raises(UserError, match=r"cannot write .*folder: No such file"),
        files.replacing(tmp_path / "folder"),
    ):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


def test_contents_that_are_kept_stay_as_they_were_read_first(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"first")
    with files.kept() as found:
        assert files.contents(path) == b"first"
        path.write_bytes(b"second")
        assert files.contents(path) == b"first"
    assert files.contents(path) == b"second"
    files.keep(found)
    try:
        assert files.contents(path) == b"first"
    finally:
        files.keep(None)
