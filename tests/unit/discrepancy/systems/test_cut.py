"""What is cut where: every input and output of a member, under all the names of its signal."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.discrepancy.report.system import describe_reason
from orchestration.discrepancy.systems.cut import InputOrigin, ReasonCode, isolated_members
from orchestration.system import Member, Port, System
from orchestration.system.model import Connection
from tests.support.hosts import build_one_state_fmu


@pytest.fixture
def system(tmp_path):
    fmu = build_one_state_fmu(tmp_path)
    return System(
        "two",
        (Member("a", fmu), Member("b", fmu)),
        (Connection(Port("a", "x"), Port("b", "u"), factor=2.0, offset=0.5),),
        {"drive": (Port("a", "u"),)},
        {"shown": Port("b", "x")},
    )


def test_signals_arrive_converted(system):
    values = np.linspace(0.0, 1.0, 50)
    measured = {Port("a", "x"): values, Port("b", "x"): values}
    first, second = isolated_members(system, measured, {Port("a", "u"): 1.0})
    assert first.inputs["u"].value == 1.0
    assert first.inputs["u"].origin is InputOrigin.SETTING
    assert second.inputs["u"].values == pytest.approx(2.0 * values + 0.5)
    assert (second.inputs["u"].origin, second.inputs["u"].signal) == (
        InputOrigin.UPSTREAM,
        Port("a", "x"),
    )
    assert first.reason_not_assessable == second.reason_not_assessable == []


def test_an_output_may_be_measured_where_it_arrives(system):
    values = np.linspace(0.0, 1.0, 50)
    back, fed = isolated_members(system, {Port("b", "u"): values}, {})
    assert back.outputs["x"] == pytest.approx((values - 0.5) / 2.0)
    assert fed.inputs["u"].origin is InputOrigin.MEASURED
    assert {name: reason.facts["signal"] for name, reason in back.missing.items()} == {"u": "drive"}
    assert [describe_reason(reason) for reason in back.reason_not_assessable] == [
        "u is not measured (measure drive)"
    ]


def test_an_input_with_holes_is_missing(system):
    values = np.linspace(0.0, 1.0, 50)
    holes = np.where(values > 0.5, np.nan, values)
    _, fed = isolated_members(system, {Port("a", "x"): holes, Port("b", "x"): values}, {})
    (reason,) = fed.reason_not_assessable
    assert reason.code is ReasonCode.INPUT_WITH_GAPS
    assert describe_reason(reason) == "u is not measured (measure a.x without holes)"
