"""Emulator backend: in lockstep the bits of the rig stepped directly, else at the clock's pace."""

from __future__ import annotations

import time

import numpy as np
import pytest

from demonstrations.backend import Emulator
from demonstrations.emulator.physics import Physics, RigParameters
from demonstrations.emulator.stepping.plants import ForceDriven
from demonstrations.emulator.stepping.rig import SteppedRig
from fmus.kit.errors import UserError
from orchestration.rig.signals import SIGNALS

P = RigParameters()


def commands(rig: Emulator, k: int) -> dict[str, float]:
    values = {
        "current": np.sin(k / 5),
        "force": 1 + np.cos(k / 9),
        "length_change": 1e-4 * np.cos(k / 9),
    }
    values |= {"force_reference": 1 + np.cos(k / 9)}
    return {name: float(values[name]) for name in rig.inputs}


@pytest.mark.parametrize("step", [1 / 30, 1e-3, 0.25])
def test_in_lockstep_it_is_the_rig_stepped_directly(step: float) -> None:
    rig, direct = (
        Emulator(noise="off"),
        SteppedRig(ForceDriven(Physics(P)), SIGNALS["force-driven"].outputs),
    )
    rig.read()  # as on connecting, which must not start a clock
    time.sleep(0.01)
    for k in range(60):
        values = commands(rig, k)
        rig.write(values)
        rig.advance(step)
        direct.command(values)
        direct.advance(step)
        assert rig.read() == direct.true()
        assert rig.read() == direct.true()  # asking does not change it


@pytest.mark.parametrize("signals", SIGNALS)
def test_options_alike_give_the_same_bits(signals: str) -> None:
    def run() -> list[object]:
        rig = Emulator(signals=signals, seed="7", hidden="drawn", specimen="drawn")
        rows: list[object] = [rig.tell()]
        for k in range(20):
            rig.write(commands(rig, k))
            rig.advance(1 / 30)
            rows.append(dict(rig.read()))
        return rows

    assert run() == run()


def test_a_seed_changes_noise_specimen_and_hidden_effect() -> None:
    def voltage(**options: str) -> float:
        rig = Emulator(**options)
        rig.write({"current": 1.0, "force": 1.0})
        rig.advance(1.0)
        return rig.read()["voltage"]

    assert voltage(seed="1") != voltage(seed="2")
    assert voltage(seed="1", noise="off") == voltage(seed="2", noise="off")
    assert voltage(seed="1", noise="off", specimen="drawn") != voltage(
        seed="2", noise="off", specimen="drawn"
    )
    drawn = {Emulator(seed=str(k), hidden="drawn").tell() for k in range(20)}
    assert len(drawn) == 20
    assert Emulator().tell() == "nothing is hidden"


def test_every_sample_has_noise_of_its_own() -> None:
    rig, values = Emulator(seed="3"), []
    for _ in range(400):
        rig.write({"current": 0.0, "force": 0.0})  # at rest, so that all there is is noise
        rig.advance(1 / 30)
        values.append([rig.read()[name] for name in ("voltage", "displacement", "charge")])
    voltage, displacement, charge = np.std(values, axis=0)
    assert voltage == pytest.approx(4e-3, rel=4 / np.sqrt(2 * 400))
    assert displacement == pytest.approx(3e-6, rel=4 / np.sqrt(2 * 400))
    assert charge == 0.0  # nobody measures it


def test_in_real_time_it_goes_on_by_itself() -> None:
    rig = Emulator(noise="off")
    rig.read()
    time.sleep(0.05)
    assert rig.read()["charge"] == 0.0
    began = time.monotonic()
    rig.write({"current": 1.0, "force": 0.0})
    charges = []
    while (passed := time.monotonic() - began) < 0.3:
        charges.append((passed, rig.read()["charge"]))
        time.sleep(0.003)
    constant = (P.R1 + P.R2) * P.C
    for passed, charge in charges:
        exact = P.R2 * P.C * (1 - np.exp(-passed / constant))
        assert abs(charge - exact) < 0.02  # 20 ms of a machine that is busy, at 0.85 A
    final = charges[-1][1]
    assert final > 0.2


def test_a_command_holds_from_when_it_was_written() -> None:
    rig = Emulator(noise="off")
    rig.write({"current": 1.0, "force": 0.0})
    time.sleep(0.1)
    rig.write({"current": 0.0, "force": 0.0})  # nobody has read in between
    assert rig.read()["charge"] > 0.05


def test_a_pause_of_the_process_is_not_made_up_for_in_full(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Emulator(noise="off")
    rig.write({"current": 1.0, "force": 0.0})
    real = time.perf_counter
    monkeypatch.setattr(time, "perf_counter", lambda: real() + 3600.0)
    charge = rig.read()["charge"]
    exact = P.R2 * P.C * (1 - np.exp(-2.0 / (P.R1 + P.R2) / P.C))
    assert charge == pytest.approx(exact, abs=0.05)


@pytest.mark.parametrize("signals", SIGNALS)
def test_safe_and_close_work_at_any_time_and_twice(signals: str) -> None:
    rig = Emulator(signals=signals, noise="off")
    rig.safe()
    rig.safe()
    rig.write(commands(rig, 3))
    rig.advance(1.0)
    rig.safe()
    rig.advance(0.2)
    values = rig.read()
    assert values.get("coil_voltage", 0.0) == 0.0
    # without a current the terminal voltage is that of the charge, divided by both resistances
    divided = values["charge"] / P.C * P.R2 / (P.R1 + P.R2)
    assert values["voltage"] == pytest.approx(divided, rel=1e-9)
    rig.close()
    rig.close()
    rig.safe()


def test_limits_are_those_of_the_thesis() -> None:
    limits = Emulator(signals="bench").limits
    assert (limits["current"].min, limits["current"].max) == (-1.3, 1.3)
    assert (limits["force_reference"].min, limits["force_reference"].max) == (0.0, 3.0)
    assert set(limits) <= {*SIGNALS["bench"].inputs, *SIGNALS["bench"].outputs}


@pytest.mark.parametrize("step", [-1.0, float("nan"), float("inf"), 61.0])
def test_a_step_that_is_none_is_refused(step: float) -> None:
    rig = Emulator()
    with pytest.raises(UserError, match=r"must be from 0 to 60 s"):
        rig.advance(step)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"current": 1.0}, "command force = missing"),
        ({"current": float("nan"), "force": 0.0}, "command current = nan"),
        (
            {"current": 0.0, "force": 0.0, "forse": 0.0},
            r"command 'forse': not an input of this rig \(did you mean force",
        ),
    ],
)
def test_commands_that_are_none_are_refused(values: dict[str, float], message: str) -> None:
    with pytest.raises(UserError, match=message):
        Emulator().write(values)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"signals": "force"}, r"option signals = 'force' \(did you mean force-driven\?\)"),
        ({"seed": "1.5"}, "option seed = '1.5': must be a whole number of at least 0"),
        ({"noise": "yes"}, r"option noise = 'yes' \(there are: on, off\)"),
        (
            {"hidden": "everything"},
            "option hidden: hidden effect 'everything': there are none, drawn",
        ),
        ({"specimen": "other"}, "option specimen = 'other'"),
    ],
)
def test_wrong_options_are_told(options: dict[str, str], message: str) -> None:
    with pytest.raises(UserError, match=message):
        Emulator(**options)
