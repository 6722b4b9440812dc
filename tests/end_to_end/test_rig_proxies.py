"""Proxies at the project's own server: whose rig it is, and who may not have it back."""

from __future__ import annotations

import time

import pytest

from orchestration.rig import Endpoint, ask, operator, read_endpoint
from tests.contract.raw import ERROR, OK, Instance, instance
from tests.support.rig.process import Server
from tests.support.rig.proxies import set_text

pytestmark = [pytest.mark.real_time, pytest.mark.parametrize("fmi", [2, 3])]

CONNECTED, LOST = 0, 3
STEP = 0.02
WATCHDOG = 0.5  # s, that a busy machine keeps
OPTIONS = {"signals": "force-driven", "noise": "off"}


@pytest.fixture
def server(tmp_path):
    with Server(
        tmp_path, "emulator", "--rate", "200", "--watchdog", WATCHDOG, options=OPTIONS
    ) as server:
        server.wait_ready()
        yield server


def connected(one: Instance, endpoint: str, **texts: str) -> Instance:
    for name, text in ({"endpoint": endpoint} | texts).items():
        assert set_text(one, name, text) == OK
    return one.initialize({"current": 0.5})


def steps(one: Instance, count: int) -> list[int]:
    """Status of steps; one that fails is the last."""
    found = []
    while len(found) < count and ERROR not in found:
        found.append(one.call("fmi2DoStep", one.time, STEP, 1))
        one.time += STEP
    return found


def wait_for(remote: Endpoint, state: str) -> None:
    """Wait until the rig is in a state, which a busy machine reaches later."""
    until = time.monotonic() + 10.0
    while (now := ask(remote, "status")["state"]) != state:
        assert time.monotonic() < until, now
        time.sleep(0.01)


@pytest.mark.slow
def test_a_second_proxy_is_refused_and_the_first_goes_on(fmu, runtime, fmi, server):
    with (
        instance(fmu("rig_proxy", runtime, fmi)) as one,
        instance(fmu("rig_proxy", runtime, fmi)) as other,
    ):
        connected(one, server.endpoint)
        with pytest.raises(AssertionError, match=r"refuses: .*rig_proxy"):
            connected(other, server.endpoint)
        assert steps(one, 5) == [OK] * 5
        other.do("fmi2Reset")
        with pytest.raises(AssertionError, match=r"refuses: .*rig_proxy"):
            connected(other, server.endpoint)
        assert steps(one, 5) == [OK] * 5
        assert one.get("link_state") == [CONNECTED]


@pytest.mark.slow
def test_a_first_command_may_come_later_than_the_watchdog(fmu, runtime, fmi, server):
    with instance(fmu("rig_proxy", runtime, fmi)) as one:
        connected(one, server.endpoint)
        time.sleep(2.0 * WATCHDOG)
        assert steps(one, 5) == [OK] * 5
        assert one.get("link_state") == [CONNECTED]


@pytest.mark.slow
def test_after_a_stop_and_its_acknowledgement_nothing_comes_back(fmu, runtime, fmi, server):
    """However often the proxy is stepped, and whatever it holds."""
    remote = read_endpoint(server.endpoint)
    with instance(fmu("rig_proxy", runtime, fmi)) as one:
        connected(one, server.endpoint, on_stale="hold")
        assert steps(one, 10) == [OK] * 10
        stopped = ask(remote, "stop", reason="the emergency stop was pressed")
        assert steps(one, 20)[-1] == ERROR
        assert "the emergency stop was pressed" in one.messages[-1]
        assert one.get("link_state") == [LOST]
        wait_for(remote, "safe")
        assert operator.acknowledge(remote, stopped["latch"])["state"] == "idle"
        steps(one, 20)
        status = ask(remote, "status")
        assert (status["state"], status["client"]) == ("idle", "")
        first = one.get("voltage_age", "round_trip_time")
        time.sleep(0.3)
        for before, after in zip(first, one.get("voltage_age", "round_trip_time"), strict=True):
            assert after - before >= 0.3
