"""Probe: it speaks to a server that is idle, commands next to nothing, and leaves it idle."""

from __future__ import annotations

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.endpoint import read_endpoint
from orchestration.rig.operator import ask, stop
from tests.support.rig.conformance.probe import ConformancePeer, Probe
from tests.support.rig.small_rig import free_port

pytestmark = pytest.mark.real_time


@pytest.fixture
def probe(server):
    with server() as remote:
        made = Probe(remote)
        yield made
        made.close()


def test_the_command_is_the_one_within_limits_that_is_nearest_to_zero(probe):
    assert probe.zero() == [0.0, 0.0]
    probe.about["limits"] = {"current": {"min": 0.5, "max": None}, "force": {"max": -1.0}}
    assert probe.zero() == [0.5, -1.0]


def test_it_leaves_the_rig_idle(probe):
    probe.session().exchange(1)
    probe.settle()
    assert ask(probe.remote, "status")["state"] == "idle"
    stop(probe.remote, "smoke")
    probe.settle()
    assert ask(probe.remote, "status")["state"] == "idle"


def test_a_rig_in_use_is_let_alone(server):
    with server() as remote:
        latch = stop(remote, "smoke")["latch"]
        with pytest.raises(
            UserError, match="is safe; conformance is tried with a rig that is idle"
        ):
            Probe(remote)
        assert ask(remote, "status")["latch"] == latch


def test_a_server_that_does_not_answer_is_told(monkeypatch):
    monkeypatch.setattr(ConformancePeer.receive, "__defaults__", (0.2,))
    with pytest.raises(UserError, match=r"no answer to status .* is it a server of this protocol"):
        Probe(read_endpoint(f"tcp://127.0.0.1:{free_port()}"))
