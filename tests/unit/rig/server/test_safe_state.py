"""Claims: safe is what the device reports, also later; what it does not is commanded again."""

from __future__ import annotations

from dataclasses import replace

import pytest

from orchestration.rig.backends import Limit
from orchestration.rig.server import safe_state as module
from orchestration.rig.server.calls import BackendSignals
from orchestration.rig.server.safe_state import SafeState

SIGNALS = BackendSignals(
    {"current": "A", "valve": "1"},
    {},
    {"current": Limit(-1.0, 1.0), "valve": Limit(0.0, 1.0)},
    safe_values=(0.0, 1.0),
)


class Device:
    """A device with a valve that is open in its safe state."""

    def __init__(self):
        self.now, self.held, self.reports = 1000.0, (0.5, 0.0), True
        self.safes = 0
        self.obeys = True

    def safe(self):
        self.safes += 1
        if self.obeys:
            self.held = (0.0, 1.0)

    def read_back(self):
        return dict(zip(SIGNALS.inputs, self.held, strict=True)) if self.reports else {}


@pytest.fixture
def device(monkeypatch):
    made = Device()
    monkeypatch.setattr(module, "monotonic", lambda: made.now)
    return made


@pytest.fixture
def state(device):
    return SafeState(device, SIGNALS, lambda name: None)


def keep(state, device, seconds):
    """Keep the state for a while; return the sentences about it."""
    told = []
    for _ in range(round(seconds / 0.01)):
        device.now += 0.01
        told += filter(None, [state.keep()])
    return told


def test_it_is_safe_when_the_device_has_its_safe_values(state, device):
    assert state.command() == ""
    assert (state.since, state.is_denied) == (1000.0, False)
    assert keep(state, device, 5.0) == []
    assert (state.since, device.safes) == (1000.0, 1)


def test_one_that_leaves_it_is_brought_back_within_a_fifth_of_a_second(state, device):
    state.command()
    device.held = (1.0, 1.0)
    (told,) = keep(state, device, 0.2)
    assert told == "in the safe state the device has current = 1 A; it is commanded again"
    assert device.held == (0.0, 1.0)
    assert 1000.0 < state.since <= 1000.2
    assert not state.is_denied


def test_one_that_does_not_follow_is_denied_within_half_a_second_and_commanded_on(state, device):
    device.obeys = False
    assert state.command() == ""
    assert state.since == 0.0
    (told,) = keep(state, device, 0.4)
    assert "current = 0.5 A, valve = 0 1" in told
    assert state.is_denied
    assert device.safes >= 3
    assert keep(state, device, 5.0) == [], "it is told once"
    device.obeys = True
    keep(state, device, 0.2)
    assert state.since > 1005.0
    assert not state.is_denied


def test_one_that_takes_a_moment_to_follow_is_not_denied(state, device):
    device.obeys = False
    state.command()
    assert keep(state, device, 0.2) == []
    device.held = (0.0, 1.0)
    keep(state, device, 0.05)
    assert state.since > 0.0


def test_rounding_by_the_device_is_no_difference(state, device):
    state.command()
    device.held = (0.015, 0.995)
    assert keep(state, device, 1.0) == []
    device.held = (0.03, 1.0)
    assert len(keep(state, device, 0.2)) == 1


def test_what_is_not_reported_is_commanded_again(device):
    state = SafeState(device, replace(SIGNALS, unreported=["current", "valve"]), lambda name: None)
    device.reports = False
    state.command()
    assert state.since == 1000.0
    assert keep(state, device, 1.0) == []
    assert device.safes >= 6


def test_a_rig_that_is_commanded_is_not_safe(state, device):
    state.command()
    state.leave()
    assert (state.since, state.is_denied) == (0.0, False)
