"""Claims: the rig driven in time follows its equations, which an adaptive solver solves here, and
the components.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.hidden_coupling import EvenStrain, LaggingStrain, LoadDependentVoltage
from demonstrations.emulator.hidden_electrical import DiffusionLayer, DoubleLayer
from demonstrations.emulator.hidden_mechanical import LoadDependentSpring, SaggingFilm
from demonstrations.emulator.physics import Physics, RigParameters
from demonstrations.emulator.stepping.bench import BenchPlant
from demonstrations.emulator.stepping.plants import ForceDriven, LengthDriven, Spring
from demonstrations.emulator.stepping.rig import SteppedRig
from fmus import component
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.tracing import trace
from orchestration.fmu import Fmu
from orchestration.rig.signals import SIGNALS
from tests.support.rig.tension import tension_by_bisection

P = RigParameters.scattered(3)


def drive(rig: SteppedRig, step: float, rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return what is true after every step, under rows of commands."""
    found = []
    for values in zip(*rows.values(), strict=True):
        rig.command(dict(zip(rows, values, strict=True)))
        rig.advance(step)
        found.append(rig.true())
    return {name: np.array([row[name] for row in found]) for name in found[0]}


def levels(count: int, low: float, high: float, dwell: int, seed: int) -> np.ndarray:
    return np.repeat(np.random.default_rng(seed).uniform(low, high, count // dwell + 1), dwell)[
        :count
    ]


@pytest.mark.parametrize("kind", [Physics, DoubleLayer, DiffusionLayer, LaggingStrain])
def test_steps_by_force_are_those_of_the_rig_over_a_record(kind: type[Physics]) -> None:
    rows = {"current": levels(300, -1.3, 1.3, 17, 1), "force": levels(300, 0.0, 3.0, 23, 2)}
    found = drive(SteppedRig(ForceDriven(kind(P)), SIGNALS["force-driven"].outputs), 1 / 30, rows)
    record = EmulatedRig(P, voltage_noise=0, displacement_noise=0, hidden=kind)
    # the value at the end of a step, inputs still held, is that of a record whose inputs change one
    # row later
    instants = np.repeat(np.arange(300) / 30, 2)[1:] - np.tile([1e-9, 0.0], 300)[1:]
    record.run(instants, *(np.repeat(values, 2)[:-1] for values in rows.values()))
    for name, values in found.items():
        exact = record.truth[name][1::2]
        np.testing.assert_allclose(values[:-1], exact, rtol=1e-6, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize(
    "kind",
    [Physics, DoubleLayer, EvenStrain, LoadDependentVoltage, LoadDependentSpring, SaggingFilm],
)
def test_steps_by_length_solve_the_laws_slack_included(kind: type[Physics]) -> None:
    physics, step = kind(P), 0.05
    rows = {
        "current": levels(160, -1.3, 1.3, 20, 1),
        "length_change": levels(160, -2e-4, 6e-4, 13, 2),
    }
    found = drive(SteppedRig(LengthDriven(physics), ("tension", "charge", "voltage")), step, rows)
    state, tensions, charges, voltages = np.zeros(physics.order), [], [], []

    def slope(_: float, state: np.ndarray, current: float, length: float) -> list[Any]:
        return physics.rates(state, current, tension_by_bisection(physics, state, length))

    for current, length in zip(*rows.values(), strict=True):
        state = solve_ivp(
            slope, (0, step), state, "DOP853", args=(current, length), rtol=1e-11, atol=1e-15
        ).y[:, -1]
        tensions.append(tension_by_bisection(physics, state, length))
        charges.append(state[0])
        voltages.append(float(physics.terminal_voltage(state, current, tensions[-1])))
    assert 0.1 < np.mean(np.array(tensions) == 0.0) < 0.7
    for name, exact in (("tension", tensions), ("charge", charges), ("voltage", voltages)):
        assert np.abs(found[name] - exact).max() < 1e-7 * np.abs(exact).max(), name


def test_a_spring_is_solved_for_its_tension() -> None:
    spring = Spring(LoadDependentSpring(P, softening=0.7))
    for force in (1e-9, 0.3, 2.0, 5.0):
        length = float(spring.physics.spring_length(np.zeros(3), force))
        assert spring.tension(np.zeros(3), length) == pytest.approx(force, rel=1e-9, abs=1e-12)


def test_by_force_it_is_the_component(fmu: Any) -> None:
    """Its FMU, which shares no code with the rig: to the accuracy that it declares, 1e-8 a step."""
    rows = {"current": levels(120, -1.3, 1.3, 9, 4), "force": levels(120, 0.0, 3.0, 11, 5)}
    outputs = list(SIGNALS["force-driven"].outputs)
    found = drive(SteppedRig(ForceDriven(Physics(RigParameters())), tuple(outputs)), 1 / 30, rows)
    exact = np.empty((120, len(outputs)))
    with Fmu(fmu("ppy_actuator", "native")) as actuator:
        actuator.start()
        write, read = actuator.writer(list(rows)), actuator.reader(outputs)
        for k, values in enumerate(zip(*rows.values(), strict=True)):
            write(np.array(values))
            actuator.step(k / 30, 1 / 30)
            read(exact[k])
    for name, values in zip(outputs, exact.T, strict=True):
        assert np.abs(found[name] - values).max() <= 1e-6 * np.abs(values).max(), name


def test_by_length_it_is_the_component() -> None:
    step = 0.02
    rows = {
        "current": levels(200, -1.3, 1.3, 30, 6),
        "length_change": levels(200, -1e-4, 5e-4, 25, 7),
    }
    found = drive(
        SteppedRig(LengthDriven(Physics(RigParameters())), SIGNALS["length-driven"].outputs),
        step,
        rows,
    )
    model = CompiledModel(trace(component("ppy_actuator_length_driven")))
    exact = model.run(
        np.arange(201) * step, {n: np.append(v, v[-1]) for n, v in rows.items()}
    ).signals
    # states do not jump, so that rows may be compared at the ends of steps; others jump with the
    # inputs
    assert (
        np.abs(found["charge"] - exact["charge"][1:]).max() < 1e-7 * np.abs(exact["charge"]).max()
    )
    same = np.append(np.all([np.diff(v) == 0 for v in rows.values()], axis=0), True)
    for name, values in found.items():
        expected = exact[name][1:]
        assert np.abs(values - expected)[same].max() < 1e-6 * np.abs(expected).max(), name
    assert (found["tension"] == 0).sum() > 5


@settings(max_examples=40)
@given(
    current=st.floats(-1.3, 1.3),
    load=st.floats(0.0, 1.0),
    step=st.floats(1e-3, 0.5),
    share=st.floats(0.01, 0.99),
    plant=st.sampled_from([ForceDriven, LengthDriven, BenchPlant]),
    seed=st.integers(0, 5),
)
def test_a_step_is_its_parts(
    current: float, load: float, step: float, share: float, plant: Any, seed: int
) -> None:
    """Held inputs, so that it does not matter where a step is cut; from states that are not at
    rest.
    """
    before = np.random.default_rng(seed).uniform(0.0, 1.0, 4)
    whole, parts = (
        SteppedRig(plant(Physics(P)), ("voltage", "charge", "mechanical_displacement"))
        for _ in range(2)
    )
    for rig in (whole, parts):
        for amperes, share_of_load in (before[:2], before[2:], (current, load)):
            rig.command({name: _scaled(name, amperes, share_of_load) for name in plant.inputs})
            rig.advance(0.1)
    whole.advance(step)
    parts.advance(share * step)
    parts.advance(step - share * step)
    for name, value in whole.true().items():
        assert parts.true()[name] == pytest.approx(value, rel=1e-8, abs=1e-11), name


def _scaled(name: str, current: float, load: float) -> float:
    return current if name == "current" else load * (5e-4 if name == "length_change" else 3.0)


@pytest.mark.parametrize("plant", [ForceDriven, LengthDriven, BenchPlant])
def test_the_same_steps_give_the_same_bits(plant: Any) -> None:
    commands = {"current": levels(60, -1, 1, 7, 1), "force": levels(60, 0, 3, 5, 2)}
    commands |= {"length_change": 1e-4 * commands["force"], "force_reference": commands["force"]}
    rows = {name: commands[name] for name in plant.inputs}
    one, other = (
        drive(SteppedRig(plant(DoubleLayer(P)), ("voltage", "charge")), 1 / 30, rows)
        for _ in range(2)
    )
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name])


@pytest.mark.parametrize("kind", [Physics, DoubleLayer])
@pytest.mark.parametrize("plant", [ForceDriven, LengthDriven, BenchPlant])
def test_a_step_of_a_millisecond_costs_far_less(plant: Any, kind: type[Physics]) -> None:
    """Measured 14 to 95 microseconds of CPU; a loaded machine is allowed ten times that."""
    rig = SteppedRig(plant(kind(P)), ("voltage",))
    rig.command({"current": 0.5, "force": 1.0, "length_change": 1e-4, "force_reference": 1.0})
    rig.advance(0.05)
    began = time.process_time()
    for _ in range(100):
        rig.advance(1e-3)
        rig.true()
    assert (time.process_time() - began) / 100 < 1e-3


@pytest.mark.parametrize("values", [{"current": 1.0}, {"current": np.nan, "force": 0.0}])
def test_commands_that_are_none_change_nothing(values: dict[str, float]) -> None:
    rig = SteppedRig(ForceDriven(Physics(P)), ("voltage",))
    rig.command({"current": 0.5, "force": 0.0})
    before = rig.true()
    with pytest.raises(ValueError, match="must be a finite number"):
        rig.command(values)
    assert rig.true() == before
