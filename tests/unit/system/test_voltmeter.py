"""Claims: what received a voltage receives what is measured, and without an error nothing
changes.
"""

from __future__ import annotations

import numpy as np
import pytest

from fmus import component
from fmus.kit.errors import UserError
from orchestration import master
from orchestration.system import Member, System, connect, library
from orchestration.system.checking import check

TIME = np.linspace(0.0, 1.0, 11)


@pytest.fixture
def relaxing(runtime):
    """An actuator that discharges, its voltage measured twice over and fed to a galvanostat."""
    held = {"charge_start": 2.0, "current": 0.0, "force": 0.0}
    watch = {
        "current_command": 0.0,
        "voltage_limit": 0.5,
        "voltage_command": 0.0,
        "protection_period": 0.1,
    }
    members = (
        Member.of("actuator", component("ppy_actuator"), held, runtime),
        Member.of("galvanostat", component("galvanostat"), watch, runtime),
    )
    return System("relaxing", members, connect("actuator.voltage -> galvanostat.voltage"), step=0.1)


def test_what_received_a_voltage_receives_what_is_measured(relaxing, runtime):
    measured = library.with_voltmeter(relaxing, "actuator.voltage", runtime)
    check(measured)
    assert {(str(c.source), str(c.target)) for c in measured.connections} == {
        ("actuator.voltage", "voltmeter.voltage"),
        ("voltmeter.measured_voltage", "galvanostat.voltage"),
    }
    error = 0.01 * np.random.default_rng(0).standard_normal(TIME.size)
    record = ["actuator.voltage", "voltmeter.measured_voltage", "galvanostat.sampled_voltage"]
    found = master.run(
        measured, TIME, {"voltage_error": error}, record=record, method="jacobi"
    ).signals
    shown = found["voltmeter.measured_voltage"]
    assert np.array_equal(shown, found["actuator.voltage"] + error), "at once"
    assert np.array_equal(found["galvanostat.sampled_voltage"][1:], shown[:-1]), (
        "what was there at the sample"
    )


def test_without_an_error_nothing_changes(relaxing, runtime):
    measured = library.with_voltmeter(relaxing, "actuator.voltage", runtime)
    one, other = (
        master.run(system, TIME, record=["actuator.voltage", "galvanostat.sampled_voltage"]).signals
        for system in (relaxing, measured)
    )
    for name, values in one.items():
        assert np.array_equal(other[name], values)


def test_what_is_no_voltage_is_not_measured(relaxing, runtime):
    with pytest.raises(UserError, match=r"unit 'C' of actuator\.charge cannot become 'V'"):
        check(library.with_voltmeter(relaxing, "actuator.charge", runtime))
