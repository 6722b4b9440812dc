"""Claims: a component compiled for fitting follows exact solutions, its sensitivities too.

Oracles are solutions on paper, differentiated by a complex step (exact to rounding), and central
differences.
"""

import numpy as np
import pytest
from scipy.linalg import expm

from fmus.kit import Component, Discrete, Input, Output, Parameter, State, UserError, stack
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.symbolic.sensitivity import with_sensitivities
from fmus.kit.symbolic.tracing import trace
from fmus.ppy_actuator.effects.ageing import ResistanceGrowth
from fmus.ppy_actuator.effects.electrical import DoubleLayer
from fmus.ppy_actuator.model import PpyActuator, PpyActuatorLengthDriven
from orchestration.experiment.waveforms import multilevel, square_wave

ELECTRICAL = {"R1": 0.61, "R2": 1.9, "C": 2.2, "charge_start": 0.7}
MECHANICAL = {"k1": 5000.0, "b1": 2e5, "k2": 8000.0, "b2": 9e4, "kelvin_elongation_start": 2e-5}


class Sampled(Component):
    """A first-order plant under a sampled PI law; the sampling period is a parameter of its own."""

    name = "sampled"

    a = Parameter(0.8, "1/s", min=1e-6)
    b = Parameter(1.5, "1/s")
    gain = Parameter(0.6, "1")
    reset = Parameter(0.9, "1/s")
    period = Parameter(0.5, "s", min=1e-3)
    reference = Input("1", start=1.0)
    x = State("1", rate="x_rate", start=0.2, output=True)
    drive = Discrete("1", update="next_drive", period="period")
    sum = Discrete("1", update="next_sum", period="period", start=0.1)

    def x_rate(self):
        return -self.a * self.x + self.b * self.drive

    def next_drive(self):
        return self.gain * (self.reference - self.x) + self.sum

    def next_sum(self):
        return self.sum + self.reset * self.period * (self.reference - self.x)

    @Output("1")
    def driven(self):
        """Return the drive that the controller sets."""
        return self.drive


def complex_step(function, values, name):
    """Return the derivative of an analytic function by a parameter, exact to rounding."""
    step = 1e-30 * abs(values[name])
    return np.imag(function(**values | {name: values[name] + 1j * step})) / step


def close(actual, expected, tolerance):
    """Relative to the largest expected value."""
    assert np.max(np.abs(actual - expected)) <= tolerance * np.max(np.abs(expected))


def samples(step: float, count: int) -> np.ndarray:
    """Instants (s) from zero on."""
    return step * np.arange(count)


TIME = np.linspace(0.0, 40.0, 161)


def charge(R1, R2, C, charge_start, current=0.9):
    """Charge (C) under a constant current: one exponential, time constant (R1 + R2) C."""
    return R2 * C * current + (charge_start - R2 * C * current) * np.exp(-TIME / ((R1 + R2) * C))


def voltage(R1, R2, C, charge_start, current=0.9):
    """Voltage (V): what R1 drops plus what the capacitor holds."""
    q = charge(R1, R2, C, charge_start, current)
    return R1 * (R2 * current - q / C) / (R1 + R2) + q / C


def creep(k1, b1, k2, b2, kelvin_elongation_start, force=1.5):
    """Elongation (m) of a Burgers body under a constant load."""
    decay = np.exp(-k2 * TIME / b2)
    return (
        force / k1 + force * TIME / b1 + force / k2 * (1 - decay) + kelvin_elongation_start * decay
    )


@pytest.mark.parametrize(
    ("values", "solutions"),
    [
        (ELECTRICAL, {"charge": charge, "voltage": voltage}),
        (MECHANICAL, {"mechanical_displacement": creep}),
    ],
)
def test_actuator_and_its_sensitivities_follow_the_solution_on_paper(values, solutions):
    names = list(values)
    constant = {"current": np.full(TIME.size, 0.9), "force": np.full(TIME.size, 1.5)}
    trajectory = CompiledModel(PpyActuator, names).run(TIME, constant, values)
    for signal, solution in solutions.items():
        close(trajectory.signals[signal], solution(**values), 1e-8)
        for i, name in enumerate(names):
            close(
                trajectory.sensitivities[signal][:, i], complex_step(solution, values, name), 1e-7
            )


def sampled_solution(*, a, b, gain, reset, x_start, sum_start, drive_start, reference):
    """Return x at every sample, exactly: between instants the drive is held.

    Updates come at the start of a step.
    """
    step = 0.5
    x, total, drive, found = x_start, sum_start, drive_start, []
    for r in reference:
        found.append(x)
        drive, total = gain * (r - x) + total, total + reset * step * (r - x)
        x = np.exp(-a * step) * x + (1 - np.exp(-a * step)) / a * b * drive
    return np.array(found)


