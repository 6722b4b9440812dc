"""Claims: the outputs of a simulation are those on paper, read after the inputs of the same
point.
"""

from __future__ import annotations

import numpy as np
import pytest

from orchestration.fmu.instance import Fmu
from orchestration.fmu.simulation.simulation import simulate_instance

TIME = np.linspace(0.0, 30.0, 61)


def test_outputs_follow_the_solution_on_paper(fmu, runtime):
    current = 0.9
    with Fmu(fmu("ppy_actuator", runtime), {"R1": 0.6, "charge_start": 0.5}) as instance:
        instance.start()
        result = simulate_instance(
            instance, TIME, {"current": np.full(TIME.size, current)}, ["charge", "voltage"]
        )
    settled = 2.35 * 2.7 * current
    charge = settled + (0.5 - settled) * np.exp(-TIME / ((0.6 + 2.35) * 2.7))
    assert result["charge"] == pytest.approx(charge, abs=1e-7)
    voltage = 0.6 * (2.35 * current - charge / 2.7) / 2.95 + charge / 2.7
    assert result["voltage"] == pytest.approx(voltage, abs=1e-7)


def test_outputs_are_read_after_the_inputs_of_the_same_point(fmu, runtime):
    """A step of current shows in the voltage at once, through R1 parallel to R2."""
    with Fmu(fmu("ppy_actuator", runtime)) as instance:
        instance.start()
        current = np.array([0.0, 0.9, 0.0])
        result = simulate_instance(
            instance, np.array([0.0, 1e-6, 2e-6]), {"current": current}, ["voltage"]
        )
    assert result["voltage"] == pytest.approx(current * 0.43 * 2.35 / 2.78, abs=1e-5)


def test_progress_reaches_the_end(fmu):
    told: list[int] = []
    with Fmu(fmu("ppy_actuator", "native")) as instance:
        instance.start()
        simulate_instance(instance, np.linspace(0.0, 1.0, 1001), {}, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1001
    assert len(told) > 100
