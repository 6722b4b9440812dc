"""Claims: a badge counts what was run and what of it passed; a run that fails is in the log."""

from __future__ import annotations

import re

import pytest

from tests.support import compatibility
from tests.support.compatibility import Tool
from tests.support.compatibility_page import BAD, GOOD, badges, page

pytestmark = pytest.mark.filterwarnings("ignore:.*missing input")


def fails(name):
    raise RuntimeError("no such thing\nand more")


def test_tools_are_run_and_counted():
    tools = [tool for tool in compatibility.TOOLS if tool.name == "fmpy" and tool.fmi == 3]
    entries = compatibility.log(["galvanostat", "pid"], tools)
    assert {entry["outcome"] for entry in entries} == {"passed"}
    assert all(re.fullmatch("[0-9a-f]{64}", entry["sha256"]) for entry in entries)
    (badge,) = badges(entries).items()
    assert badge[0] == "fmpy-fmi3.svg"
    assert "FMI 3.0: 6 of 6" in badge[1]
    assert GOOD in badge[1]


@pytest.mark.parametrize(("deviation", "status"), [(0.0, 0), (1e-3, 1), (float("nan"), 1)])
def test_the_exit_status_says_whether_every_run_passed(tmp_path, monkeypatch, deviation, status):
    tools = [Tool("fmpy", str, 2, "co-simulation", lambda name: deviation, 1e-9)]
    entries = compatibility.log(["pid"], tools)
    monkeypatch.setattr(compatibility, "log", lambda: entries)
    monkeypatch.setattr("sys.argv", ["compatibility", "--out", str(tmp_path)])
    assert compatibility.main() == status


def test_what_deviates_or_raises_is_no_pass():
    tools = [
        Tool("fmpy", str, 2, "co-simulation", lambda name: 1e-3, 1e-9),
        Tool("fmpy", str, 2, "model exchange", fails, 1e-9),
        Tool("fmpy", str, 2, "model exchange", lambda name: float("nan"), 1e-9),
    ]
    entries = compatibility.log(["pid"], tools)
    assert [entry["outcome"] for entry in entries] == ["failed"] * 3
    assert entries[1]["reason"] == "RuntimeError: no such thing"
    (text,) = badges(entries).values()
    assert "0 of 3" in text
    assert BAD in text


def test_the_page_has_a_reason_for_whatever_was_not_passed():
    way = {"fmi": 2, "interface": "co-simulation", "allowed": 1e-9}
    tools = [
        Tool("good", str, runs=lambda name: 1e-12, **way),
        Tool("bad", str, runs=fails, **way),
        Tool("absent", str, runs=fails, lacks=lambda: "it has no package", **way),
    ]
    lines = page(compatibility.log(["pid", "galvanostat"], tools)).splitlines()
    assert "| 1 | good |  | 2.0 | co-simulation | native | 2 of 2 | 1e-12 | 1e-09 |" in lines
    assert "| pid | ✓ | ✗ | – |" in lines
    reasons = lines[lines.index("Not passed:") + 2 :]
    assert reasons == [
        "* 2, pid: RuntimeError: no such thing",
        "* 2, galvanostat: RuntimeError: no such thing",
        "* 3, all: it has no package",
    ]
