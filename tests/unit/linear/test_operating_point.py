"""Claims: an operating point is where scipy and closed forms say that a model is at that time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete

from fmus import component
from fmus.kit import Component, Input, Output, Parameter, State, UserError, stack
from fmus.kit.inputs import input_delay
from fmus.kit.sampling import Sampling
from fmus.kit.sensors import sensor_lag, transport_delay
from fmus.kit.symbolic import trace
from orchestration.linear.blocks import blocks_of
from orchestration.linear.discretisation import assemble
from orchestration.linear.equilibrium import TrimRequest, trim
from orchestration.linear.operating_point import point_at, start_point, with_outputs

R1, R2, C = 0.43, 2.35, 2.70


@pytest.fixture(scope="module")
def actuator():
    return trace(component("ppy_actuator"))


def charged(current, seconds):
    """Charge in C after a constant current, thesis eq. 3.4."""
    return current * R2 * C * (1.0 - np.exp(-seconds / ((R1 + R2) * C)))


def test_constant_inputs_lead_to_the_closed_form(actuator):
    point = point_at(actuator, 3.0, {"current": 0.5, "R1": R1, "R2": R2, "C": C})
    assert point.states["charge"] == pytest.approx(charged(0.5, 3.0), rel=1e-7)
    assert (point.time, point.inputs["current"], point.words) == (3.0, 0.5, "at 3 s")


def test_inputs_that_vary_are_held_between_their_instants(actuator):
    over = np.array([0.0, 2.0, 4.0])
    stimulus = {"current": np.array([0.5, 0.0, 9.0])}
    point = point_at(actuator, 3.0, {}, stimulus, over)
    decay = np.exp(-1.0 / ((R1 + R2) * C))
    assert point.states["charge"] == pytest.approx(charged(0.5, 2.0) * decay, rel=1e-7)
    assert point.inputs["current"] == 0.0
    assert point_at(actuator, 4.0, {}, stimulus, over).inputs["current"] == 9.0


def test_the_start_has_the_values_that_are_set(actuator):
    point = with_outputs(actuator, start_point(actuator, {"charge_start": 1.0, "current": 2.0}))
    assert point.states["charge"] == 1.0
    voltage = R1 * (R2 * 2.0 - 1.0 / C) / (R1 + R2) + 1.0 / C
    assert point.outputs["voltage"] == pytest.approx(voltage, rel=1e-12)
    assert point_at(actuator, 0.0, {"charge_start": 1.0}).states["charge"] == 1.0


def test_discrete_states_are_those_before_a_sample():
    graph = trace(component("voice_coil_dma"))
    values = {"force_reference": 1.0}
    before = point_at(graph, 1.0 / 30.0, values).discretes["voltage_command"]
    after = point_at(graph, 1.0 / 30.0 + 1e-6, values).discretes["voltage_command"]
    # eq. 2.2: 0.66 at the first sample, and 0.6 more at the next, as nothing pulls yet
    assert (before, after) == pytest.approx((0.66, 1.26), rel=1e-9)


class Lag(Component):
    """A lag of first order, T dx/dt = g u - x."""

    name = "lag"
    gain = Parameter(80.0, "K", min=1.0, max=1e3)
    lag_time = Parameter(600.0, "s", min=1.0, max=1e4)
    drive = Input("1")
    response = State("K", rate="rate", start=300.0)

    def rate(self):
        return (self.gain * self.drive - self.response) / self.lag_time

    @Output("K")
    def measured(self):
        return self.response


PERIOD, DELAY, SENSOR = 10.0, 47.0, 90.0
POINTS = {
    "start": (0.0, None),
    "run": (200.0, None),
    "rest": (0.0, TrimRequest({"response": 300.0}, ["drive"])),
}


@pytest.mark.parametrize("name", POINTS)
@pytest.mark.parametrize("is_late", [True, False])
def test_a_sensor_is_late_at_every_operating_point(name, is_late):
    """Against g / (T s + 1), held and sampled, behind a dead time or the lag of a sensor."""
    sampling = Sampling(PERIOD, 100.0)
    effect = transport_delay if is_late else sensor_lag
    value = {"measured_delay": DELAY} if is_late else {"measured_lag_time": SENSOR}
    graph = trace(stack(Lag, effect(Lag, "measured", sampling), defaults=value))
    time, request = POINTS[name]
    point = point_at(graph, time, {})
    if request:
        point = trim(graph, point, request)
    path = blocks_of(graph, point).between(["drive"], ["measured"])
    matrices = assemble(path, ["measured"], PERIOD)
    f = np.geomspace(1e-4, 1e-2, 7)
    z = np.exp(2j * np.pi * f * PERIOD)
    n = len(matrices.A)
    column = matrices.B[:, -1:]
    found = [(matrices.C @ np.linalg.solve(w * np.eye(n) - matrices.A, column))[0, 0] for w in z]
    if is_late:  # modified z-transform: 3 s behind each sample, five samples late
        early, whole = np.exp(-(5 * PERIOD - DELAY) / 600.0), np.exp(-PERIOD / 600.0)
        expected = 80.0 * ((1.0 - early) * z + early - whole) / (z - whole) * z**-5
    else:
        numerator, denominator, _ = cont2discrete(
            ([80.0], np.polymul([600.0, 1.0], [SENSOR, 1.0])), PERIOD
        )
        expected = np.polyval(numerator[0], z) / np.polyval(denominator, z)
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("name", ["start", "run"])
@pytest.mark.parametrize("delay", [40.0, 50.0])
def test_a_command_is_late_at_every_operating_point(name, delay):
    """Against g / (T s + 1), held and sampled, behind a dead time of whole samples."""
    effect = input_delay(Lag, "drive", sampling=Sampling(PERIOD, 100.0))
    graph = trace(stack(Lag, effect, defaults={"drive_delay": delay}))
    path = blocks_of(graph, point_at(graph, POINTS[name][0], {})).between(["drive"], ["measured"])
    matrices = assemble(path, ["measured"], PERIOD)
    z = np.exp(2j * np.pi * np.geomspace(1e-4, 1e-2, 7) * PERIOD)
    column = matrices.B[:, -1:]
    found = [
        (matrices.C @ np.linalg.solve(w * np.eye(len(column)) - matrices.A, column))[0, 0]
        for w in z
    ]
    whole = np.exp(-PERIOD / 600.0)
    expected = 80.0 * (1.0 - whole) / (z - whole) * z ** -(delay / PERIOD)
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("time", [-1.0, np.inf, np.nan])
def test_a_time_before_the_start_is_refused(actuator, time):
    with pytest.raises(UserError, match="a time from 0 s on"):
        point_at(actuator, time, {})
