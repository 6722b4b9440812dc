"""Claims: the partners of a member are those that feed it and are fed by it, and can be relied on.

That a member which runs away alone is judged in its loop is a claim of the whole diagnosis.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.systems.cut import isolated_members
from orchestration.discrepancy.systems.in_loop import (
    LoopSimulation,
    connections_between,
    loop_members,
    partners_of,
)
from orchestration.discrepancy.systems.member import opened
from orchestration.discrepancy.systems.verdict import Effort, diagnose_member, not_assessed
from orchestration.system import Member, Port, System
from orchestration.system.model import Connection
from tests.support.hosts import build_one_state_fmu

STEP = 0.05
TIME = STEP * np.arange(400)


@pytest.fixture
def system(tmp_path):
    """Two lags that feed each other, and a third that is only fed."""
    fmu = build_one_state_fmu(tmp_path)
    there = Connection(Port("a", "x"), Port("b", "u"))
    back = Connection(Port("b", "x"), Port("a", "u"), factor=-0.5, offset=1.0)
    onward = Connection(Port("b", "x"), Port("c", "u"))
    members = (Member("a", fmu), Member("b", fmu), Member("c", fmu))
    return System("loop", members, (there, back, onward), step=STEP)


@pytest.fixture
def measured():
    """The closed loop of both, integrated by Euler's method in a hundredth of a sample."""
    a = b = c = 0.0
    rows = []
    for k in range(100 * TIME.size):
        if k % 100 == 0:
            rows.append((a, b, c))
        slope = (1.0 - 0.5 * b - a, a - b, b - c)
        a, b, c = (x + 0.01 * STEP * s for x, s in zip((a, b, c), slope, strict=True))
    columns = np.array(rows).T
    return {Port(name, "x"): y for name, y in zip("abc", columns, strict=True)}


def test_partners_feed_a_member_and_are_fed_by_it(system):
    assert [loop_members(system, name) for name in "abc"] == [["b"], ["a"], []]
    there, back, _ = system.connections
    assert connections_between(system, "a", ["b"]) == [there, back]


def test_a_partner_that_cannot_be_assessed_is_not_relied_on(system, measured):
    isolated = isolated_members(system, measured, {})
    with opened(isolated[0], TIME, 50, lambda used: None) as simulation:
        judged = diagnose_member(simulation, Effort(simulations=20, parameters=1))
        (partner,) = partners_of(system, "b", {"a": simulation}, {"a": judged})
        assert partner.name == "a"
        assert partners_of(system, "b", {}, {"a": not_assessed(isolated[0], [])}) == []
        holed = measured | {Port("a", "x"): np.where(TIME > 5.0, np.nan, measured[Port("a", "x")])}
        with opened(isolated_members(system, holed, {})[0], TIME, 50, lambda used: None) as gaps:
            assert partners_of(system, "b", {"a": gaps}, {"a": judged}) == []


def test_a_loop_follows_what_was_measured(system, measured):
    first, second, _ = isolated_members(system, measured, {})
    effort = Effort(simulations=20, parameters=1)
    with opened(second, TIME, 50, lambda used: None) as other:
        judged = {"b": diagnose_member(other, effort)}
        partners = partners_of(system, "a", {"b": other}, judged)
        with opened(first, TIME, 50, lambda used: None) as alone:
            loop = LoopSimulation(
                isolated=first,
                time=TIME,
                folder=alone.folder,
                budget=5,
                progress=lambda used: None,
                partners=partners,
                connections=connections_between(system, "a", ["b"]),
                parts=10,
            )
            simulated = loop.simulate({})["x"]
    assert simulated == pytest.approx(measured[Port("a", "x")], abs=0.01)
