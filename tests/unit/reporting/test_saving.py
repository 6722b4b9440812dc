"""Claims: what is saved is JSON that any program reads, with the same for the same."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fmus.kit import UserError
from orchestration.reporting import ResultDataset, saving


def test_rows_of_numbers_are_a_line_and_what_json_does_not_have_is_null():
    data = {"x": np.array([1.5, np.nan, -np.inf]), "n": np.int64(3), "t": ("a", None)}
    text = saving.json_text(data)
    assert json.loads(text) == {"x": [1.5, None, None], "n": 3, "t": ["a", None]}
    assert "[ 1.5, null, null ]" in text
    assert saving.json_text(json.loads(text)) == text


def test_a_dataset_has_its_figures_and_no_page(tmp_path):
    data = ResultDataset({"y": ("case", [1.0, np.nan])}, attrs={"title": "two cases"})
    kept = json.loads(data.save(tmp_path / "data.json").read_text("utf-8"))
    assert kept["figures"]["data_vars"]["y"]["data"] == [1.0, None]
    assert kept["shown"]["page"] is None
    assert kept["shown"]["kind"] == "ResultDataset"


def test_what_has_no_figures_of_its_own_has_those_of_its_table():
    class Table:
        def to_frame(self):
            import pandas

            return pandas.DataFrame({"a": [1.0]}, index=["x"])

    figures = saving.kept(Table())["figures"]
    assert figures == {"index": ["x"], "columns": ["a"], "data": [[1.0]]}


def test_a_name_that_is_no_json_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"fit.txt: the name of a result's file ends in .json"):
        saving.save({}, tmp_path / "fit.txt")
