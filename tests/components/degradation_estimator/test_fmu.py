"""Both builds of the degradation estimator as FMUs: signals, one behaviour, absurd readings."""

import itertools
import math

import fmpy
import numpy as np
import pytest

from demonstrations.emulator.emulator import EmulatedRig
from demonstrations.emulator.physics import RigParameters
from fmus.kit.build.building import RUNTIMES
from orchestration.experiment.waveforms import square_wave
from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation import simulate_instance
from tests.contract.raw import OK, instance

NAME = "degradation_estimator"
FAST = {
    "settling_time": 10.0,
    "minimum_reversals": 3,
    "least_squares_time": 5.0,
    "forgetting_time": 30.0,
}


@pytest.fixture
def archive(fmu, runtime):
    return fmu(NAME, runtime)


def record(duration, seed=1, noise=4e-3):
    time = 0.1 * np.arange(round(duration / 0.1))
    current = square_wave(time, 0.9, 0.2)
    rig = EmulatedRig(RigParameters(), seed=seed, voltage_noise=noise)
    return time, current, rig.run(time, current, np.zeros_like(time))["voltage"]


# --- archive
# --------------------------------------------------------------------------------------------------


def test_signals_units_and_types(archive):
    description = fmpy.read_model_description(str(archive), validate=True)
    about = {v.name: v for v in description.modelVariables}
    outputs = {v.name: v.unit for v in description.modelVariables if v.causality == "output"}
    assert outputs == {
        "R1": "Ohm",
        "R2": "Ohm",
        "C": "F",
        "impedance": "Ohm",
        "impedance_change": "1",
        "voltage_limit": "V",
        "estimate_valid": None,
        "tracked_angular_frequency": "rad/s",
    }
    assert {n: about[n].unit for n in about if about[n].causality == "input"} == {
        "current": "A",
        "voltage": "V",
    }
    assert {n for n in about if about[n].type == "Boolean"} == {
        "instrumental_variable",
        "zero_order_hold",
        "track_frequency",
        "estimate_valid",
        "estimate_valid_start",
    }
    assert all(
        not u.dependencies for u in description.outputs
    )  # all through samples: no algebraic loop


# --- results
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        pytest.param(FAST, marks=pytest.mark.slow),
        FAST | {"instrumental_variable": False, "zero_order_hold": False, "reset_interval": 3.0},
        pytest.param(
            FAST | {"sample_period": 0.037, "maximum_trace": 10.0}, marks=pytest.mark.slow
        ),
        FAST | {"track_frequency": True},
    ],
    ids=["default", "fast", "thesis", "bounded", "tracked"],
)
def test_builds_agree(fmu, parameters):
    steps = np.random.default_rng(7).choice([0.01, 0.1, 0.123, 0.5], 650)
    time = np.concatenate([[0.0], np.cumsum(steps)])
    current = square_wave(time, 0.9, 0.2)
    voltage = EmulatedRig(RigParameters(), seed=3).run(time, current, np.zeros_like(time))[
        "voltage"
    ]
    results = {}
    for runtime in RUNTIMES:
        with Fmu(fmu(NAME, runtime), parameters) as one:
            one.start(0.0, float(time[-1]))
            results[runtime] = simulate_instance(
                one, time, {"current": current, "voltage": voltage}
            )
    for name, expected in results["native"].items():
        np.testing.assert_allclose(
            results["python"][name], expected, rtol=1e-9, atol=1e-12, err_msg=name
        )
    assert results["native"]["R2"][-1] > 0.0
    assert results["native"]["estimate_valid"].any()


@pytest.mark.slow
def test_any_communication_step_takes_the_same_samples(archive):
    """Inputs held for whole sample periods: smaller or larger communication steps change
    nothing.
    """
    _, current, voltage = record(30.0)
    results = []
    for parts in (1, 3, 7):
        with instance(archive) as one:
            one.initialize(FAST)
            trail = []
            for i, v in zip(current, voltage, strict=True):
                one.set({"current": i, "voltage": v})
                for _ in range(parts):
                    one.step(0.1 / parts)
                trail.append(
                    one.get("R1", "R2", "C", "impedance", "estimate_valid", "voltage_limit")
                )
            results.append(trail)
    assert results[0][-1][4] == 1
    for other in results[1:]:
        assert other == results[0]
    with instance(archive) as one:  # steps over many samples
        one.initialize({"current": 0.9, "voltage": 0.3})
        one.step(100.0)
        assert one.get("samples") == [1000.0]


# --- absurd readings
# --------------------------------------------------------------------------------------------------


def test_absurd_readings_leave_numbers_and_are_forgotten(archive):
    _, current, voltage = record(200.0, noise=0.0)
    with instance(archive) as one:
        one.initialize(FAST)
        for i, v in itertools.product((1e308, -1e308, 0.5), (1e308, -1e308, 0.5)):
            one.set({"current": i, "voltage": v})
            assert one.call("fmi2DoStep", one.time, 0.1, 1) == OK
            one.time += 0.1
        for i, v in zip(current, voltage, strict=True):
            one.set({"current": i, "voltage": v})
            one.step(0.1)
        assert all(math.isfinite(value) for value in one.everything())
        assert one.get("R1", "R2", "C") == pytest.approx([0.43, 2.35, 2.70], rel=1e-3)
