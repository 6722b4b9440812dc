"""Claims: the emulated bench is the fused system of the components, which share no code with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from demonstrations.emulator.hidden_coupling import SaturatingStrain
from demonstrations.emulator.hidden_electrical import DoubleLayer
from demonstrations.emulator.hidden_mechanical import LoadDependentSpring, SaggingFilm
from demonstrations.emulator.physics import Physics, RigParameters
from demonstrations.emulator.stepping.bench import BenchPlant
from demonstrations.emulator.stepping.hidden import hidden_effect
from demonstrations.emulator.stepping.plants import LengthDriven
from demonstrations.emulator.stepping.rig import SteppedRig
from demonstrations.emulator.variations import CATALOGUE
from fmus.kit.record.compiled import CompiledModel
from orchestration.master.reference.fused import fuse
from orchestration.rig.signals import SIGNALS
from orchestration.system import library
from tests.support.rig.tension import tension_by_bisection

STEP = 0.004  # no divisor of the controller's period
MEMBERS = {
    "position": "bench",
    "velocity": "bench",
    "coil_current": "bench",
    "force_measured": "bench",
    "position_measured": "bench",
    "tension": "actuator",
    "electrochemical_displacement": "actuator",
    "mechanical_displacement": "actuator",
    "charge": "actuator",
}


def bench() -> SteppedRig:
    return SteppedRig(BenchPlant(Physics(RigParameters())), SIGNALS["bench"].outputs)


def test_it_is_the_fused_system_slack_and_saturation_included() -> None:
    time = STEP * np.arange(301)
    reference = np.select([time < 0.2, time < 0.6, time < 0.9], [0.0, 2.0, 20.0], 0.5)
    current = np.where(time < 0.5, 1.3, -1.3)
    exact = CompiledModel(fuse(library.system("dma_bench"))).run(
        time, {"force_reference": reference, "current": current}
    )
    rig, found = bench(), []
    for k in range(300):
        rig.command({"force_reference": reference[k], "current": current[k]})
        rig.advance(STEP)
        found.append(rig.true())
    for name, member in MEMBERS.items():
        expected = exact.signals[f"{member}.{name}"][1:]
        values = np.array([row[name] for row in found])
        assert np.abs(values - expected).max() < 1e-5 * np.abs(expected).max(), name
    tension = np.array([row["tension"] for row in found])
    assert tension.max() > 5
    assert (tension == 0).sum() > 10
    assert max(row["coil_voltage"] for row in found) == 10.0


@pytest.mark.parametrize("kind", [DoubleLayer, SaturatingStrain, LoadDependentSpring, SaggingFilm])
def test_with_an_effect_it_solves_the_laws(kind: type[Physics]) -> None:
    """Coil, slide and sensors written out, the tension by bisection, an adaptive solver between
    samples.
    """
    physics, period = kind(RigParameters()), 1 / 30
    rig, n = (
        SteppedRig(BenchPlant(physics), ("position", "force_measured", "charge", "tension")),
        physics.order,
    )
    state, volts, before = np.zeros(n + 5), 0.0, 0.0

    def slope(_: float, y: np.ndarray, volts: float, current: float) -> list[Any]:
        i, x, v, force, position = y[n:]
        pull, corner = tension_by_bisection(physics, y[:n], x), 2 * np.pi * 100
        return [
            *physics.rates(y[:n], current, pull),
            (volts - 3.0 * i - 3.9 * v) / 1e-3,
            v,
            (3.9 * i - 6.0 * v - pull) / 0.03,
            corner * (pull - force),
            corner * (x - position),
        ]

    for k in range(10):
        reference, current = (2.0, 0.1)[k > 6], (1.3, -1.3)[k % 2]
        rig.command({"force_reference": reference, "current": current})
        rig.advance(period)
        error = reference - state[n + 3]
        volts, before = min(max(volts + 0.66 * error - 0.06 * before, 0.0), 10.0), error
        state = solve_ivp(
            slope, (0, period), state, "DOP853", args=(volts, current), rtol=1e-9, atol=1e-12
        ).y[:, -1]
        pull = tension_by_bisection(physics, state[:n], state[n + 1])
        exact = {
            "position": state[n + 1],
            "force_measured": state[n + 3],
            "charge": state[0],
            "tension": pull,
        }
        scale = {"position": 3e-4, "force_measured": 2.0, "charge": 0.1, "tension": 2.0}
        for name, value in rig.true().items():
            assert abs(value - exact[name]) < 1e-6 * scale[name], name


@pytest.mark.parametrize("name", CATALOGUE)
@pytest.mark.parametrize("plant", [LengthDriven, BenchPlant])
def test_no_effect_at_no_command_within_the_limits_breaks_it(name: str, plant: Any) -> None:
    sensed = ("voltage",) if "" not in CATALOGUE[name].limits else ("voltage", "displacement")
    random = np.random.default_rng(len(name))
    rig = SteppedRig(
        plant(hidden_effect(name, 3, sensed).physics(RigParameters())),
        ("tension", "voltage", "charge"),
    )
    for _ in range(8):
        rig.command(
            {
                "current": random.choice([-1.3, 1.3]),
                "length_change": random.choice([-12.7e-3, 0.0, 5e-4]),
                "force_reference": random.choice([0.0, 3.0]),
            }
        )
        rig.advance(0.05)
        values = rig.true()
        assert all(np.isfinite(value) for value in values.values())
        assert values["tension"] >= 0


def test_a_long_step_is_many_short_ones() -> None:
    one, many = bench(), bench()
    for rig in (one, many):
        rig.command({"force_reference": 1.5, "current": 0.7})
    one.advance(0.5)
    for _ in range(125):
        many.advance(STEP)
    for name, value in one.true().items():
        assert abs(value - many.true()[name]) < 1e-9 * max(abs(value), 1e-4), name


def test_the_controller_is_equation_2_2() -> None:
    rig, volts, before = bench(), 0.0, 0.0
    for k in range(60):
        reference = 1.0 if k < 30 else 1.2 - 0.01 * k
        error = reference - rig.true()["force_measured"]
        volts, before = volts + 0.66 * error - 0.06 * before, error
        rig.command({"force_reference": reference, "current": 0.0})
        rig.advance(1 / 30)
        assert 0.0 < volts < 10.0
        assert rig.true()["coil_voltage"] == pytest.approx(volts, rel=1e-12)


def test_it_settles_at_the_force_that_is_wanted() -> None:
    rig = bench()
    rig.command({"force_reference": 2.0, "current": 0.0})
    rig.advance(2.0)
    assert abs(rig.true()["force_measured"] - 2.0) < 1e-3
    assert abs(rig.true()["coil_voltage"] - 2.0 * 3.0 / 3.9) < 0.01  # static: F = K V / R


def test_released_it_has_no_voltage_until_commanded_again() -> None:
    rig = bench()
    rig.command({"force_reference": 2.0, "current": 1.0})
    rig.advance(1.0)
    rig.release()
    assert rig.true()["coil_voltage"] == 0.0
    for _ in range(15):
        rig.advance(1 / 30)
        assert rig.true()["coil_voltage"] == 0.0
    released = rig.true()
    assert abs(released["tension"]) < 1e-3
    rig.command({"force_reference": 1.0, "current": 0.0})
    rig.advance(1.0)
    assert abs(rig.true()["force_measured"] - 1.0) < 2e-3
