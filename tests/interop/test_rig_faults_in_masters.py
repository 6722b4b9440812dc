"""A proxy in three masters at a rig that fails: nobody takes an old value for a fresh one."""

from __future__ import annotations

import sys

import pytest

from fmus.kit.build.building import RUNTIMES
from tests.support.pace import slow_but
from tests.support.rig.masters import (
    AFTER,
    FAULTS,
    GOOD,
    LINK_STATES,
    MASTERS,
    MAX_AGE,
    SLACK,
    STEP,
    observe,
)
from tests.support.rig.masters.__main__ import page

pytestmark = [
    pytest.mark.real_time(limit=SLACK),
    pytest.mark.skipif(sys.platform != "linux", reason="the hosts of the tests run on Linux"),
]
CONNECTED, _, STALE, LOST = range(4)
AT_ONCE = 3  # steps, in which a stop is heard of at the latest


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "master", "runtime"),
    slow_but(
        [
            (fault, master, runtime)
            for fault in FAULTS
            for master in MASTERS
            for runtime in RUNTIMES
        ],
        ("stop", "Ecos", "python"),
        ("hang", "Ecos", "native"),
        ("kill", "fmpy", "python"),
        ("late", "libcosim", "native"),
    ),
)
def test_no_old_value_looks_fresh(tmp_path, fault, master, runtime):
    seen = observe(master, runtime, fault, tmp_path)
    assert seen.looks_fresh() == []
    if seen.refused:
        assert fault == "dead"
        return
    told = [row for row in (*seen.before, *seen.after) if not row.error]
    assert max(row.understated for row in told) < SLACK
    errors = [bool(row.error) for row in seen.after]
    last = seen.after[-1]
    if fault == "dead":
        assert (master, last.link_state) == ("Ecos", LOST), "which goes on whatever is said"
        return
    assert len(seen.before) == GOOD
    assert seen.before[-1].link_state == CONNECTED
    assert seen.before[-1].charge_age < MAX_AGE
    if fault == "stop":
        if master != "Ecos":
            assert any(errors[:AT_ONCE])
            assert all(errors[AT_ONCE:])
        if master != "libcosim":
            assert all(row.link_state == LOST for row in seen.after[AT_ONCE:])
            assert last.charge_age > (AFTER - AT_ONCE - 1) * STEP
            assert last.round_trip_time > (AFTER - AT_ONCE - 1) * STEP
        return
    assert not any(errors)
    assert last.link_state == (STALE if fault == "late" else LOST)
    assert last.charge_age > (MAX_AGE if fault == "late" else (AFTER - 2) * STEP)


@pytest.mark.slow
def test_the_page_has_a_row_of_every_case(tmp_path):
    seen = observe("fmpy", "native", "dead", tmp_path)
    written = page([("dead", "fmpy", "native", seen)])
    row = written.splitlines()[-1]
    assert row.startswith(f"| {FAULTS['dead']} | fmpy | native | does not begin |")
    assert row.count("|") == written.splitlines()[-2].count("|")
    assert LINK_STATES[LOST] == "lost"