def test_sensitivities_pass_through_sampled_updates():
    time = samples(0.5, 60)
    reference = np.where(time < 12.0, 1.0, -0.4)
    values = {
        "a": 0.8,
        "b": 1.5,
        "gain": 0.6,
        "reset": 0.9,
        "x_start": 0.2,
        "sum_start": 0.1,
        "drive_start": 0.3,
    }

    def solution(**values):
        return sampled_solution(**values, reference=reference)

    trajectory = CompiledModel(Sampled, list(values)).run(time, {"reference": reference}, values)
    close(trajectory.signals["x"], solution(**values), 1e-8)
    for i, name in enumerate(values):
        exact = complex_step(solution, values, name)
        assert np.max(np.abs(trajectory.sensitivities["x"][:, i] - exact)) <= 1e-7 * max(
            1.0, np.max(np.abs(exact))
        )


def test_sampling_between_communication_points_is_followed_too():
    """The same run at steps of 0.2 s: only every fifth sample instant is a communication point."""
    instants, time = samples(0.5, 41), samples(0.2, 101)
    values = {
        "a": 0.8,
        "b": 1.5,
        "gain": 0.6,
        "reset": 0.9,
        "x_start": 0.2,
        "sum_start": 0.1,
        "drive_start": 0.0,
    }
    trajectory = CompiledModel(Sampled, ["gain"]).run(time, {}, values)

    def solution(**values):
        return sampled_solution(**values, reference=np.ones(instants.size))

    close(trajectory.signals["x"][::5], solution(**values)[::2], 1e-8)
    close(trajectory.sensitivities["x"][::5, 0], complex_step(solution, values, "gain")[::2], 1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("cls", [PpyActuator, PpyActuatorLengthDriven])
def test_all_sensitivities_match_central_differences_on_lively_inputs(cls):
    time = samples(0.25, 400)
    inputs = {"current": square_wave(time, 0.9, 0.11)}
    if cls is PpyActuator:
        inputs["force"] = multilevel(time, [0.5, 1.0, 2.75], (3.0, 9.0), 5)
    else:
        inputs["length_change"] = 3e-4 + multilevel(
            time, [0.0, 1e-4, 3e-4], (3.0, 9.0), 5
        )  # taut throughout
    names = [p.name for p in cls.layout.parameters]
    model, plain = CompiledModel(cls, names), CompiledModel(cls)
    trajectory = model.run(time, inputs)
    for i, parameter in enumerate(cls.layout.parameters):
        step = 1e-4 * (abs(float(parameter.start)) or parameter.nominal)
        ends = [
            plain.run(time, inputs, {parameter.name: float(parameter.start) + s * step})
            for s in (1, -1)
        ]
        for signal in trajectory.signals:
            slope = (ends[0].signals[signal] - ends[1].signals[signal]) / (2 * step)
            error = np.max(np.abs(trajectory.sensitivities[signal][:, i] - slope))
            # the floor: what the integration error of the two runs leaves of a zero slope
            floor = 1e-7 * np.max(np.abs(trajectory.signals[signal])) / step
            assert error <= 1e-5 * np.max(np.abs(slope)) + 1e-2 * floor, (parameter.name, signal)


def test_interpolated_inputs_follow_a_ramp_exactly():
    """F = c t on a dashpot gives c t^2 / (2 b1); held, the force is always one sample old."""
    time, slope = samples(0.5, 101), 0.2
    stiff = {
        "k1": 1e15,
        "b2": 1e18,
        "b1": 2e5,
    }  # of the chain only the Maxwell dashpot is left to move
    model = CompiledModel(PpyActuator)
    ramp = model.run(time, {"force": slope * time}, stiff, linear=True).signals["displacement"]
    close(ramp, slope * time**2 / 2 / 2e5, 1e-8)
    held = model.run(time, {"force": slope * time}, stiff).signals["displacement"]
    close(held, slope * 0.5**2 / 2e5 * np.arange(101) * (np.arange(101) - 1) / 2, 1e-8)


class TwoIntegrators(Component):
    """Each input, integrated."""

    name = "two_integrators"
    u = Input("1")
    v = Input("1")
    x = State("s", rate="x_rate", output=True)
    y = State("s", rate="y_rate", output=True)

    def x_rate(self):
        return self.u

    def y_rate(self):
        return self.v


@pytest.mark.parametrize("linear", [[], ["u"], ["v"], ["u", "v"]])
def test_one_input_is_held_while_another_goes_linearly(linear):
    """The integral of c t is c t^2 / 2 where it is linear, or of a held sample."""
    time, n, step = samples(0.5, 101), np.arange(101), 0.5
    signals = (
        CompiledModel(TwoIntegrators)
        .run(time, {"u": 2.0 * time, "v": 3.0 * time}, linear=linear)
        .signals
    )
    exact, held = time**2 / 2, step**2 * n * (n - 1) / 2
    close(signals["x"], 2.0 * (exact if "u" in linear else held), 1e-12)
    close(signals["y"], 3.0 * (exact if "v" in linear else held), 1e-12)


def test_the_answer_does_not_depend_on_which_sensitivities_are_asked():
    inputs = {"current": square_wave(TIME, 0.9, 0.2), "force": np.ones(TIME.size)}
    alone = CompiledModel(PpyActuator).run(TIME, inputs)
    beside = CompiledModel(PpyActuator, ["R1", "b2"]).run(TIME, inputs)
    for signal in alone.signals:
        close(beside.signals[signal], alone.signals[signal], 1e-8)
        assert alone.sensitivities[signal].shape == (TIME.size, 0)


@pytest.mark.parametrize("resistance", [0.0, 0.1])
def test_sensitivities_of_an_effect_at_neutral_and_beside_follow_the_solution_on_paper(resistance):
    """A parameter whose default is zero sets no scale, but its sensitivity must be accurate.

    Free charge and current through the double layer are linear in themselves: a matrix exponential,
    differentiated by a complex step.
    """
    R1, R2, C, tau = 0.43, 2.35, 2.70, 0.2

    def solution(R_dl):
        flow = np.array([-1 / C, -R_dl, R2 * 0.9]) / (R1 + R2)
        matrix = np.array([flow, (flow - [0, 1, 0]) / tau, [0, 0, 0]])
        states = np.array([expm(matrix * t) @ [0.7, 0.0, 1.0] for t in TIME]).T
        return {
            "charge": states[0],
            "faradaic_current": states[1],
            "voltage": R1 * (flow @ states) + states[0] / C + R_dl * states[1],
        }

    model = CompiledModel(stack(PpyActuator, DoubleLayer), ["double_layer_resistance"])
    values = {"double_layer_resistance": resistance, "charge_start": 0.7}
    trajectory = model.run(TIME, {"current": np.full(TIME.size, 0.9)}, values)
    for signal, exact in solution(resistance + 1e-30j).items():
        close(trajectory.signals[signal], exact.real, 1e-7)
        close(trajectory.sensitivities[signal][:, 0], exact.imag / 1e-30, 1e-6)


def test_sensitivities_are_declared_with_the_scale_of_their_parameter():
    layout = with_sensitivities(trace(Sampled), ["x_start", "b"]).layout
    assert {s.name: s.nominal for s in layout.states} == {
        "x": 1.0,
        "d(x)/d(x_start)": 5.0,
        "d(x)/d(b)": 1 / 1.5,
    }
    starts = {p.name: p.start for p in layout.parameters}
    assert starts["d(x)/d(x_start)_start"] == 1.0
    assert starts["d(x)/d(b)_start"] == 0.0
    assert layout.start_of["d(x)/d(b)"] == "d(x)/d(b)_start"
    effect = with_sensitivities(
        trace(stack(PpyActuator, ResistanceGrowth)), ["resistance_growth_rate"]
    ).layout
    (throughput,) = (
        s for s in effect.states if s.name == "d(throughput)/d(resistance_growth_rate)"
    )
    assert throughput.nominal == pytest.approx(1.0 / 1e-3)
    assert throughput.min == -np.inf  # other than the throughput itself


def test_a_graph_is_compiled_as_its_class_is():
    inputs = {"current": square_wave(TIME, 0.9, 0.2)}
    one, other = (
        CompiledModel(m, ["C"]).run(TIME, inputs) for m in (PpyActuator, trace(PpyActuator))
    )
    for signal, values in one.signals.items():
        np.testing.assert_array_equal(other.signals[signal], values)
        np.testing.assert_array_equal(other.sensitivities[signal], one.sensitivities[signal])


def test_mistakes_are_told():
    with pytest.raises(
        UserError, match="sampled: no sensitivity to 'period', which moves sample instants"
    ):
        CompiledModel(Sampled, ["gain", "period"])
    with pytest.raises(
        UserError, match=r"ppy_actuator: no input named 'curent' \(there are: current, force\)"
    ):
        CompiledModel(PpyActuator).run(
            TIME, {"force": np.ones(TIME.size), "curent": np.ones(TIME.size)}
        )
    with pytest.raises(UserError, match="no parameter named 'Rl'"):
        CompiledModel(PpyActuator, ["Rl"])
    model = CompiledModel(PpyActuator)
    with pytest.raises(UserError, match="no parameter named 'k9'"):
        model.run(TIME, {}, {"k9": 1.0})
    with pytest.raises(UserError, match="times must increase, but 1 s follows 2 s"):
        model.run(np.array([0.0, 2.0, 1.0]), {})
    with pytest.raises(UserError, match="not a finite number at t = 2 s"):
        model.run(np.arange(4.0), {"current": np.array([0.0, 1.0, np.nan, 1.0])})
