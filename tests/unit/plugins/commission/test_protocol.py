"""Claims: a protocol counts its verdicts, and is JSON."""

from __future__ import annotations

import json

from orchestration.plugins.commission.protocol import (
    FAILED,
    NOT_CONFIRMED,
    PASS,
    Finding,
    Line,
    Protocol,
    Row,
)

ROW = Row(10.0, "running", {"current": 0.2}, {"current": None}, {})


def protocol(*verdicts, interrupted=""):
    lines = [
        Line(f"check {v}", "done", "must hold", Finding(v, "as seen"), (ROW,)) for v in verdicts
    ]
    facts = {"backend": "fake", "date": "2026-11-29", "ppy-rig": "0.1.0"}
    return Protocol(facts, {"current": "A"}, tuple(lines), interrupted=interrupted)


def test_verdicts_are_counted():
    made = protocol(PASS, PASS, NOT_CONFIRMED)
    assert made.summary == "2 pass, 1 not confirmed"
    assert not made.has_failed
    assert made.conclusion == "no protection failed"
    assert protocol(PASS, FAILED).has_failed
    assert protocol(PASS, FAILED, interrupted="smoke").conclusion == "a protection FAILED"


def test_what_ended_early_is_not_called_passed():
    made = protocol(PASS, interrupted="interrupted")
    assert made.summary == "ended early: interrupted; 1 pass"
    assert made.conclusion == "not finished"
    assert protocol().summary == "nothing was tried"


def test_it_is_json():
    read = json.loads(json.dumps(protocol(FAILED).to_json()))
    assert read["lines"][0]["title"] == "check FAILED"
    assert "FAILED" in read["lines"][0]["finding"]
