"""Claims: a badge counts what was run and what of it passed; a run that fails is in the log."""

from __future__ import annotations

import re

import pytest

from tests.support import compatibility

pytestmark = pytest.mark.filterwarnings("ignore:.*missing input")


def fails(name):
    raise RuntimeError("no such thing\nand more")


def test_tools_are_run_and_counted():
    tools = [tool for tool in compatibility.TOOLS if tool[0] == "fmpy" and tool[2] == 3]
    entries = compatibility.log(["galvanostat", "pid"], tools)
    assert {entry["outcome"] for entry in entries} == {"passed"}
    assert all(re.fullmatch("[0-9a-f]{64}", entry["sha256"]) for entry in entries)
    (badge,) = compatibility.badges(entries).items()
    assert badge[0] == "fmpy-fmi3.svg"
    assert "FMI 3.0: 4 of 4" in badge[1]
    assert compatibility.GOOD in badge[1]


@pytest.mark.parametrize(("deviation", "status"), [(0.0, 0), (1e-3, 1), (float("nan"), 1)])
def test_the_exit_status_says_whether_every_run_passed(tmp_path, monkeypatch, deviation, status):
    tools = [("fmpy", str, 2, "co-simulation", lambda name: deviation, 1e-9)]
    entries = compatibility.log(["pid"], tools)
    monkeypatch.setattr(compatibility, "log", lambda **options: entries)
    monkeypatch.setattr(compatibility.fmusim, "BINARY", "")
    monkeypatch.setattr("sys.argv", ["compatibility", "--out", str(tmp_path)])
    assert compatibility.main() == status


def test_what_deviates_or_raises_is_no_pass():
    tools = [
        ("fmpy", str, 2, "co-simulation", lambda name: 1e-3, 1e-9),
        ("fmpy", str, 2, "model exchange", fails, 1e-9),
        ("fmpy", str, 2, "model exchange", lambda name: float("nan"), 1e-9),
    ]
    entries = compatibility.log(["pid"], tools)
    assert [entry["outcome"] for entry in entries] == ["failed"] * 3
    assert entries[1]["error"] == "RuntimeError: no such thing"
    (text,) = compatibility.badges(entries).values()
    assert "0 of 3" in text
    assert compatibility.BAD in text
