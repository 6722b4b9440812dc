"""Claims: self-heating ends where supply and loss balance."""

import math

import pytest

from fmus.kit import stack
from fmus.kit.integrate import Integrator
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator

R2, C = 2.35, 2.70  # ohm, F


def test_self_heating_ends_where_supply_and_loss_balance():
    """Charged, all of the current leaks: P = R2 i^2. Warming is slow, and follows an exponential in
    the end.
    """
    cls = stack(PpyActuator, EFFECTS["self_heating"])
    model = cls(
        conductance_rise_per_kelvin=0.02,
        thermal_resistance=30.0,
        thermal_time=400.0,
        charge_start=R2 * C * 0.9,
    )
    model.current, rise = 0.9, 30.0 * R2 * 0.9**2
    integrator = Integrator(model)
    for k in range(6):
        assert model.temperature_rise == pytest.approx(
            rise * -math.expm1(-k * 200.0 / 400.0), rel=1e-6
        )
        integrator.advance(k * 200.0, 200.0)
    model.current = 1.9  # at once, through the series resistance only
    jump = (0.43 / (1.0 + 0.02 * model.temperature_rise)) * 1.0
    assert model.voltage() - R2 * 0.9 == pytest.approx(jump * R2 / (jump + R2), rel=1e-9)
