"""Claims: whatever fails between client and rig ends as promised, in time, with nothing unsafe
written and no hang.

A part of the table that `make hil-faults` tries as a whole. On a machine that runs other tests
besides, a process may wait for its turn for a tenth of a second: here the watchdog time is longer,
and bounds have an allowance. The page has them without.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.command import posix
from tests.support.rig.faults import table
from tests.support.rig.faults.bench import Bench, Fault

WATCHDOG, ALLOWANCE = 0.5, 0.2  # s
KINDS = table()
LIKE_OTHERS = {
    "every message doubled",
    "1 in 5 messages damaged",
    "the wall clock jumps by an hour, to and fro",
}

pytestmark = [posix, pytest.mark.timeout(60), pytest.mark.real_time]


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(
            kind,
            id=kind.kind,
            marks=pytest.mark.slow if not kind.quick or kind.kind in LIKE_OTHERS else (),
        )
        for kind in KINDS
    ],
)
def test_the_promise_is_kept(fault: Fault, tmp_path: Path) -> None:
    with Bench(tmp_path, ALLOWANCE, WATCHDOG) as bench:
        fault.provoke(bench)
        bench.nothing_unsafe()
    assert bench.observed


def test_there_are_enough_kinds() -> None:
    assert len({kind.kind for kind in KINDS}) == len(KINDS) >= 40


def test_the_page_has_every_kind() -> None:
    page = (Path(__file__).parents[2] / "docs" / "hil-faults.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| ")][2:]
    assert [row[0].removeprefix("| ") for row in rows] == [kind.kind for kind in KINDS]
    assert {row[-1].removesuffix(" |") for row in rows} == {"yes"}
