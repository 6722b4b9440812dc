"""Claims: an equilibrium is that of closed forms; one that is none or open is refused in a line."""

from __future__ import annotations

import numpy as np
import pytest

from fmus import component
from fmus.kit import (
    Component,
    Discrete,
    Input,
    Parameter,
    State,
    UserError,
    clip,
    exp,
    log,
    stack,
    where,
)
from fmus.kit.sensors import sensor_lag
from fmus.kit.symbolic import trace
from fmus.ppy_actuator.model import PpyActuator
from orchestration.linear.equilibrium import TrimRequest, trim
from orchestration.linear.operating_point import point_at, start_point
from orchestration.master.reference import fuse
from orchestration.system import library

R1, R2, C, ALPHA, K2, B1 = 0.43, 2.35, 2.70, 6.8e-5, 1.0e4, 1.7e6


@pytest.fixture(scope="module")
def actuator():
    return trace(component("ppy_actuator"))


def trimmed(graph, fixed, free=(), drift=(), **settings):
    return trim(graph, start_point(graph, settings), TrimRequest(fixed, free, drift))


def test_the_current_that_holds_a_displacement(actuator):
    point = trimmed(actuator, {"displacement": 1e-4}, ["current"])
    charge = 1e-4 / ALPHA
    assert point.states["charge"] == pytest.approx(charge, rel=1e-9)
    assert point.inputs["current"] == pytest.approx(charge / (R2 * C), rel=1e-9)
    assert (point.trimmed, point.undetermined, point.words) == (True, (), "in the equilibrium")


def test_a_parameter_can_be_free():
    graph = trace(component("ppy_actuator"))
    point = trimmed(graph, {"charge": 3.0, "current": 0.5}, ["R2"])
    assert point.parameters["R2"] == pytest.approx(3.0 / (0.5 * C), rel=1e-9)


def test_what_flows_under_a_force_drifts_at_the_rate_of_its_dashpot(actuator):
    point = trimmed(actuator, {"force": 1.0}, drift=["maxwell_elongation"])
    assert point.states["kelvin_elongation"] == pytest.approx(1.0 / K2, rel=1e-9)
    assert point.drift == {"maxwell_elongation": pytest.approx(1.0 / B1, rel=1e-12)}


def test_a_bench_that_follows_a_creeping_actuator():
    # one newton at a constant speed: K i = 1 N + b v, u = R i + K v
    graph = fuse(library.system("dma_bench"))
    near = point_at(graph, 1.0, {"force_reference": 1.0})
    moving = ("bench.position", "bench.position_filtered", "actuator.maxwell_elongation")
    point = trim(graph, near, TrimRequest({}, (), moving))
    speed = 1.0 / B1
    current = (1.0 + 6.0 * speed) / 3.9
    assert point.states["bench.velocity"] == pytest.approx(speed, rel=1e-8)
    assert point.states["bench.coil_current"] == pytest.approx(current, rel=1e-8)
    volts = 3.0 * current + 3.9 * speed
    assert point.discretes["bench.voltage_command"] == pytest.approx(volts, rel=1e-8)
    assert point.drift == {name: pytest.approx(speed, rel=1e-8) for name in moving}


class Pendulum(Component):
    """A pendulum under a torque, with a sampled copy of its angle."""

    name = "pendulum"
    gravity = Parameter(9.81, "1/s^2", doc="gravity over length")
    torque = Input("1/s^2", doc="torque")
    angle = State("rad", rate="rate_law", doc="angle", output=True)
    rate = State("rad/s", rate="acceleration", doc="rate")
    copy = Discrete("rad", update="sample", period=0.1, doc="angle at the last sample")

    def rate_law(self):
        return self.rate

    def acceleration(self):
        from fmus.kit import sin

        return self.torque - self.gravity * sin(self.angle) - self.rate

    def sample(self):
        return self.angle


def test_a_nonlinear_equilibrium_with_a_sampled_state():
    graph = trace(Pendulum)
    near = start_point(graph, {"angle_start": 0.3})
    point = trim(graph, near, TrimRequest({"torque": 5.0}))
    angle = np.arcsin(5.0 / 9.81)
    assert point.states["angle"] == pytest.approx(angle, rel=1e-9)
    assert point.discretes["copy"] == pytest.approx(angle, rel=1e-9)
    with pytest.raises(UserError, match="no equilibrium found"):
        trim(graph, near, TrimRequest({"torque": 10.0}))


