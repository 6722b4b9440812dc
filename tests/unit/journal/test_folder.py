"""Claims: a folder is held by one process, and only files of a journal are removed from it."""

import pytest

from fmus.kit import UserError
from orchestration.journal import WorkJournal, check, locked_folder, removed_after


def test_a_folder_is_held_once_and_free_afterwards(tmp_path):
    part = tmp_path / "part"
    for _ in range(2):
        with locked_folder(part):
            with pytest.raises(UserError, match="another process works on it"), locked_folder(part):
                pass
            check(part)


def test_only_what_is_of_a_journal_is_removed(tmp_path):
    part = tmp_path / "part"
    with removed_after(part):
        WorkJournal(part, "work", {}, (3, 1))
    assert not part.exists()
    with removed_after(part):
        WorkJournal(part, "work", {}, (3, 1))
        (part / "mine.txt").write_text("mine", encoding="utf-8")
    assert [path.name for path in part.iterdir()] == ["mine.txt"]
    with pytest.raises(UserError, match=r"holds mine\.txt, which is no part of a journal"):
        check(part)


def test_a_journal_stays_where_its_result_is_not_written(tmp_path):
    WorkJournal(tmp_path, "work", {}, (3, 1))
    with pytest.raises(FileNotFoundError), removed_after(tmp_path):
        (tmp_path / "gone" / "result").touch()
    assert (tmp_path / "done.npy").exists()
    with removed_after(None):
        pass
