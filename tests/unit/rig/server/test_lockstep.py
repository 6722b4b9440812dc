"""Lockstep: time is the sum of the steps, and a backend that raises goes to its safe state."""

from __future__ import annotations

import pytest

from fmus.kit.errors import UserError
from orchestration.rig.server.lockstep import LockstepRig
from orchestration.rig.server.settings import ServerSettings
from tests.support.rig import backends

STEPPED = f"{backends.__file__}:Stepped"


@pytest.fixture
def rig(tmp_path):
    log = {"log": str(tmp_path / "log")}
    made = LockstepRig(ServerSettings(STEPPED, options=log, lockstep=True))
    yield made
    made.close()


def test_time_is_the_sum_of_the_steps(rig):
    assert (rig.clock(), rig.watchdog, rig.opening()) == (0.0, 0.0, "")
    rig.apply([0.5, 1.0], rig.clock())
    for step in (0.25, 0.5, 0.0):
        rig.advance(step)
    state = rig.state()
    assert rig.clock() == 0.75
    assert state.applied == (0.5, 1.0)
    assert state.values == (0.375, 1.0)  # charge of 0.5 A over 0.75 s, and the force
    assert state.ages(rig.clock()) == [0.0, 0.0]
    assert state.number == 4  # one on opening


def test_at_rest_nothing_is_commanded(rig):
    rig.apply([0.5, 1.0], 0.0)
    rig.go_safe()
    assert rig.state().applied == (0.0, 0.0)
    rig.advance(1.0)
    assert rig.state().values == (0.0, 0.0)
    assert rig.troubles() == []


def test_a_measured_value_beyond_its_limit_is_a_trouble(rig):
    rig.apply([1.0, 0.0], 0.0)
    rig.advance(3.0)  # a charge of 3, beyond the limit of 2
    (trouble,) = rig.troubles()
    assert "measured voltage 3 V is above 2 V" in trouble
    assert rig.troubles() == []


def test_a_backend_that_raises_is_opened_anew_on_release(rig, monkeypatch):
    def broken(step):
        raise OSError("the cable is off")

    monkeypatch.setattr(rig._backend, "advance", broken)
    rig.apply([0.5, 1.0], 0.0)
    rig.advance(1.0)
    assert rig.troubles() == ["advance() raised OSError: the cable is off"]
    assert rig.state().applied == (0.0, 0.0)
    assert rig.clock() == 0.0
    rig.apply([0.5, 1.0], 0.0)
    rig.advance(1.0)
    assert rig.clock() == 0.0, "nothing moves until it is released"
    rig.release()
    rig.advance(1.0)
    assert rig.clock() == 1.0


def test_a_rig_whose_time_is_its_own_is_refused():
    with pytest.raises(UserError, match="--lockstep: the time of"):
        LockstepRig(ServerSettings(f"{backends.__file__}:Logged", lockstep=True))


def test_a_real_device_is_refused(tmp_path):
    options = {"log": str(tmp_path / "log"), "trigger": ""}
    with pytest.raises(UserError, match="RealStepped commands integrator; without a watchdog"):
        LockstepRig(ServerSettings(f"{backends.__file__}:RealStepped", options=options))
    assert not (tmp_path / "log").exists()
