"""Claims: a parameter that is moved in a run leaves every output where it is, but for named ones.

States keep their values, and outputs follow the laws. Of a state that lacks a factor of its output,
as the integral of the error lacks the gain of a controller, the output would jump.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from math import inf, pi, sin

import pytest

from fmus import COMPONENTS, component, effects
from fmus.kit import Component, Discrete, Input, Output, Parameter
from fmus.kit.declare import ParameterDeclaration
from fmus.kit.effects import Effect
from fmus.kit.slave import Slave
from tests.support.stimuli import STIMULI

POINTS = (5, 17, 38, 62)  # at which parameters are moved
INSTANT = 1e-6  # of a step: samples are taken, and little else happens

# Parameters at which outputs jump, by the reason for which they have to
JUMPS = {
    "an output is the distance from the limit": """
        ppy_actuator.force_limit ppy_actuator.compression_limit ppy_actuator.displacement_limit
        ppy_actuator.voltage_limit ppy_actuator_length_driven.force_limit
        ppy_actuator_length_driven.compression_limit ppy_actuator_length_driven.displacement_limit
        ppy_actuator_length_driven.voltage_limit ppy_actuator_voltage_driven.force_limit
        ppy_actuator_voltage_driven.compression_limit ppy_actuator_voltage_driven.displacement_limit
        ppy_actuator_voltage_driven.voltage_limit
        foot_displacement_driven.an_compression_limit foot_displacement_driven.do_compression_limit
        foot_displacement_driven.pl_compression_limit
        foot_displacement_driven.po_compression_limit""",
    "an output is at the limit": """
        galvanostat.current_limit voice_coil_dma.voltage_max displacement_controller.current_limit
        displacement_controller.charge_limit displacement_controller.charge_uncertainty
        displacement_controller.approach_time state_feedback.current_limit
        adaptive_controller.gain_min impedance_controller.force_min impedance_controller.force_max
        degradation_estimator.initial_voltage_limit foot_design.actuator_force
        foot_design.actuator_stroke""",
    "an output is in proportion to it": """
        impedance_controller.stiffness impedance_controller.damping impedance_controller.preload
        state_feedback.charge_gain state_feedback.reference_gain adaptive_controller.model_time
        pid.derivative_time isotonic_stand.carrier_ripple""",
    "an output is the excess over it": "galvanostat.control_tolerance",
}

# Strengths of effects that cannot be moved
HELD = {
    "states hang on it": {"lag_time", "staged_lag_time"},
    "it is a rate that acts from the start": {"resistance_growth_rate", "capacitance_fade_rate"},
}


class Positional(Component):
    """A controller that holds the integral of the error, and not of its product with the gain."""

    name = "positional"

    period = Parameter(0.1, "s", doc="sample period")
    gain = Parameter(1.0, "1/s", tunable=True, doc="gain of the integral")
    error = Input("1", doc="error")
    integral = Discrete("s", update="next_integral", period="period", doc="integral of the error")

    def next_integral(self):
        return self.integral + self.period * self.error

    @Output("1")
    def command(self):
        """Command."""
        return self.gain * self.integral


class Run:
    """A component at a communication point of its stimuli."""

    def __init__(self, cls: type[Component]):
        self.layout = cls.layout
        self.names = self.layout.names
        self.memory = array("d", [0.0] * (len(self.names) + 4 + len(self.layout.sampled)))
        self.slave = Slave(cls, memoryview(self.memory))
        self.time = 0.0
        for variable in (*self.layout.parameters, *self.layout.inputs):
            self.set(variable.name, variable.start)
        for state, start in self.layout.start_of.items():
            self.set(state, self.memory[self.names.index(start)])
        # hint, start time, tolerance, parameters changed
        self.memory[len(self.names) : len(self.names) + 4] = array("d", [inf, 0.0, 1e-6, 1.0])
        assert self.slave.initialize() is None

    def set(self, name: str, value: float) -> None:
        self.memory[self.names.index(name)] = value

    def tune(self, name: str, value: float) -> None:
        self.set(name, value)
        self.memory[len(self.names) + 3] = 1.0

    def outputs(self) -> dict[str, float]:
        assert self.slave.evaluate(self.time) is None
        return {
            v.name: self.memory[self.names.index(v.name)]
            for v in self.layout.variables
            if v in self.layout.outputs or getattr(v, "output", False)
        }

    def advance(self, step: float) -> None:
        assert self.slave.advance(self.time, step) is None
        self.time += step


def points(cls: type[Component], step: float, stimuli: dict) -> Iterator[tuple[Run, float]]:
    """Yield a run at some of its communication points, at which samples are due, and its step."""
    run = Run(cls)
    if run.layout.sampled:
        clock, _ = run.layout.sampled[0]
        step = run.layout.variables[run.layout.parameter_index[clock.period]].start
    for k in range(max(POINTS) + 1):
        for signal, (mean, size, speed) in stimuli.items():
            run.set(signal, mean + size * sin(speed * run.time + 0.2 * pi))
        if k in POINTS:
            yield run, step
        run.advance(step)


def moved(parameter: ParameterDeclaration) -> list[float]:
    """Half, half as much again and twice its value, or what is typical; those that are allowed."""
    value = parameter.start or parameter.nominal
    return [f * value for f in (0.5, 1.5, 2.0) if parameter.min <= f * value <= parameter.max]


def jumps(run: Run, step: float, parameter: ParameterDeclaration) -> set[str]:
    """Outputs that jump at once, or at the sample that is due, by more than four usual changes."""
    saved, time = array("d", run.memory), run.time

    def go_on(value: float) -> tuple[dict[str, float], dict[str, float]]:
        run.memory[:] = saved
        run.time = time
        run.tune(parameter.name, value)
        at_once = run.outputs()
        run.advance(INSTANT * step)
        return at_once, run.outputs()

    before, usual = go_on(parameter.start)
    found = set()
    for value in moved(parameter):
        at_once, after = go_on(value)
        for name, held in before.items():
            allowed = 4.0 * abs(usual[name] - held) + 1e-3 * abs(held)
            if at_once[name] != held or abs(after[name] - held) > allowed:
                found.add(name)
    run.memory[:] = saved
    run.time = time
    run.tune(parameter.name, parameter.start)
    return found


def parameters_with_jumps(cls: type[Component], step: float, stimuli: dict) -> set[str]:
    tunable = [p for p in cls.layout.parameters if p.tunable]
    return {
        f"{cls.name}.{parameter.name}"
        for run, step in points(cls, step, stimuli)
        for parameter in tunable
        if jumps(run, step, parameter)
    }


@pytest.mark.parametrize(
    "name", [n for n in COMPONENTS if any(p.tunable for p in component(n).layout.parameters)]
)
def test_no_output_jumps_without_a_reason(name):
    _, step, stimuli = STIMULI[name]
    with_reason = {jump for reason in JUMPS.values() for jump in reason.split()}
    found = parameters_with_jumps(component(name), step, stimuli)
    assert found == {jump for jump in with_reason if jump.startswith(f"{name}.")}


def test_a_state_that_lacks_a_factor_of_its_output_is_found():
    found = parameters_with_jumps(Positional, 0.1, {"error": (1.0, 0.5, 2.0)})
    assert found == {"positional.gain"}


def catalogue() -> list[type[Effect]]:
    return [effect for name in COMPONENTS for effect in effects(name).values()]


def test_strengths_of_effects_are_tunable_but_for_a_reason():
    held = {
        effect.neutral
        for effect in catalogue()
        for parameter in effect.layout.parameters
        if parameter.name == effect.neutral and not parameter.tunable
    }
    assert held == set().union(*HELD.values())


def test_what_a_run_begins_with_is_fixed():
    """Start values, sample periods, shifts and whatever has not been declared."""
    for name in COMPONENTS:
        layout = component(name).layout
        starts = {*layout.start_of.values()}
        clocks = {n for clock, _ in layout.sampled for n in (clock.period, *clock.shift)}
        tunable = {p.name for p in layout.parameters if p.tunable}
        assert not tunable & (starts | clocks), name
