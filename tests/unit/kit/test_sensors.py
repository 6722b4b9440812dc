"""Effects of a measurement: neutral at zero, their equation elsewhere; physics stays."""

import importlib.util
import itertools
import sys
from functools import cache

import numpy as np
import pytest
from scipy.signal import lsim

import fmus
from fmus.kit import Component, Input, Output, UserError, stack
from fmus.kit.build.building import RUNTIMES, build
from fmus.kit.build.toolchain import host_platform
from fmus.kit.inputs import input_offset
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel
from fmus.kit.sampling import Sampling
from fmus.kit.sensors import (
    MEASUREMENTS,
    measurement_effects,
    sensor_drift,
    sensor_gain,
    sensor_lag,
    sensor_offset,
    transport_delay,
)
from fmus.kit.symbolic.tracing import trace
from fmus.ppy_actuator.model import PpyActuator, PpyActuatorLengthDriven
from orchestration.fmu.instance import Fmu
from orchestration.fmu.signal import declared_signal, read_setting, start_of
from orchestration.fmu.simulation import simulate_instance
from orchestration.identify.fitting.delay import DelayedModel
from orchestration.identify.fitting.simulation_input import SimulationInput
from tests.support.kit_samples import Thermostat
from tests.support.pace import slow_but

# effect -> parameter without the output in front, neutral value, another value
PARAMETERS = {
    "sensor_lag": ("lag_time", 0.0, 0.2),
    "transport_delay": ("delay", 0.0, 0.113),
    "sensor_gain": ("gain", 1.0, 1.07),
    "sensor_offset": ("offset", 0.0, 0.03),
    "sensor_drift": ("drift", 0.0, 2e-3),
}
VOLTAGE = {f"voltage_{name}": value for name, _, value in PARAMETERS.values()}
SHORTEST_LAG, DELAY_PERIOD, DELAY_SAMPLES = 0.01, 0.02, 64  # s, s: on a bench
each = pytest.mark.parametrize("name", MEASUREMENTS)
# An actuator that is a spring of 1 N/m: its displacement is the force, and anything can be
# measured.
SPRING = {"k1": 1.0, "b1": 1e18, "b2": 1e18, "k2": 1.0, "alpha": 0.0}


def evaluated(cls, values):
    """Rates, updates and outputs by name."""
    model = cls()
    for name, value in values.items():
        setattr(model, name, value)
    layout = cls.layout
    found = {f"der({s.name})": rate for s, rate in zip(layout.states, model.rates(), strict=True)}
    found |= {f"next({d.name})": getattr(model, d.update)() for d in layout.discretes}
    return found | {o.name: value for o, value in zip(layout.outputs, model.outputs(), strict=True)}


def random_values(cls, seed, size=None):
    rng = np.random.default_rng(seed)
    values = {p.name: abs(p.start) * rng.uniform(0.3, 3.0, size) for p in cls.layout.parameters}
    for v in (*cls.layout.inputs, *cls.layout.states, *cls.layout.discretes):
        values[v.name] = v.nominal * rng.normal(size=size) * 3.0
    for v in cls.layout.discretes:
        if v.type == "boolean":
            values[v.name] = (values[v.name] > 0.0) * 1.0
    values["time"] = rng.normal(size=size) * 3.0
    return values if size else {name: float(value) for name, value in values.items()}


@cache
def measuring(effect):
    """Return the actuator whose displacement is measured with this effect."""
    return CompiledModel(stack(PpyActuator, effect(PpyActuator, "displacement")))


def measure(effect, force, parameters, step=0.05, linear=False, start=0.0):
    """Time, and what is shown of a force that the spring makes an elongation of."""
    time = start + step * np.arange(len(force))
    shown = measuring(effect).run(time, {"force": force}, SPRING | parameters, linear).signals
    return time, shown["displacement"]


# --- the catalogue
# --------------------------------------------------------------------------------------------------


