"""Claims: a record that makes no sense is refused before anybody is asked; an archive is listed."""

from __future__ import annotations

import json

import pytest

from tests.support.command import refused, works
from tests.support.rig.archived import AHEAD, filled, samples

pytestmark = pytest.mark.timeout(60)


@pytest.mark.parametrize(
    ("option", "value"), [("--rate", "0"), ("--rate", "inf"), ("--max-age", "-1s")]
)
def test_a_record_without_rows_is_refused(tmp_path, option, value):
    call = ["rig", "record", "--stimulus", "fig_3_4", "--out", "run.nc", option, value]
    assert "must be above 0" in refused(tmp_path, *call, parts=[option])


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("--rate", "10"), "--rate: is about an experiment"),
        (("--set", "duration=5s"), "--set: is about an experiment"),
        (("--for", "0s"), "--for 0: must be above 0 s"),
        (("--stimulus", "fig_3_4", "--for", "5s"), "--for: an experiment has its own duration"),
    ],
)
def test_options_of_the_other_kind_of_record_are_refused(tmp_path, arguments, part):
    assert part in refused(tmp_path, "rig", "record", "--out", "run.nc", *arguments)


def test_an_archive_is_listed_in_lines_and_as_json(tmp_path):
    archive = filled(tmp_path / "a", samples([1, 2, 3, 8, 9]))
    archive.add("events", [(1, 0.02, "state", "running")], AHEAD)
    lines = works("rig", "archive", "a", cwd=tmp_path).splitlines()
    assert lines[0] == "emulator on here, 100 samples a second: current [A], voltage [V]"
    assert [line.partition("  ")[2] for line in lines[1:]] == [
        "5 samples",
        "gap: 4 samples lost",
        "state: running",
    ]
    told = json.loads(works("rig", "archive", "a", "--json", "-", cwd=tmp_path))
    assert told["spans"][0]["samples"] == 5
    assert [(gap["lost"], gap["reason"]) for gap in told["gaps"]] == [(4, "lost")]
    assert [event["text"] for event in told["events"]] == ["running"]
