"""Claims: a system is cut at what was measured, and closed where nothing was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orchestration.diagnosis.systems.parts import Cuts, InputOrigin
from orchestration.system import Connection, Member, Port, System, connect, library
from tests.support.hosts import build_one_state_fmu

VALUES = np.linspace(0.0, 1.0, 50)
A, B = Port("a", "x"), Port("b", "x")


@pytest.fixture
def system(tmp_path: Path) -> System:
    fmu = build_one_state_fmu(tmp_path)
    return System(
        "two",
        (Member("a", fmu), Member("b", fmu)),
        (Connection(A, Port("b", "u"), factor=2.0, offset=0.5),),
        {"drive": (Port("a", "u"),)},
        {"shown": B},
    )


def test_signals_arrive_converted(system: System) -> None:
    first, second = Cuts(system, {A: VALUES, B: VALUES}, {Port("a", "u"): 1.0}).parts()
    given = first.inputs[Port("a", "u")]
    assert (given.origin, given.value) == (InputOrigin.SETTING, 1.0)
    fed = second.inputs[Port("b", "u")]
    assert fed.values == pytest.approx(2.0 * VALUES + 0.5)
    assert (fed.origin, fed.signal) == (InputOrigin.UPSTREAM, A)
    assert first.missing == second.missing == ()


def test_an_output_may_be_measured_where_it_arrives(system: System) -> None:
    back, fed = Cuts(system, {Port("b", "u"): VALUES}, {}).parts()
    assert back.outputs[A] == pytest.approx((VALUES - 0.5) / 2.0)
    assert fed.inputs[Port("b", "u")].origin is InputOrigin.MEASURED
    assert back.missing == (("u", "drive"),)


@pytest.mark.parametrize("measured", [{}, {A: np.where(VALUES > 0.5, np.nan, VALUES)}])
def test_where_nothing_is_known_all_the_time_members_are_one_part(
    system: System, measured: dict[Port, np.ndarray]
) -> None:
    (whole,) = Cuts(system, measured | {B: VALUES, Port("a", "u"): VALUES}, {}).parts()
    assert whole.names == ["a", "b"]
    assert whole.connections == system.connections
    assert whole.inputs[Port("b", "u")].origin is InputOrigin.LOOP
    assert set(whole.outputs) == {B, *measured}
    assert whole.classes is None


def test_a_member_is_closed_with_those_of_its_loop_alone(tmp_path: Path) -> None:
    fmu = build_one_state_fmu(tmp_path)
    members = tuple(Member(name, fmu) for name in "abc")
    ring = System("ring", members, connect("a.x -> b.u", "b.x -> a.u"))
    cuts = Cuts(ring, {A: VALUES, B: VALUES, Port("c", "u"): VALUES}, {})
    parts = cuts.parts()
    assert [part.names for part in parts] == [["a"], ["b"], ["c"]]
    assert cuts.loop_members("a") == ["b"]
    assert [part.names for part in cuts.closed(parts, ["b"])] == [["a", "b"], ["c"]]


def test_a_switch_that_nobody_recorded_is_as_it_starts() -> None:
    """The stand's button for zero was not touched; its weights have to be known."""
    stand = library.system("isotonic_stand")
    known = {Port("stand", "displacement_measured"): VALUES}
    (whole,) = Cuts(stand, known, {Port("galvanostat", "current_command"): 0.0}).parts()
    zero = whole.inputs[Port("stand", "zero")]
    assert (zero.origin, zero.value) == (InputOrigin.DEFAULT, 0.0)
    assert whole.missing == (("mass", "mass"),)


def test_members_that_a_loop_feeds_are_those_of_which_a_partner_is_elsewhere() -> None:
    """The galvanostat feeds the actuator, whose stand is fed by nobody else."""
    stand = library.system("isotonic_stand")
    measured = ("galvanostat.current", "actuator.voltage", "stand.displacement_measured")
    known = {stand.port(name): VALUES for name in (*measured, "stand.mass")}
    cuts = Cuts(stand, known | {stand.port("galvanostat.current_command"): VALUES}, {})
    alone, both = cuts.parts()
    assert both.names == ["actuator", "stand"]
    assert cuts.fed_by_loops(both) == ["actuator"]
    assert cuts.fed_by_loops(alone) == ["galvanostat"]
    (whole,) = cuts.closed([alone, both], ["stand"])
    assert cuts.fed_by_loops(whole) == []