def test_every_real_output_has_every_effect():
    for component in (PpyActuator, PpyActuatorLengthDriven, Thermostat):
        outputs = [o for o in component.layout.measured_outputs if o.type == "real"]
        found = measurement_effects(component)
        assert [(e.output, e.id) for e in found] == [
            (o.name, n) for o in outputs for n in PARAMETERS
        ]
        for effect, (output, (name, neutral, _)) in zip(
            found, itertools.product(outputs, PARAMETERS.values()), strict=True
        ):
            declared = effect.declared[effect.neutral]
            assert effect.neutral == f"{output.name}_{name}"
            assert declared.start == neutral
            assert effect.assumption
            assert effect.__doc__
            assert all(v.doc and v.unit for v in effect.declared.values())
            if name in ("offset", "drift"):
                assert declared.unit == output.unit + ("/s" if name == "drift" else "")


def test_a_sensor_reads_the_share_that_is_said():
    gain = sensor_gain(PpyActuator, "voltage")
    read = stack(PpyActuator, gain)(current=0.5, voltage_gain=1.03).voltage()
    (size,) = gain.sizes
    assert size.parameters == (gain.neutral,)
    assert size.quantity(1.03) == pytest.approx(100.0 * read / PpyActuator(current=0.5).voltage())


def test_names_and_titles():
    voltage, displacement = (sensor_lag(PpyActuator, name) for name in ("voltage", "displacement"))
    cls = stack(PpyActuator, voltage, displacement)
    assert cls.name == "ppy_actuator_with_sensor_lag_of_voltage_with_sensor_lag_of_displacement"
    assert cls.__name__ == "SensorLagOfDisplacementSensorLagOfVoltagePpyActuator"
    assert fmus.component("ppy_actuator").name == "ppy_actuator"


def test_what_cannot_be_measured_is_told():
    lag = sensor_lag(PpyActuator, "voltage")
    with pytest.raises(UserError, match="'sensor_lag_of_voltage' is laid over it twice"):
        stack(PpyActuator, lag, sensor_lag(PpyActuator, "voltage"))
    with pytest.raises(
        UserError, match=r"no measured output named 'voltag' \(did you mean voltage\?\)"
    ):
        sensor_lag(PpyActuator, "voltag")
    with pytest.raises(UserError, match="ppy_actuator: no measured output named 'charge'"):
        sensor_gain(PpyActuator, "charge")  # a state, which laws see
    with pytest.raises(UserError, match="thermostat: no measured output named 'warm'"):
        sensor_gain(Thermostat, "warm")  # a boolean
    with pytest.raises(UserError, match="sensor_lag is of 'voltage', which is none of its outputs"):
        stack(Thermostat, lag)


# --- neutral, and nothing else
# ----------------------------------------------------------------------------------------


@each
@pytest.mark.parametrize("size", [None, 200])
def test_neutral_is_bit_identical_and_only_the_output_changes(name, size):
    """Whatever the effect's own states hold, and on floats and arrays."""
    effect = MEASUREMENTS[name](PpyActuator, "voltage")
    cls, (_, neutral, value) = stack(PpyActuator, effect), PARAMETERS[name]
    known, moved = {v.name for v in PpyActuator.layout.variables} | {"time"}, False
    for seed in range(50 if size is None else 1):
        values = random_values(cls, seed, size)
        base = evaluated(PpyActuator, {n: v for n, v in values.items() if n in known})
        still = evaluated(cls, values | {effect.neutral: neutral})
        shown = evaluated(cls, values | {effect.neutral: value})
        for n, expected in base.items():
            np.testing.assert_array_equal(still[n], expected)
            if n != "voltage":
                np.testing.assert_array_equal(shown[n], expected)
        moved |= bool(np.any(shown["voltage"] != base["voltage"]))
    assert moved


@each
def test_neutral_is_bit_identical_in_the_graph(name):
    effect = MEASUREMENTS[name](PpyActuator, "voltage")
    cls = stack(PpyActuator, effect)
    graphs = [trace(c) for c in (cls, PpyActuator)]
    for seed in range(20):
        values = random_values(cls, seed) | {effect.neutral: PARAMETERS[name][1]}
        results = []
        for graph in graphs:
            layout = graph.layout
            groups = (layout.parameters, layout.inputs, layout.states, layout.discretes)
            rates, outputs, *_ = graph.functions(tangent=False)
            point = [np.array([values[v.name] for v in group]) for group in groups]
            results.append(
                (rates(values["time"], *point).full()[:3], outputs(values["time"], *point).full())
            )
        for found, expected in zip(*results, strict=True):
            np.testing.assert_array_equal(found, expected)


