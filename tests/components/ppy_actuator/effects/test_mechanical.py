"""Claims: creep follows exponentials, flow its threshold, springs points that are known."""

import math

import numpy as np
import pytest

from fmus.kit import stack
from fmus.kit.integrate import Integrator
from fmus.ppy_actuator.effects import EFFECTS
from fmus.ppy_actuator.model import PpyActuator

K1, B1, K2, B2 = 6300.0, 1.7e6, 1.0e4, 2.0e6  # N/m, N s/m, N/m, N s/m


def creep_under(cls, loads, **values):
    """Mechanical displacement of the force-driven actuator after each (load, duration), the load
    still on.
    """
    model, time, found = cls(**values), 0.0, []
    integrator = Integrator(model)
    for load, duration in loads:
        model.force = load
        integrator.advance(time, duration)
        time += duration
        found.append(model.mechanical_displacement())
    return found


def test_second_kelvin_creeps_exponentially():
    loads, values = (
        [(2.0, 5.0), (2.0, 10.0), (0.5, 4.0)],
        {"second_creep_compliance": 4e-5, "second_creep_time": 8.0},
    )
    found = np.subtract(
        creep_under(stack(PpyActuator, EFFECTS["second_kelvin"]), loads, **values),
        creep_under(PpyActuator, loads),
    )
    after = 2.0 * -math.expm1(-15.0 / 8.0)
    exact = [
        4e-5 * f
        for f in (2.0 * -math.expm1(-5.0 / 8.0), after, 0.5 + (after - 0.5) * math.exp(-4.0 / 8.0))
    ]
    assert found == pytest.approx(exact, rel=1e-6)


def test_asymmetric_creep_recovers_slower():
    cls, tau = stack(PpyActuator, EFFECTS["asymmetric_creep"]), B2 / K2
    crept, recovered = creep_under(cls, [(2.0, 100.0), (0.0, 100.0)], recovery_slowness=0.7)
    flow, kelvin = 2.0 * 100.0 / B1, 2.0 / K2 * -math.expm1(-100.0 / tau)
    assert crept == pytest.approx(2.0 / K1 + flow + kelvin, rel=1e-7)
    assert recovered == pytest.approx(flow + kelvin * math.exp(-100.0 / tau / 1.7), rel=1e-7)


def test_yield_threshold_leaves_small_loads_without_flow():
    cls = stack(PpyActuator, EFFECTS["yield_threshold"])
    found = creep_under(cls, [(0.6, 50.0), (2.0, 50.0), (0.0, 1e5)], yield_force=0.7)
    tau = B2 / K2
    assert found[0] == pytest.approx(0.6 / K1 + 0.6 / K2 * -math.expm1(-50.0 / tau), rel=1e-7)
    assert found[2] == pytest.approx((2.0 - 0.7) * 50.0 / B1, rel=1e-6), (
        "what is left in the end has flowed"
    )


@pytest.mark.parametrize(
    ("name", "values", "elongations"),
    [
        # in units of 1/k1, at 0, 0.4, 1 and 2.5 N
        ("slack", {"slack_compliance": 1.5, "preload": 0.8}, [0.0, 1.0, 2.2, 3.7]),
        (
            "slack(smooth)",
            {"fading_compliance": 1.5, "fading_load": 0.6},
            [0.0, 0.4 + 0.36, 1.0 + 0.5625, 2.5 + 2.25 / 3.1],
        ),
        (
            "nonlinear_stiffness",
            {"load_softening": 0.4, "softening_load": 0.75},
            [0.0, 0.4 + 0.4 * 0.1, 1.0 + 0.4 * 0.5, 2.5 + 0.4 * (math.hypot(2.5, 0.75) - 0.75)],
        ),
    ],
)
def test_springs_go_through_points_that_are_known(name, values, elongations):
    model = stack(PpyActuator, EFFECTS[name])(**values)
    for force, elongation in zip((0.0, 0.4, 1.0, 2.5), elongations, strict=True):
        assert model.spring_elongation(force) == pytest.approx(elongation / K1, rel=1e-14)
        assert model.spring_force(elongation / K1) == pytest.approx(force, rel=1e-14)
