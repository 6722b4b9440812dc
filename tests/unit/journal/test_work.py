"""Claims: what a journal keeps is there for the same work, and for no other."""

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.journal import WorkJournal, count_done, digest

ABOUT = {"the model": "a", "the cases": "b"}


def test_the_same_work_goes_on(tmp_path):
    journal = WorkJournal(tmp_path, "search", ABOUT, (4, 2))
    assert (journal.open_rows, count_done(tmp_path)) == ([0, 1, 2, 3], (0, 4))
    journal.keep(2, np.array([1.0, -np.inf]))
    del journal
    again = WorkJournal(tmp_path, "search", ABOUT, (4, 2))
    assert again.open_rows == [0, 1, 3]
    assert again.is_done(2)
    assert again.numbers[2].tolist() == [1.0, -np.inf]
    assert count_done(tmp_path) == (1, 4)


def test_other_work_is_refused_by_what_differs(tmp_path):
    WorkJournal(tmp_path, "search", ABOUT, (4, 2))
    said = r"^\S+: is of another search \(not the same: the cases\); remove it to begin anew$"
    with pytest.raises(UserError, match=said):
        WorkJournal(tmp_path, "search", ABOUT | {"the cases": "c"}, (4, 2))


@pytest.mark.parametrize("name", ["done.npy", "numbers.npy", "work.json"])
def test_what_is_damaged_is_said(tmp_path, name):
    WorkJournal(tmp_path, "search", ABOUT, (4, 2))
    (tmp_path / name).write_bytes(b"[")
    with pytest.raises(UserError, match=r"is damaged .*; remove it to begin anew"):
        WorkJournal(tmp_path, "search", ABOUT, (4, 2))


def test_a_folder_without_a_journal_has_nothing_done(tmp_path):
    assert count_done(tmp_path) == count_done(tmp_path / "gone") == (0, 0)
    (tmp_path / "done.npy").touch()  # as where there was no room
    assert count_done(tmp_path) == (0, 0)


def test_a_digest_is_of_bytes_and_of_what_is_written():
    ones = np.ones(2)
    assert digest(ones, "a") == digest(np.ones(2), "a")
    assert len({digest(ones), digest(2.0 * ones), digest("a"), digest("b")}) == 4
