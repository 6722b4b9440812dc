"""Claims: watches hear the actuator that they protect; their numbers are those of its circuit."""

from math import tanh

import numpy as np
import pytest
from scipy.optimize import brentq

from fmus import component
from orchestration.system import library


def wires(name):
    return {(str(c.source), str(c.target)) for c in library.system(name).connections}


def test_both_watches_are_wired_alike():
    assert wires("degradation_watch") == wires("potentiostat_watch")
    assert wires("degradation_watch") == {
        ("galvanostat.current", "actuator.current"),
        ("galvanostat.current", "estimator.current"),
        ("actuator.voltage", "estimator.voltage"),
        ("actuator.voltage", "galvanostat.voltage"),
        ("estimator.voltage_limit", "galvanostat.voltage_limit"),
    }


def test_with_its_capacitance_the_fresh_actuator_has_the_printed_first_voltage():
    """1.15 V at 1.3 A and 0.1 Hz: the charge swings by tanh(T / 4 tau) of its final value."""
    fresh = component("ppy_actuator")()
    r1, r2 = fresh.R1, fresh.R2

    def excess(c):
        swing = tanh(10.0 / (4.0 * (r1 + r2) * c))
        return 1.3 * r2 * (r1 + r2 * swing) / (r1 + r2) - 1.15

    found = library.system("degradation_watch").member("actuator").parameters["C"]
    assert found == pytest.approx(brentq(excess, 0.1, 100.0), rel=1e-9)


def test_the_potentiostat_reaches_its_voltage_in_one_step():
    """Its gain is that of both resistances in parallel: for a step the capacitor is a short."""
    fresh = component("ppy_actuator")()
    gain = library.system("potentiostat_watch").member("galvanostat").parameters["integral_gain"]
    assert gain == pytest.approx((1.0 / fresh.R1 + 1.0 / fresh.R2) / 1e-3, rel=1e-12)


@pytest.mark.slow
def test_the_watch_sees_its_actuator(libcosim):
    """The current is what was wanted, the limit that of the start, and the actuator charges."""
    wanted = {"galvanostat.current_command": 1.0}
    found = libcosim(
        "degradation_watch",
        5.0,
        wanted,
        ["galvanostat.current", "actuator.voltage", "estimator.voltage_limit"],
    )
    assert set(found["galvanostat.current"]) == {1.0}
    assert set(found["estimator.voltage_limit"]) == {1.2}
    assert np.all(np.diff(found["actuator.voltage"]) > 0.0)
