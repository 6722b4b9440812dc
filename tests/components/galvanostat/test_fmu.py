"""Both builds of the galvanostat as FMUs: one behaviour, and no way from the voltage to the current
but samples.
"""

import math

import fmpy
import numpy as np
import pytest

from fmus.kit.build.building import RUNTIMES
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.contract.raw import OK, doubles, instance, integers

NAME = "galvanostat"


@pytest.fixture
def archive(fmu, runtime):
    return fmu(NAME, runtime)


def test_the_voltage_reaches_the_current_through_samples_only(archive, runtime):
    """So no algebraic loop closes through an actuator. A build in Python names no states."""
    description = fmpy.read_model_description(str(archive), validate=True)
    known = {u.variable.name: {k.name for k in u.dependencies} for u in description.outputs}
    assert known == {
        "current": {"current_command"} | ({"lagged_current"} if runtime == "native" else set()),
        "saturated": {"current_command"},
        "recovering": set(),
    }


# --- two builds, one behaviour
# ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"potentiostat": True},
        pytest.param({"response_time": 5e-4, "control_tolerance": 1e-3}, marks=pytest.mark.slow),
        {"protection_period": 0.037},
    ],
    ids=["galvanostat", "potentiostat", "options", "period"],
)
def test_builds_agree(fmu, parameters):
    rng = np.random.default_rng(7)
    time = np.concatenate([[0.0], np.cumsum(rng.choice([0.001, 0.01, 0.0123, 0.1, 0.5], 600))])
    n = len(time)
    inputs = {
        "current_command": rng.normal(size=n),
        "voltage": rng.normal(size=n) * np.where(time > 50.0, 15.0, 1.0),
        "voltage_limit": np.where(time > 50.0, 100.0, 2.0),
        "voltage_command": rng.normal(size=n),
    }
    results = {}
    for runtime in RUNTIMES:
        with Fmu(fmu(NAME, runtime), parameters) as one:
            one.start(0.0, float(time[-1]))
            results[runtime] = simulate_instance(one, time, inputs)
    for name in ("current", "saturated", "recovering"):
        np.testing.assert_allclose(
            results["python"][name], results["native"][name], rtol=1e-9, atol=1e-12
        )
        assert len(set(results["native"][name].tolist())) > 1


# --- inputs, states, steps
# --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["current_command", "voltage", "voltage_limit", "voltage_command"])
@pytest.mark.parametrize("potentiostat", [0.0, 1.0])
def test_enormous_inputs_give_a_finite_current(archive, name, potentiostat):
    with instance(archive) as one:
        one.initialize({"potentiostat": potentiostat})
        for value in (1e300, -1e300, 0.0, 1.0):
            assert one.call("fmi2SetReal", one.references([name]), 1, doubles(value)) == OK
            one.step(0.1)
            assert abs(one.get("current")[0]) <= 1.3
            assert all(math.isfinite(v) for v in one.everything())


def test_a_recovery_goes_on_from_a_saved_state(archive):
    with instance(archive) as one:
        one.initialize({"voltage_limit": 1.0, "current_command": 0.7})
        one.set({"voltage": 2.0})
        one.step(0.025)
        one.set({"voltage": 0.0})
        one.step(0.1)
        state, time = one.save(), one.time

        def rest():
            one.time = time
            trail = []
            for _ in range(60):
                one.step(0.0123)
                trail += one.everything()
            return trail

        first = rest()
        one.restore(state)
        assert rest() == first
        one.forget(state)
        assert one.get("current", "recovering") == [0.7, 0]


def test_any_communication_step_ends_the_recovery_at_the_same_instant(archive):
    """Begun by the sample at 0 s, over at 0.5 s: seen after the step that begins there."""
    for size in (0.0013, 0.01, 0.07, 0.3):
        with instance(archive) as one:
            one.initialize({"voltage_limit": 1.0, "current_command": 0.7, "voltage": 2.0})
            one.step(min(size, 0.004))
            one.set({"voltage": 0.0})
            while one.time < 1.0:
                recovering, current = one.get("recovering", "current")
                assert bool(recovering) == (one.time < 0.5 + 1e-9), (size, one.time)
                assert current == (0.0 if recovering else 0.7)
                one.step(size)


def test_directional_derivatives(fmu):
    with instance(fmu(NAME, "native")) as one:
        one.initialize({"current_command": 0.0})
        # in the middle of a dead band of no width
        assert one.tangent(["current"], ["current_command"], [1.0]) == [1.0]
        one.set({"current_command": 0.5})
        assert one.tangent(["current"], ["current_command"], [1.0]) == [1.0]
        one.set({"current_command": 2.0})
        assert one.tangent(["current"], ["current_command"], [1.0]) == [0.0]
        one.set({"current_command": 0.5, "voltage": 9.0, "voltage_limit": 1.0})
        one.step(0.1)
        assert one.tangent(["current"], ["current_command"], [1.0]) == [0.0]


def test_start_time_moves_the_sample_instants_along(archive):
    trails = []
    for start in (0.0, 3.7, 1000.0):
        with instance(archive) as one:
            one.initialize(
                {"voltage_limit": 1.0, "current_command": 0.7, "voltage": 2.0}, start=start
            )
            one.step(0.004)
            one.set({"voltage": 0.0})
            trail = []
            for _ in range(100):
                one.step(0.007)
                trail += one.get("current", "recovering")
            trails.append(trail)
    assert trails[0] == trails[1] == trails[2]
    assert {0.0, 0.7} <= set(trails[0])


@pytest.mark.parametrize("response", [0.0, 0.05])
def test_current_follows_a_command_with_a_slope(fmu, response):
    """Native build: ramp response of the lag, in closed form."""
    with instance(fmu(NAME, "native")) as one:
        one.initialize({"response_time": response})
        for k in range(10):
            one.do(
                "fmi2SetRealInputDerivatives",
                one.references(["current_command"]),
                1,
                integers(1),
                doubles(0.8),
            )
            one.step(0.033)
            time = (k + 1) * 0.033
            lag = response * -math.expm1(-time / response) if response else 0.0
            assert one.get("current")[0] == pytest.approx(0.8 * (time - lag), rel=1e-7, abs=1e-8)
