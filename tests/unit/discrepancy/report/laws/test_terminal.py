"""Claims: the table of corrections has a row for each, in words."""

from __future__ import annotations

from orchestration.discrepancy.report.laws import terminal
from orchestration.reporting.console import plain_text
from tests.support.law_reports import motor_report


def test_a_correction_is_a_row():
    law_report, _ = motor_report("saturating", kind="multiply")
    title, head, row = plain_text(terminal.corrections(law_report)).splitlines()
    assert title == "corrections"
    assert head.split()[:3] == ["effect", "law", "signal"]
    cells = "friction(omega) friction (factor) omega 12.0 saturating not asked drop over current"
    assert row.split() == cells.split()