def test_a_position_that_nothing_determines_stays_where_it_started():
    graph = trace(component("voice_coil_dma"))
    point = trimmed(graph, {"position_filtered": 2e-3}, position_start=1e-3, controller_on=0.0)
    assert point.states["position"] == pytest.approx(2e-3, rel=1e-6)
    loose = trimmed(graph, {}, controller_on=0.0)
    assert set(loose.undetermined) == {"position", "position_filtered"}


@pytest.mark.parametrize(
    ("fixed", "free", "drift", "said"),
    [
        ({"force": 1.0}, [], [], "the rate of maxwell_elongation = 0 cannot be met"),
        (
            {"force": 1.0},
            ["current"],
            [],
            "for each of these a state or an output is fixed, here 0",
        ),
        ({"displacement": 1e300}, ["current"], [], "displacement = 1e.300 cannot be met"),
        ({"charge": 1.0}, ["k1"], [], "no equilibrium found"),
        ({"kelvin_elongation": 0.0}, ["k1"], [], "does not determine k1"),
        ({"forse": 1.0}, [], [], "'forse', which is no input, state or output.*force"),
        ({}, ["voltage"], [], "'voltage', which is no input or parameter"),
        ({}, [], ["current"], "'current', which is no state"),
        ({"current": 1.0}, ["current"], [], "both fixed and free"),
    ],
)
def test_what_is_no_equilibrium_is_refused_in_a_line(actuator, fixed, free, drift, said):
    near = start_point(actuator, {"force": 0.0})
    with pytest.raises(UserError, match=said) as refusal:
        trim(actuator, near, TrimRequest(fixed, free, drift))
    assert "\n" not in str(refusal.value)


class Level(Component):
    """Tank behind an equal-percentage valve that shuts: with outflow g h, h = q R^(x - 1) / g."""

    name = "level"
    flow = Parameter(1.0, "m^3/s", min=0, max=10, doc="flow of the open valve")
    ratio = Parameter(50.0, "1", min=1.1, max=1000, doc="rangeability")
    valve = Input("1", min=0, max=1, doc="opening")
    other = Input("1", min=0, max=1, doc="opening of a second valve")
    height = State("m", rate="change", start=0.3, min=0, max=2, doc="level")
    apart = State("m", rate="nothing", start=0.7, doc="depends on nothing")
    unchecked = ("change",)

    def passed(self, opening):
        """Share of the flow."""
        return where(opening > 0.0, exp((clip(opening, 0.0, 1.0) - 1.0) * log(self.ratio)), 0.0)

    def change(self):
        """Balance, with g = 1 m^2/s and an area of 1 m^2."""
        return self.flow * (self.passed(self.valve) + self.passed(self.other)) - self.height

    def nothing(self):
        """Rest."""
        return 0.0 * self.apart


@pytest.mark.parametrize("start", [0.0, 0.9, 1.0])
def test_a_valve_that_is_shut_where_the_search_begins(start):
    point = trimmed(trace(Level), {"height": 0.4}, ["valve"], valve=start)
    assert point.inputs["valve"] == pytest.approx(1.0 + np.log(0.4) / np.log(50.0), rel=1e-9)
    assert point.states["apart"] == 0.7
    assert point.outside == {}


def test_an_equilibrium_outside_of_a_range_says_so():
    point = trimmed(trace(Level), {}, valve=1.0, other=1.0, flow=3.0)
    assert point.states["height"] == pytest.approx(6.0, rel=1e-9)
    assert point.outside == {"height": (0.0, 2.0)}


def test_what_no_opening_reaches_is_no_equilibrium():
    with pytest.raises(UserError, match="no equilibrium found"):
        trimmed(trace(Level), {"height": 1.5}, ["valve"])


def test_a_sensor_that_sees_where_a_damper_stands_determines_no_other_current():
    """The damper without a force stays where it is; the lag of the sensor is at rest."""
    request = TrimRequest({"displacement": 5e-5}, ["current"])
    lag = sensor_lag(PpyActuator, "displacement")
    plain, lagged = (
        trim(graph, point_at(graph, 0.0, {}), request)
        for graph in (trace(PpyActuator), trace(stack(PpyActuator, lag)))
    )
    assert lagged.inputs["current"] == pytest.approx(plain.inputs["current"])
    assert lagged.undetermined == plain.undetermined == ()
