"""Claims: texts about parts that are done are there when the work goes on, and no others."""

import pytest

from fmus.kit import UserError
from orchestration.journal import RowTexts, WorkJournal

NAME = "remarks.jsonl"


class Journal(WorkJournal):
    def begin(self, mode):
        self.texts = RowTexts(self, NAME, mode)


def journal(folder):
    return Journal(folder, "search", {}, (4, 1))


def test_texts_about_parts_that_are_done_are_kept(tmp_path):
    first = journal(tmp_path)
    first.texts.append([(2, "warm"), (2, "worn")])
    first.keep(2, 1.0)
    first.texts.append([(3, "lost")])
    first.texts.append([])
    del first
    with (tmp_path / NAME).open("a", encoding="utf-8") as file:
        file.write('[2, "cut')
    again = journal(tmp_path)
    assert again.texts.pairs == [(2, "warm"), (2, "worn")]
    assert (tmp_path / NAME).read_text(encoding="utf-8") == '[2, "warm"]\n[2, "worn"]\n'


def test_without_texts_there_is_no_file(tmp_path):
    assert journal(tmp_path).texts.pairs == []
    assert not (tmp_path / NAME).exists()


def test_work_that_is_begun_anew_has_no_texts(tmp_path):
    (tmp_path / NAME).write_text('[0, "of before"]\n', encoding="utf-8")
    assert journal(tmp_path).texts.pairs == []


@pytest.mark.parametrize("text", ["[\n", '[9, "beyond"]\n', '["one"]\n'])
def test_what_is_damaged_is_said(tmp_path, text):
    journal(tmp_path)
    (tmp_path / NAME).write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=r"is damaged .*; remove it to begin anew"):
        journal(tmp_path)