@each
def test_slope_at_neutral_is_that_of_differences_and_not_zero(name):
    effect, (_, neutral, _) = MEASUREMENTS[name](PpyActuator, "voltage"), PARAMETERS[name]
    cls, time = stack(PpyActuator, effect), 0.05 * np.arange(400)
    inputs = {"current": 0.9 * np.sin(1.3 * time) + 0.2, "force": 1.0 + 0.0 * time}
    found = CompiledModel(cls, [effect.neutral]).run(time, inputs, linear=True).sensitivities
    model, step = (
        CompiledModel(cls),
        1e-5,
    )  # into the range, which ends at neutral for the two times
    ends = [
        model.run(time, inputs, {effect.neutral: neutral + k * step}, linear=True).signals
        for k in range(3)
    ]
    slope = (4.0 * ends[1]["voltage"] - ends[2]["voltage"] - 3.0 * ends[0]["voltage"]) / (
        2.0 * step
    )
    # where the present is a sample, a delay shorter than rounding has no slope
    assert found["voltage"][1:, 0] == pytest.approx(
        slope[1:], rel=1e-3, abs=2e-3 * np.abs(slope).max()
    )
    assert np.abs(slope).max() > 0.1 * np.std(ends[0]["voltage"])
    assert not found["displacement"].any()


# --- what they show
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lag", [0.005, 0.02, 0.05, 0.2, 3.0])
def test_lag_follows_its_transfer_function(lag):
    force = np.where(np.arange(200) % 40 < 15, 1.0, -0.5)
    time, shown = measure(sensor_lag, force, {"displacement_lag_time": lag})
    rest = SHORTEST_LAG * np.exp(-lag / SHORTEST_LAG)
    # lsim holds the input from sample to sample; it starts at zero, so the deviation from the start
    # is what it gets
    numerator = [rest, 1.0] if rest > 1e-9 else [1.0]  # a first-order lag
    _, exact, _ = lsim(
        (numerator, [lag + rest, 1.0]), force - force[0], time - time[0], interp=False
    )
    assert shown == pytest.approx(force[0] + exact, abs=1e-6)


def test_a_ramp_is_late_by_the_lag_however_short():
    for lag in (0.002, 0.01, 0.1):
        time, shown = measure(
            sensor_lag, 0.05 * np.arange(100), {"displacement_lag_time": lag}, linear=True
        )
        assert shown[50:] == pytest.approx(time[50:] - lag, abs=1e-6)


@pytest.mark.parametrize("effect", [sensor_lag, transport_delay])
@pytest.mark.parametrize("start", [0.0, 1234.5])
def test_a_rig_at_rest_anywhere_shows_no_transient(effect, start):
    parameter = f"displacement_{PARAMETERS[effect.__name__][0]}"
    _, shown = measure(effect, np.full(60, 5.0), {parameter: 0.3}, start=start)
    np.testing.assert_array_equal(shown, 5.0)


delays = pytest.mark.parametrize(
    "delay", [0.0, 0.013, 0.02, 0.113, 0.7, DELAY_PERIOD * DELAY_SAMPLES]
)


@delays
@pytest.mark.parametrize("step", [0.02, 0.05, 0.0137])
def test_delay_is_exact_on_ramps(delay, step):
    n = int(6.0 / step)
    time, shown = measure(
        transport_delay, step * np.arange(n), {"displacement_delay": delay}, step, linear=True
    )
    assert shown == pytest.approx(np.maximum(time - delay, 0.0), abs=1e-9)


@delays
def test_delay_is_within_its_bound_on_a_sine(delay):
    """Inputs of 1 rad/s and 3 rad/s between fine samples; an eighth of period^2 times curvature."""
    for omega in (1.0, 3.0):
        fine = 0.001 * np.arange(6000)
        time, shown = measure(
            transport_delay, np.sin(omega * fine), {"displacement_delay": delay}, 0.001, linear=True
        )
        error = np.abs(shown - np.sin(omega * np.maximum(time - delay, 0.0)))
        bound = (DELAY_PERIOD**2 + 0.001**2) / 8.0 * omega**2
        if delay < 1.0:  # the kink at the start is no smooth signal
            error = error[np.abs(time - delay) > DELAY_PERIOD]
        assert error.max() <= bound * (1.0 + 1e-6)
        assert delay == 0.0 or error.max() > 0.1 * bound, "the bound is that of what is done"


