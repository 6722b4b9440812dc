"""The system of a plant and its controller: the loop that runs, and its files."""

import numpy as np
import pytest

import ppy_rig as ppy
from fmus.kit import stack
from fmus.kit.inputs import input_delay
from fmus.kit.sensors import sensor_lag
from fmus.ppy_actuator.model import PpyActuator
from orchestration.experiment.system_model import system_model
from orchestration.system import checking
from tests.support.hosts import build_one_state_fmu, build_pythonfmu
from tests.support.sine_sweep import SineSweep, sine_sweep

SIGNALS = {"command": "current", "measured": "displacement"}
AT = {"sample_period": "20ms", "crossover": "0.5Hz"}
HELD = {"trim": True, "fix": {"displacement": "0.05mm"}, "free": ["current"]}


def test_the_loop_that_runs_is_the_loop_of_the_design():
    """From the equilibrium on, within the limits, with the FMUs of both."""
    found = ppy.design("ppy_actuator", **SIGNALS, **AT, **HELD, limits="-0.2A..0.3A")
    size = 2.0 * found.step_size
    step = found.step(size)
    inputs = {"reference": np.full(found.time.size, 5e-5 + size)}
    run = ppy.run(found.system, found.time, inputs)
    np.testing.assert_allclose(run.signals["plant.displacement"], step.measured, rtol=1e-9)
    assert step.measured[0] == pytest.approx(5e-5, rel=1e-9)
    assert step.command.min() == -0.2, "the limit acts"
    assert step.command.max() <= 0.3


@pytest.mark.parametrize("kind", ["trim", "run"])
def test_a_loop_with_delay_and_lag_begins_at_its_operating_point(kind):
    """It stays there, and answers to a step no earlier than its command does."""
    lag = sensor_lag(PpyActuator, "displacement")
    values = {"current_delay": 0.1, "displacement_lag_time": 0.05}
    cls = stack(PpyActuator, input_delay(PpyActuator, "current"), lag, defaults=values)
    place = HELD if kind == "trim" else {"settings": {"current": 0.1}, "at": ["300s"]}
    found = ppy.design(cls, **SIGNALS, **AT, **place)
    rest = found.point.inputs["reference"]
    time = 0.02 * np.arange(100)
    size = found.step_size
    still, moved = (
        ppy.run(found.system, time, {"reference": np.full(time.size, level)})
        for level in (rest, rest + size)
    )
    rested, stepped = (one.signals["plant.displacement"] for one in (still, moved))
    assert np.abs(rested - rest).max() < 0.02 * size
    assert np.abs((stepped - rested)[:6]).max() < 1e-3 * size, "not before the dead time of 0.1 s"
    assert stepped[-1] - rested[-1] > 0.1 * size
    cut = ppy.linearise(found.system, cut="plant.displacement").margins()
    np.testing.assert_allclose(cut, found.margins(), rtol=1e-6)


def test_every_input_of_the_controller_is_stated():
    found = ppy.design("ppy_actuator", **SIGNALS, **AT)
    open_inputs = [str(port) for port in checking.open_inputs(found.system)]
    assert not [name for name in open_inputs if name.startswith("controller.")]


def test_the_loop_that_is_cut_has_the_margins_of_the_design():
    """By the Jacobians of the joined laws, of which the design knows nothing."""
    found = ppy.design("ppy_actuator", **SIGNALS, **AT)
    cut = ppy.linearise(found.system, cut="plant.displacement").margins()
    np.testing.assert_allclose(cut, found.margins(), rtol=1e-9)


def test_a_loop_without_a_reference_rests_where_it_was_designed(tmp_path):
    """Its file, too: at a reference of zero the controller would be at its limit."""
    found = ppy.design("ppy_actuator", **SIGNALS, **AT, **HELD, limits="-0.2A..0.3A")
    run = ppy.run(found.system, found.time[:50], {})
    np.testing.assert_allclose(run.signals["plant.displacement"], 5e-5, rtol=1e-9)
    assert system_model(found.system).inputs["reference"].start == pytest.approx(5e-5)
    found.write(tmp_path)
    cut = ppy.linearise(str(tmp_path / "loop.ssp"), cut="controller.measured").margins()
    np.testing.assert_allclose(cut, found.margins(), rtol=1e-6)


def test_a_system_that_is_sampled_gives_its_period_and_its_step():
    pulled = {"settings": {"force_reference": 1.0}, "at": ["1s"]}
    asked = {"phase_margin": 80.0, "controller": "pi", "limits": (0.0, 3.0)}
    found = ppy.design(
        "dma_bench", command="force_reference", measured="actuator.tension", **pulled, **asked
    )
    assert found.plant.period == pytest.approx(1.0 / 30.0)
    assert found.margins().phase == pytest.approx(80.0, abs=0.1)
    assert found.system.step == pytest.approx(1e-4, rel=0.01)
    time = found.system.step * np.arange(334 * 60)
    wanted = np.full(time.size, 1.0 + found.step_size)
    run = ppy.run(found.system, time, {"reference": wanted})
    tension = run.signals["actuator.tension"]
    assert tension[0] == pytest.approx(1.0, rel=1e-3)
    assert tension[-1] == pytest.approx(wanted[-1], rel=1e-3)


