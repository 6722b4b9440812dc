"""Under which names a record may have the signals of a system."""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.records import Record
from orchestration.system import Member, Port, System, connect, signal_names
from orchestration.system.model import Connection
from orchestration.system.signals import columns_of
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


@pytest.mark.parametrize(("factor", "shared"), [(1.0, True), (2.0, False)])
def test_ends_of_a_connection_are_read_from_one_column_unless_it_scales(tmp_path, factor, shared):
    fmu = build_one_state_fmu(tmp_path)
    connection = Connection(Port("a", "x"), Port("b", "u"), factor=factor)
    system = System("two", (Member("a", fmu), Member("b", fmu)), (connection,))
    time = np.arange(3.0)
    record = Record(time, {"a.x": time}, {"a.x": "1"}, tmp_path / "two.csv")
    columns = columns_of(system, record, {})
    assert columns.pop(Port("a", "x")) == ("a.x", "")
    assert columns == ({Port("b", "u"): ("a.x", "")} if shared else {})


def test_a_name_that_all_ends_share_needs_no_member(tmp_path):
    fmu = build_one_state_fmu(tmp_path)
    ring = System("ring", (Member("a", fmu), Member("b", fmu)), connect("a.x -> b.u", "b.x -> a.u"))
    assert "u" not in signal_names(ring)
    fed = System(
        "fed", (Member("a", fmu), Member("b", fmu)), (), {"d": (Port("a", "u"), Port("b", "u"))}
    )
    assert signal_names(fed)["u"] == Port("a", "u")
