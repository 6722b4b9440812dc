"""Claims: the page has the verdict, a row for each signal, and the place where one differs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orchestration.experiment.regression import compare, page, read_tolerances
from orchestration.records import Record
from orchestration.reporting import make_page

TIME = np.linspace(0.0, 1.0, 11)
REFERENCE = Record(TIME, {"v": TIME, "w": TIME}, {"v": "V", "w": "1"}, Path("reference.csv"))


def compared(**signals):
    result = Record(TIME, signals, REFERENCE.units | {"x": "m"}, Path("result.csv"))
    return compare(result, REFERENCE, read_tolerances("10%", "--tube"))


def test_rows_and_verdict():
    regression = compared(v=TIME + 0.2, w=TIME + 0.05)
    v, w = page.rows(regression)
    assert (v[0], v[1], *v[3:]) == ("v", "0.2 V", "11 of 11", "differs")
    assert (w[0], w[1], *w[3:]) == ("w", "0.05", "0 of 11", "as allowed")
    assert page.verdict(regression) == "result.csv and reference.csv: 1 of 2 signals differ"
    assert page.verdict(compared(v=TIME, w=TIME)).endswith("none of 2 signals differ")


def test_the_page_says_what_is_missing_and_what_is_new():
    html = make_page(compared(v=TIME, x=TIME), "ppy compare a b").html()
    for text in (
        "w is missing in result.csv",
        "Not in the reference, and not compared: x.",
        "ppy compare a b",
        "1 of 2 signals differ",
        "<img ",
    ):
        assert text in html
