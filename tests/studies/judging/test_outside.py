"""Claims: an answer counts as what it is, and the tables count every record once."""

from __future__ import annotations

import pytest

from studies.judging.outside import KINDS, kind_of, report


def _row(verdict, group="outside", first=False, within=False, **more):
    said = [{"cause": "friction(speed)", "probability": 0.9, "terms": []}]
    return {
        "verdict": verdict,
        "group": group,
        "first_right": first,
        "group_right": within or first,
        "said": said,
        "truth": ["dry friction"],
        "plant": "motor",
        "number": 4,
        "strength": 0.1,
        "noise": 0.01,
        "seconds": 2.0,
        "before": 8.0,
        "after": 2.0,
    } | more


@pytest.mark.parametrize(
    ("row", "kind"),
    [
        (_row("cause", first=True), "first"),
        (_row("ambiguous", first=True), "first"),
        (_row("ambiguous", within=True), "in group"),
        (_row("ambiguous"), "group wrong"),
        (_row("cause"), "sure and wrong"),
        (_row("cause", within=True), "sure and wrong"),
        (_row("unexplained", first=True), "unsure"),
        (_row("consistent", first=True), "silent"),
        (_row("refused"), "silent"),
        (_row("cause", "clean"), "sure and wrong"),
        (_row("ambiguous", "clean"), "sure and wrong"),
        (_row("unexplained", "clean"), "unsure"),
        (_row("consistent", "clean"), "silent"),
    ],
)
def test_an_answer_is_of_one_kind(row, kind):
    assert kind_of(row) == kind
    assert kind in KINDS


def test_the_report_counts_by_group_and_names_what_is_sure_and_wrong():
    rows = [
        _row("cause", first=True),
        _row("cause", number=77),
        _row("consistent", "clean", after=1.0),
        _row("cause", "two", first=True, both=True, after=32.0),
    ]
    text = str(report(rows))
    assert "first guess is right in 2 (66.7 %)" in text
    assert "Of two at once both are named in 1 (100.0 %)" in text
    assert "8.00 before, 5.04 after" in text  # cube root of 2 * 2 * 32
    assert "noise widths left: 3." in text
    assert "- motor 77: SURE AND WRONG" in text
    by_group = report(rows).tables[0]
    assert [row[:3] for row in by_group.rows] == [["clean", 1, 0], ["outside", 2, 1], ["two", 1, 1]]
