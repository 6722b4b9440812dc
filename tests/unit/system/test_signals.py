"""Under which names a record may have the signals of a system."""

from __future__ import annotations

from orchestration.system import Member, Port, System, connect, signal_names
from orchestration.system.model import Connection
from tests.support.hosts import build_one_state_fmu


def test_signals_have_all_their_names(tmp_path):
    fmu = build_one_state_fmu(tmp_path)
    system = System(
        "two",
        (Member("a", fmu), Member("b", fmu)),
        (Connection(Port("a", "x"), Port("b", "u"), factor=2.0, offset=0.5),),
        {"drive": (Port("a", "u"),)},
        {"shown": Port("b", "x")},
    )
    names = signal_names(system)
    assert (names["drive"], names["shown"]) == (Port("a", "u"), Port("b", "x"))
    assert "x" not in names


def test_a_name_that_all_ends_share_needs_no_member(tmp_path):
    fmu = build_one_state_fmu(tmp_path)
    ring = System("ring", (Member("a", fmu), Member("b", fmu)), connect("a.x -> b.u", "b.x -> a.u"))
    assert "u" not in signal_names(ring)
    fed = System(
        "fed", (Member("a", fmu), Member("b", fmu)), (), {"d": (Port("a", "u"), Port("b", "u"))}
    )
    assert signal_names(fed)["u"] == Port("a", "u")