def test_the_files_are_component_fmu_system_and_experiment(tmp_path):
    found = ppy.design("ppy_actuator", **SIGNALS, **AT, limits=(-1.3, 1.3))
    written = [path.name for path in found.write(tmp_path / "loop")]
    assert written == ["controller.py", "controller.fmu", "loop.ssp", "step.toml"]
    run = ppy.run(tmp_path / "loop" / "step.toml")
    expected = found.step(found.step_size).measured
    measured = np.asarray(run["plant.displacement"])
    np.testing.assert_allclose(measured, expected[: measured.size], rtol=0, atol=1e-14)
    own = ppy.simulate(f"{tmp_path}/loop/controller.py:Controller", {"reference": 1e-6}, stop=0.1)
    assert own["command"][-1] > 0.0


@pytest.mark.slow  # builds a packed FMU
def test_the_loop_is_packed_into_one_fmu_which_steps_as_the_design_does(tmp_path):
    """By its own start values, and the laws of its members."""
    found = ppy.design("ppy_actuator", **SIGNALS, **AT)
    path = ppy.build(found.system, tmp_path / "loop.fmu")
    step = found.step(1e-5)
    run = ppy.simulate(path, {"reference": np.full(found.time.size, 1e-5)}, time=found.time)
    np.testing.assert_allclose(run["displacement"], step.measured, atol=1e-12)


FREQUENCIES = np.array([0.1, 0.5, 2.0, 8.0])


@pytest.mark.slow  # runs an FMU as anybody's at a communication step of 1 ms
@pytest.mark.parametrize("controller", ["pid", "adaptive"])
def test_a_loop_with_an_fmu_of_others_answers_a_sine_sweep_as_the_design_says(controller, tmp_path):
    """From reference to measured value of co-simulation, within 0.2 dB and 2 degrees.

    The FMU hides its state and tells no equations: ``tau dx/dt = u - x``.
    """
    fmu = build_one_state_fmu(tmp_path)
    asked = {"controller": controller, "sample_period": "20ms", "crossover": 0.5}
    found = ppy.design(fmu, command="u", measured="x", settings={"tau": 0.7}, **asked)
    h = found.plant.period
    sweep = SineSweep(FREQUENCIES, 0.1, h, h, settling=20.0)
    measured = sine_sweep(found.system, "reference", ["plant.x"], sweep)["plant.x"]
    z = np.exp(2j * np.pi * FREQUENCIES * h)
    a, b = np.exp(-h / 0.7), -np.expm1(-h / 0.7)
    plant = b / (z - a)
    p = found.parameters
    if controller == "adaptive":
        pole = np.exp(-h / p["model_time"])
        expected = (1.0 - pole) / (z - pole)
    else:
        s = (1.0 - 1.0 / z) / h
        integral = p["proportional_gain"] * (1.0 + 1.0 / (p["integral_time"] * s))
        by_rate = p["derivative_time"] * s / (p["filter_time"] * s + 1.0)
        derivative = p["proportional_gain"] * by_rate
        expected = plant * integral / (1.0 + plant * (integral + derivative))
    ratio = measured / expected
    assert np.abs(20.0 * np.log10(np.abs(ratio))).max() < 0.2
    assert np.abs(np.degrees(np.angle(ratio))).max() < 2.0
    loop = found.loop.response(FREQUENCIES)
    np.testing.assert_allclose(loop, -found.law.response(FREQUENCIES) * plant, rtol=1e-4)


TANK = """
from math import exp

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Tank(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.heater, self.temperature, self.past = 0.0, 0.0, [0.0] * 12
        self.register_variable(Real("heater", causality=Fmi2Causality.input))
        self.register_variable(Real("temperature", causality=Fmi2Causality.output))

    def do_step(self, time, step):
        kept = exp(-step / 600.0)
        self.past.append(self.heater)
        self.temperature = kept * self.temperature + (1.0 - kept) * 0.8 * self.past.pop(0)
        return True
"""


@pytest.mark.slow  # an interpreter in the FMU
def test_a_tank_with_a_dead_time_of_samples_is_designed_by_pulses_of_its_step(tmp_path):
    """0.8 / (600 s + 1) behind 120 s, sampled every 10 s; a PI has the margin that is asked for."""
    fmu = build_pythonfmu(tmp_path, "tank", TANK)
    asked = {"controller": "pi", "sample_period": "10s", "phase_margin": 60.0}
    found = ppy.design(fmu, command="heater", measured="temperature", step="10s", **asked)
    p, crossover = found.parameters, found.margins().crossover
    z, kept = np.exp(2j * np.pi * crossover * 10.0), np.exp(-10.0 / 600.0)
    law = p["proportional_gain"] * (1.0 + 10.0 / p["integral_time"] / (1.0 - 1.0 / z))
    loop = law * 0.8 * (1.0 - kept) / (z - kept) * z**-12
    assert abs(loop) == pytest.approx(1.0, rel=1e-4)
    assert np.degrees(np.angle(-loop)) == pytest.approx(60.0, abs=0.05)
