"""Claims: the terminal says the verdict, the ladder, what is left and what to do."""

from __future__ import annotations

from orchestration.diagnosis.report.terminal import filled, ladder_rows, overview
from orchestration.reporting import in_shell
from orchestration.reporting.console import plain_text


def test_the_ladder_falls_with_each_term(dry):
    rows = ladder_rows(dry)
    assert [row[0] for row in rows][:2] == ["parameters fitted", "+ friction over velocity"]
    errors = [rung.error for rung in dry.ladder]
    assert errors[1] < 0.2 * errors[0]


def test_the_terminal_says_what_is_left_and_what_to_do(dry):
    with in_shell():
        text = plain_text(overview(dry))
    assert text.startswith("cause  ")
    assert "Left in position:" in text
    assert "noise widths" in text
    assert "Next: build the extended model with --fmu extended.fmu" in text
    assert "friction over velocity" in text


def test_a_table_has_no_empty_column(flipped):
    assert filled(("a", "b", "c"), [("1", "", ""), ("2", "", "x")]) == (
        ["a", "c"],
        [("1", ""), ("2", "x")],
    )
    with in_shell():
        text = plain_text(overview(flipped))
    assert "memory" not in text
    assert "+ force has the opposite sign in oscillator_1.csv" in text
