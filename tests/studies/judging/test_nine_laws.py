"""Claims: an answer counts as what it is, an effect of a catalogue that leaves much misleads."""

from __future__ import annotations

import pytest

from studies.judging.nine_laws import KINDS, is_misled, kind_of, report


def _row(verdict, *right, **more):
    return {
        "title": "hysteresis",
        "verdict": verdict,
        "right": list(right),
        "catalogue": False,
        "left": 1.0,
        "seconds": 2.0,
    } | more


@pytest.mark.parametrize(
    ("row", "kind"),
    [
        (_row("cause", True), "first"),
        (_row("ambiguous", True, False), "first"),
        (_row("ambiguous", False, True), "in group"),
        (_row("cause", False), "other"),
        (_row("unexplained", True, False), "guessed"),
        (_row("unexplained", False, True), "other"),
        (_row("consistent"), "other"),
        (_row("refused"), "other"),
    ],
)
def test_an_answer_is_of_one_kind(row, kind):
    assert kind_of(row) == kind
    assert kind in KINDS


def test_an_effect_alone_misleads_where_it_leaves_more_than_the_noise():
    assert is_misled(_row("cause", False, catalogue=True, left=1.6))
    assert not is_misled(_row("cause", False, catalogue=True, left=1.4))
    assert not is_misled(_row("cause", False, left=9.0))
    assert not is_misled(_row("refused"))


def test_the_report_counts_by_law():
    rows = [
        _row("cause", True),
        _row("cause", False, title="cubic creep", catalogue=True, left=7.0),
    ]
    lines = str(report(rows)).splitlines()
    cells = {line.split("|")[1].strip(): line.split("|")[2:-1] for line in lines if "|" in line}
    assert [int(cell) for cell in cells["hysteresis"]] == [1, 1, 0, 0, 0, 0]
    assert [int(cell) for cell in cells["cubic creep"]] == [1, 0, 0, 0, 1, 1]
