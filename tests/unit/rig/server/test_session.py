"""Sessions of clients: which signals fit, and which exchange counts."""

from __future__ import annotations

import pytest

from orchestration.rig.access import Peer
from orchestration.rig.keys import KeyHolder
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.session import describe_misfit, new_session

PEER = Peer(b"peer", KeyHolder("lab", "command"), "127.0.0.1")
SIGNALS = BackendSignals(
    {"current": "A", "force": "N"}, {"voltage": "V", "displacement": "m", "charge": "C"}, {}
)


def message(inputs=None, outputs=None):
    return {
        "client": "lab",
        "instance": "one",
        "inputs": {"current": "A", "force": "N"} if inputs is None else inputs,
        "outputs": {"charge": "C"} if outputs is None else outputs,
    }


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (message(), ""),
        (message(outputs={}), ""),
        (message(inputs={"curent": "A"}), "no curent among its inputs (did you mean current?)"),
        (message(outputs={"tension": "N"}), "no tension among its outputs"),
        (message(inputs={"current": "mA", "force": "N"}), "current is in 'A' on the rig, not in"),
        (message(inputs={"current": "A"}), "must command every input of the rig; force is missing"),
    ],
)
def test_a_client_must_fit_the_rig(given, reason):
    said = describe_misfit(given, SIGNALS)
    assert (reason in said) if reason else not said


def test_signals_have_places_in_the_order_of_the_other_side():
    given = message({"force": "N", "current": "A"}, {"charge": "C", "voltage": "V"})
    session = new_session(given, SIGNALS, PEER, 5.0)
    assert session.commanded == [1, 0]  # of current and force, among the client's values
    assert session.wanted == [2, 0]  # of charge and voltage, among the rig's
    assert session.heard == session.begun == 5.0
    assert new_session(given, SIGNALS, PEER, 5.0).key != session.key


def test_an_exchange_that_came_before_is_counted():
    session = new_session(message(), SIGNALS, PEER, 0.0)
    session.sequence = 7
    counts = {"late": 0, "repeated": 0}
    assert not session.repeats({"sequence": 8}, counts)
    assert counts == {"late": 0, "repeated": 0}
    assert session.repeats({"sequence": 7}, counts)
    assert session.repeats({"sequence": 6}, counts)
    assert counts == {"late": 1, "repeated": 1}


def test_a_client_that_never_commands_has_ten_seconds():
    session = new_session(message(), SIGNALS, PEER, 100.0)
    assert not session.never_began(110.0)
    assert session.never_began(110.1)
    session.sequence = 1
    assert not session.never_began(1000.0)
    assert not session.is_silent(102.0)
    assert session.is_silent(102.1)
