"""Claims: whatever fails between client and rig, alone or together with something else, ends as
promised, in time, with nothing unsafe written and no hang.

A part of the table that `make hil-faults` tries as a whole. On a machine that runs other tests
besides, a process may wait for its turn for a tenth of a second: here the watchdog time is longer,
and bounds have an allowance. The page has them without.
"""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.support.command import posix
from tests.support.rig.faults import table
from tests.support.rig.faults.bench import Bench, Fault
from tests.support.rig.faults.matrix import Combination, drawn, trial

WATCHDOG, ALLOWANCE = 0.5, 0.2  # s
KINDS = table()
# Promises that the page shows as missed, each of them an open fault of the server or of the page's
# measurement; whoever mends one takes it out.
OPEN: set[str] = set()
OPEN_COMBINATIONS: set[str] = set()
COMBINATIONS = [
    Combination((), "HUP", "commanding"),
    Combination((), "TSTP", "commanding"),
    Combination((), "QUIT", "recording"),
    Combination((("guard", "STOP"), ("device", "STOP")), "", "commanding"),
    Combination((("guard", "KILL"), ("device", "hangs")), "WINCH", "commanding"),
    Combination((("front", "KILL"), ("guard", "STOP")), "", "commanding"),
    Combination((("front", "STOP"), ("device", "KILL")), "INT", "idle"),
]
DRAWN = [
    pytest.param(combination, seed, marks=pytest.mark.slow, id=f"{combination}-{seed}")
    for seed, combination in enumerate(drawn(60, seed=2))
]
LIKE_OTHERS = {
    "every message doubled",
    "1 in 5 messages damaged",
    "the wall clock jumps by an hour, to and fro",
}

pytestmark = [posix, pytest.mark.timeout(60), pytest.mark.real_time]


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("combination", "seed"),
    [*(pytest.param(each, 1, id=str(each)) for each in COMBINATIONS), *DRAWN],
)
def test_failures_and_signals_together_end_safe(
    combination: Combination, seed: int, tmp_path: Path
) -> None:
    outcome = trial(combination, tmp_path, seed, WATCHDOG, ALLOWANCE)
    assert outcome.result != "BROKEN", outcome.remark


def rows_of(text: str) -> list[list[str]]:
    """Return the cells of the tables of a page, line by line."""
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]


@pytest.fixture(scope="module")
def page() -> tuple[str, str]:
    """Return the parts of the page about kinds of faults and about combinations."""
    text = (Path(__file__).parents[2] / "docs" / "hil-faults.md").read_text(encoding="utf-8")
    kinds, combinations = text.split("\n## Combinations")
    return kinds, combinations


def test_a_closed_terminal_hangs_up_where_the_tests_ignore_it(tmp_path: Path) -> None:
    """As where they are started by ``nohup``, whose children would outlive their terminal."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        outcome = trial(Combination((), "HUP", "commanding"), tmp_path, 1, WATCHDOG, ALLOWANCE)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert outcome.result == "safe", outcome.remark


def test_the_page_has_every_kind(page: tuple[str, str]) -> None:
    rows = rows_of(page[0])
    named = [row[0] for row in rows if row[0] not in ("kind", "---")]
    assert named == [kind.kind for kind in KINDS]
    assert {row[0] for row in rows if row[-1] == "NO"} <= OPEN


def test_the_page_has_no_other_broken_combination(page: tuple[str, str]) -> None:
    rows = rows_of(page[1])
    broken = rows[0].index("BROKEN")
    counted = [row for row in rows if row[broken].isdigit()]
    assert [row[broken] for row in rows if row not in counted].count("BROKEN") == 2
    assert {row[0] for row in counted} <= OPEN_COMBINATIONS
