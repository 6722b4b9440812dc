"""Claims: the terminal says the verdict, the ladder, what is left and what to do."""

from __future__ import annotations

from orchestration.diagnosis.report.terminal import ladder_rows, overview
from orchestration.reporting import in_shell
from orchestration.reporting.console import plain_text


def test_the_ladder_falls_with_each_term(dry):
    rows = ladder_rows(dry)
    assert [row[0] for row in rows][:2] == ["no term", "one term"]
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