@pytest.mark.parametrize(("scale", "period"), [(1e-3, 1e-4), (1e3, 50.0)])
def test_a_delay_is_held_on_the_clock_of_its_record(scale, period):
    """A sine of 1/s in the scale; between samples the error is an eighth of period^2 curvature."""
    step, delay = 0.05 * scale, 0.3 * scale
    sampling = Sampling(step, 1280.0 * period / 2.0)
    cls = stack(PpyActuator, transport_delay(PpyActuator, "displacement", sampling))
    time = step * np.arange(200)
    inputs = {"force": np.sin(time / scale)}
    given = SPRING | {"displacement_delay": delay}
    shown = CompiledModel(cls).run(time, inputs, given, linear=True).signals["displacement"]
    error = np.abs(shown - np.sin((time - delay) / scale))[time > 2.0 * delay]
    assert 0.0 < error.max() <= (period**2 + step**2) / 8.0 / scale**2 * (1.0 + 1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_lag_of_a_few_samples_is_a_lag_whatever_the_clock(scale):
    force = np.where(np.arange(200) % 40 < 15, 1.0, -0.5)
    step, lag = 0.05 * scale, 0.3 * scale
    cls = stack(PpyActuator, sensor_lag(PpyActuator, "displacement", Sampling(step, 200 * step)))
    time = step * np.arange(200)
    given = SPRING | {"displacement_lag_time": lag}
    shown = CompiledModel(cls).run(time, {"force": force}, given).signals["displacement"]
    _, exact, _ = lsim(([1.0], [lag, 1.0]), force - force[0], time, interp=False)
    assert shown == pytest.approx(force[0] + exact, abs=2e-3)


def test_a_jump_arrives_after_the_delay_and_within_one_period():
    force = np.where(np.arange(1000) >= 207, 1.0, 0.0)
    time, shown = measure(transport_delay, force, {"displacement_delay": 0.25}, 0.005)
    late = time - 0.005 * 207 - 0.25
    assert (shown[late < -DELAY_PERIOD - 1e-9] == 0.0).all()
    assert shown[late > DELAY_PERIOD + 1e-9] == pytest.approx(1.0, abs=1e-12)
    assert (np.diff(shown) >= -1e-12).all()


def test_slope_with_respect_to_a_delay():
    """Of what is shown, exactly, between the kinks; so of the signal, but for the period."""
    cls, time = (
        stack(PpyActuator, transport_delay(PpyActuator, "displacement")),
        0.05 * np.arange(200),
    )
    inputs, delay, step = {"force": np.sin(time)}, 0.113, 1e-4
    given = SPRING | {"displacement_delay": delay}
    found = (
        CompiledModel(cls, ["displacement_delay"])
        .run(time, inputs, given, linear=True)
        .sensitivities
    )
    ends = [
        CompiledModel(cls)
        .run(time, inputs, given | {"displacement_delay": delay + s * step}, linear=True)
        .signals
        for s in (1.0, -1.0)
    ]
    slope = (ends[0]["displacement"] - ends[1]["displacement"]) / (2.0 * step)
    assert found["displacement"][:, 0] == pytest.approx(slope, abs=1e-8)
    late = time > 1.0
    assert found["displacement"][late, 0] == pytest.approx(-np.cos(time[late] - delay), abs=0.05)


BEFORE = {"displacement_delay_history_start": -0.6, "displacement_delay_history_slope_start": 2.0}


@pytest.mark.parametrize("start", [0.0, 1234.5])
@pytest.mark.parametrize("delay", [0.3, 0.0])
def test_what_is_read_of_the_time_before_the_start_is_a_line(delay, start):
    """A ramp of 2/s before the record shows 0.6 less at first, and goes on as it was."""
    force = 5.0 + 2.0 * 0.05 * np.arange(60)
    time, shown = measure(
        transport_delay, force, {"displacement_delay": delay} | BEFORE, linear=True, start=start
    )
    assert shown == pytest.approx(5.0 + 2.0 * (time - start - delay), abs=1e-9)


def test_a_model_looked_at_earlier_is_the_register_before_the_start_too():
    """With derivatives by what was before: one, and the time since the start."""
    cls, time = (
        stack(PpyActuator, transport_delay(PpyActuator, "displacement")),
        7.0 + 0.05 * np.arange(60),
    )
    inputs, given = (
        {"force": 5.0 + 2.0 * (time - 7.0)},
        SPRING | {"displacement_delay": 0.313} | BEFORE,
    )
    known = {p.name: p.start for p in cls.layout.parameters} | given
    looked_at = DelayedModel(cls, list(BEFORE)).run(SimulationInput(time, inputs, known))
    register = CompiledModel(cls, list(BEFORE)).run(time, inputs, given, linear=True)
    before = time - 7.0 < 0.313
    line = np.column_stack([before * 1.0, before * (time - 7.0)])
    delayed = time - 7.313
    held = 0.05 * np.floor(delayed / 0.05)  # the model that is looked at holds its inputs
    for ran, then in ((looked_at, held), (register, delayed)):
        assert ran.signals["displacement"] == pytest.approx(
            np.where(before, 4.4 + 2.0 * (time - 7.0), 5.0 + 2.0 * then), abs=1e-9
        )
        assert ran.sensitivities["displacement"] == pytest.approx(line, abs=1e-9)
        assert ran.signals["displacement_delay_history"] == pytest.approx(-0.6 + 2.0 * (time - 7.0))


def test_gain_offset_and_drift():
    force = np.sin(0.3 * np.arange(50))
    time, shown = measure(sensor_gain, force, {"displacement_gain": 1.07})
    assert shown == pytest.approx(1.07 * force, rel=1e-14, abs=1e-15)
    _, shown = measure(sensor_offset, force, {"displacement_offset": -0.3})
    assert shown == pytest.approx(force - 0.3, rel=1e-14, abs=1e-15)
    time, shown = measure(sensor_drift, force, {"displacement_drift": 0.02}, start=1000.0)
    assert shown == pytest.approx(force + 0.02 * (time - 1000.0), rel=1e-9, abs=1e-12)


def test_effects_are_laid_one_over_the_other():
    gain, offset = sensor_gain(PpyActuator, "voltage"), sensor_offset(PpyActuator, "voltage")
    for order, shown in (
        ((gain, offset), lambda u: 2.0 * u + 0.3),
        ((offset, gain), lambda u: 2.0 * (u + 0.3)),
    ):
        model, base = (
            stack(PpyActuator, *order)(voltage_gain=2.0, voltage_offset=0.3),
            PpyActuator(),
        )
        model.current = base.current = 0.7
        assert model.voltage() == shown(base.voltage())


def test_a_lag_over_a_delay_starts_in_equilibrium_and_adds_up():
    lag, delay = (make(PpyActuator, "displacement") for make in (sensor_lag, transport_delay))
    model = stack(PpyActuator, delay, lag)(
        **SPRING, displacement_delay=0.3, displacement_lag_time=0.1
    )
    model.force, integrator = 2.0, Integrator(model)
    for k in range(100):
        assert model.displacement() == pytest.approx(2.0, rel=1e-12)
        integrator.advance(k * 0.05, 0.05)
    shown = []
    for k in range(100, 200):
        model.force = 3.0
        integrator.advance(k * 0.05, 0.05)
        shown.append(model.displacement() - 2.0)
    area = 0.05 * np.sum(1.0 - np.array(shown))  # of what is missing under a step, by left sums
    assert area == pytest.approx(0.4, abs=0.05)


# --- as FMUs
# --------------------------------------------------------------------------------------------------


def check_that_builds_agree(cls, values, inputs, outputs, folder, start=0.0):
    time = start + np.concatenate(
        [[0.0], np.cumsum(np.random.default_rng(3).choice([0.003, 0.02, 0.05, 0.3], 150))]
    )
    fed = {
        name: np.random.default_rng(4).uniform(0.0, high, time.size)
        for name, high in inputs.items()
    }
    results = {}
    for runtime in RUNTIMES:
        path = folder / f"{runtime}.fmu"
        path.write_bytes(build(cls, runtime, [host_platform()]))
        with Fmu(path, values) as one:
            one.start(float(time[0]), float(time[-1]))
            results[runtime] = simulate_instance(one, time, fed)
    for output in outputs:
        found, expected = (results[runtime][output] for runtime in RUNTIMES)
        assert np.ptp(expected) > 0.0
        assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max(), output
    return time, fed, results["native"]


@pytest.mark.slow
def test_builds_agree_on_all_of_them_at_once(tmp_path):
    """On one output, beside effects of the physics and of another output, at any start."""
    heating = fmus.effects("ppy_actuator")["self_heating"]
    measured = [make(PpyActuator, "voltage") for make in MEASUREMENTS.values()]
    cls = stack(
        PpyActuator, heating, *measured, sensor_lag(PpyActuator, "displacement"), name="measured"
    )
    values = VOLTAGE | {"displacement_lag_time": 0.05, "conductance_rise_per_kelvin": 0.02}
    inputs, outputs = {"current": 0.9, "force": 2.0}, ("voltage", "displacement", "charge")
    check_that_builds_agree(cls, values, inputs, outputs, tmp_path, start=100.0)


@pytest.mark.slow
@pytest.mark.parametrize("base", [PpyActuator, PpyActuatorLengthDriven], ids=lambda cls: cls.name)
@each
def test_builds_agree_on_each(base, name, tmp_path):
    for output in base.layout.measured_outputs:
        effect = MEASUREMENTS[name](base, output.name)
        second = {PpyActuator: ("force", 2.0), PpyActuatorLengthDriven: ("length_change", 8e-4)}[
            base
        ]
        inputs = {"current": 0.9, second[0]: second[1]}
        values = {effect.neutral: PARAMETERS[name][2]}
        check_that_builds_agree(stack(base, effect), values, inputs, [output.name], tmp_path)


OWN = '''
"""A model of somebody."""

from fmus.kit import Component, Input, Output, State


class Lag(Component):
    """Half a second of delay."""

    name = "lag"
    u = Input("1", doc="input")
    x = State("1", rate="x_rate", doc="state")

    def x_rate(self):
        return 2.0 * (self.u - self.x)

    @Output("Pa", nominal=10.0, display="kPa")
    def y(self):
        """Something of it."""
        return 3.0 * self.x
'''


@pytest.mark.slow
@pytest.mark.parametrize("file", slow_but(["own.py", "sensors.py"], "sensors.py"))
def test_own_model_from_a_file(tmp_path, file):
    (tmp_path / file).write_text(OWN)
    spec = importlib.util.spec_from_file_location(f"own_{file[:-3]}", tmp_path / file)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    cls = stack(module.Lag, sensor_offset(module.Lag, "y"), transport_delay(module.Lag, "y"))
    assert cls.name == "lag_with_sensor_offset_of_y_with_transport_delay_of_y"
    assert (cls.layout.parameters[0].unit, cls.layout.parameters[0].display) == ("Pa", "kPa")
    values = {"y_offset": 0.5, "y_delay": 0.04}
    time, fed, shown = check_that_builds_agree(cls, values, {"u": 1.0}, ["y"], tmp_path)
    state, exact = 0.0, []  # held inputs, on paper
    for step, u in zip(np.diff(time), fed["u"], strict=False):
        exact.append(3.0 * state + 0.5)
        state = u + (state - u) * np.exp(-2.0 * step)
    late = np.interp(time[:-1] - 0.04, time[:-1], exact)
    assert np.abs(shown["y"][:-1] - late).max() < 0.05, "late, and offset"


class Oven(Component):
    """A temperature that people read in degrees Celsius, about that of its room."""

    name = "oven"
    room = Input("K", start=293.15, display="degC")

    @Output("K", display="degC")
    def temperature(self):
        return self.room


@pytest.mark.parametrize("written", ["2degC", "2K", "2"])
def test_an_error_of_a_thermometer_in_degrees_celsius_is_a_difference(written):
    """2 degC too much are 2 K, not 275.15 K: also of an input, and of what is shown by default."""
    cls = stack(Oven, sensor_offset(Oven, "temperature"), input_offset(Oven, "room"))
    signals = {one.name: declared_signal(one) for one in cls.layout.parameters}
    for name in ("temperature_offset", "room_input_offset"):
        assert start_of(signals[name]).startswith("0 ")
        value = read_setting(written, signals[name], name)
        assert cls(**{name: value}).outputs() == pytest.approx([295.15])
