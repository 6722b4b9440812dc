"""Claims: calls of laws are followed through `self`, with what each gives."""

import casadi as ca
import pytest

import fmus
from fmus.kit.symbolic import trace, trace_with_laws
from fmus.kit.symbolic.calls import Calls
from tests.support.kit_samples import Thermostat


def test_laws_in_the_order_of_their_calls_with_their_values():
    calls = Calls(Thermostat)
    assert calls.instance.warming() == pytest.approx((0.0 - 0.5 * 10.0) / 20.0)
    assert calls.values["power"] == [0.0]
    assert calls.names == ["warming", "power"]


def test_the_traced_laws_are_those_that_rates_outputs_and_updates_call():
    graph, laws = trace_with_laws(Thermostat)
    assert set(laws) == {"warming", "power", "switch", "count", "read", "warm"}
    assert ca.is_equal(laws["warming"], graph.rates[0], 10)
    assert str(graph.outputs) == str(trace(Thermostat).outputs)


def test_laws_of_several_numbers_are_left_out():
    _, laws = trace_with_laws(fmus.component("foot"))
    assert "ankle_torque" in laws
    assert "joint_torques" not in laws
