"""The degradation estimator against batch solutions, control theory, the M-file of the thesis and
known truth.
"""

import math
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.degradation_estimator import model as estimator
from fmus.degradation_estimator.model import DegradationEstimator
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel
from orchestration.experiment.waveforms import square_wave
from studies.emulator.emulator import EmulatedRig
from studies.emulator.hidden_electrical import GrowingResistance
from studies.emulator.physics import RigParameters
from tests.support.pace import slow_but

R1, R2, C, PERIOD = 0.43, 2.35, 2.70, 0.1  # ohm, ohm, F, s: typed in from table 3-1
OMEGA = 0.628  # rad/s
THESIS = dict(DegradationEstimator.presets["thesis_10_hz"].values)
LEAST_SQUARES = {"instrumental_variable": 0.0, "maximum_trace": 1e15}
README = Path(estimator.__file__).with_name("README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def compiled():
    return CompiledModel(DegradationEstimator)


@pytest.fixture(scope="module")
def estimate(compiled):
    """Signals after each sample of a record: ``estimate(current, voltage, **parameters)``."""

    def run(current, voltage, **parameters):
        period = parameters.get("sample_period", PERIOD)
        time = period * np.arange(len(current) + 1)
        inputs = {
            "current": np.append(current, current[-1]),
            "voltage": np.append(voltage, voltage[-1]),
        }
        signals = compiled.run(time, inputs, parameters).signals
        return {
            name: values[1:] for name, values in signals.items()
        }  # a sample shows at the next point

    return run


def square(duration, amplitude=0.9, frequency=0.2, period=PERIOD):
    return square_wave(period * np.arange(round(duration / period)), amplitude, frequency)


def measured(current, noise=0.0, seed=0, **options):
    time = PERIOD * np.arange(len(current))
    rig = EmulatedRig(RigParameters(), seed=seed, voltage_noise=noise, **options)
    return rig.run(time, current, np.zeros_like(time))["voltage"]


def impedance(r1, r2, c, omega=OMEGA):
    """R2 in parallel with R1 and C in series."""
    branch = r1 + 1 / (1j * omega * c)
    return np.abs(r2 * branch / (r2 + branch))


# --- conversions
# --------------------------------------------------------------------------------------------------


def converted(theta, held, period=PERIOD):
    """R1, R2, C of the model for an estimate that no sample corrects: the regressor is zero."""
    model = DegradationEstimator(zero_order_hold=held, sample_period=period)
    model.b0, model.b1, model.a = theta
    model.samples = model.reversals = 1.0
    return model.circuit()


positive = st.floats(-1.0, 1.0).map(lambda power: 10.0**power)


@settings(deadline=None)
@given(r1=positive, r2=positive, c=positive, period=st.floats(0.01, 0.2))
def test_conversions_invert_the_discretisations_of_control(r1, r2, c, period):
    circuit = control.tf([r1 * r2 * c, r2], [(r1 + r2) * c, 1.0])  # eq. 4.1
    for method, held in (("zoh", True), ("tustin", False)):
        discrete = control.sample_system(circuit, period, method)
        (b0, b1), (one, a) = discrete.num[0][0], discrete.den[0][0]
        found = converted((b0 / one, b1 / one, a / one), held, period)
        assert found == pytest.approx((r1, r2, c), rel=1e-6), method


@pytest.mark.parametrize(
    ("theta", "expected"),
    [
        ((0.3970, -0.3632, -0.9869), (0.449, 2.580, 2.503)),
        ((0.3648, -0.3321, -0.9839), (0.425, 2.031, 2.509)),
        ((0.3706, -0.3430, -0.9887), (0.421, 2.442, 3.073)),
    ],
)
def test_table_3_1_by_tustin(theta, expected):
    assert converted(theta, held=False) == pytest.approx(expected, abs=2e-3)  # errata 10


def test_tustin_is_wrong_for_held_data_and_the_exact_conversion_is_not(estimate):
    """Errata 8: 0.412, 2.350, 2.718 for 0.43, 2.35, 2.70."""
    current = square(100.0)
    voltage = measured(current)
    options = LEAST_SQUARES | {"initial_covariance": 1e9}
    for held, expected in ((0.0, (0.412, 2.350, 2.718)), (1.0, (R1, R2, C))):
        found = estimate(current, voltage, zero_order_hold=held, **options)
        assert [found[name][-1] for name in ("R1", "R2", "C")] == pytest.approx(expected, abs=6e-4)


@given(r1=positive, r2=positive, c=positive, omega=st.floats(1e-3, 100.0))
def test_impedance_is_eq_4_10(r1, r2, c, omega):
    model = DegradationEstimator(angular_frequency=omega)
    model.R1, model.R2, model.C = r1, r2, c
    assert model.impedance() == pytest.approx(impedance(r1, r2, c, omega), rel=1e-9)
    model.angular_frequency = 0.0
    assert model.impedance() == r2


def test_forgetting_factor_is_eq_4_11_and_the_printed_numbers_are_not_what_they_are_called():
    for percent, age, period in ((10.0, 600.0, 0.1), (1.0, 10.0, 0.1), (50.0, 5.0, 1 / 15)):
        model = DegradationEstimator(
            remaining_weight=percent / 100, forgetting_time=age, sample_period=period
        )
        assert model.forgetting_factor() == pytest.approx(
            10 ** ((math.log10(percent) - 2) * period / age), rel=1e-13
        )
    for name, factor, left in (
        ("thesis_10_hz", 0.91, 8e-5),
        ("thesis_15_hz", 0.985, 0.32),
    ):  # errata 11
        values = DegradationEstimator.presets[name].values
        assert DegradationEstimator(**values).forgetting_factor() == pytest.approx(
            factor, rel=1e-12
        )
        assert values["remaining_weight"] == pytest.approx(left, rel=0.02)


# --- recursion
# --------------------------------------------------------------------------------------------------


def test_least_squares_is_the_weighted_batch_solution(estimate):
    current = square(60.0)
    voltage = measured(current, noise=20e-3, seed=5)
    found = estimate(current, voltage, forgetting_time=30.0, **LEAST_SQUARES)
    forgetting = 0.1 ** (PERIOD / 30.0)
    for last in (100, 300, 599):
        t = np.arange(1, last + 1)
        weight = np.sqrt(forgetting ** (last - t))
        rows = np.column_stack([current[t], current[t - 1], -voltage[t - 1]]) * weight[:, None]
        start = np.eye(3) * np.sqrt(
            forgetting**last / 1e4
        )  # the initial covariance is forgotten too
        theta = np.linalg.lstsq(
            np.vstack([rows, start]), np.append(voltage[t] * weight, np.zeros(3))
        )[0]
        assert [found[name][last] for name in ("b0", "b1", "a")] == pytest.approx(theta, rel=1e-8)


def test_preset_is_the_m_file_of_appendix_a3(estimate):
    current = square(40.0, amplitude=1.3, frequency=0.25)
    voltage = measured(current, noise=2e-3, seed=6)
    # the M-file in matrices; its reset falls on multiples of 100 samples, the component's on its
    # own clock
    theta, covariance, alpha, expected = np.zeros(3), np.eye(3), 0.91, []
    for t in range(1, len(current)):
        phi = np.array([-voltage[t - 1], current[t], current[t - 1]])
        gain = covariance @ phi / (alpha + phi @ covariance @ phi)
        theta = theta + gain * (voltage[t] - phi @ theta)
        covariance = (covariance - np.outer(gain, phi @ covariance)) / alpha
        if t % 100 == 0:
            covariance = np.eye(3)
        expected.append(theta)
    found = estimate(current, voltage, **THESIS)
    table = np.column_stack([found[name][1:] for name in ("a", "b0", "b1")])
    assert np.abs(table - np.array(expected)).max() < 1e-9


@pytest.mark.parametrize("millivolts", slow_but([5, 20], 20))
def test_noise_biases_least_squares_and_not_the_instrumental_variable(estimate, millivolts):
    """Errata 9, 0.9 A at 0.2 Hz, true R2 2.35 ohm; the figures are those of the README's table."""
    current = square(600.0)
    values, shown = {}, [f"{millivolts} mV rms"]
    for name, options in (("plain", LEAST_SQUARES), ("instrument", {})):
        runs = [
            estimate(current, measured(current, 1e-3 * millivolts, seed), **options)
            for seed in range(40)
        ]
        values[name] = np.array(
            [[run[signal][-1] for signal in ("R1", "R2", "C", "impedance")] for run in runs]
        )
        shown.append(f"{values[name][:, 1].mean():.2f} ± {values[name][:, 1].std(ddof=1):.2f} Ω")
    assert f"| {' | '.join(shown)} |" in README
    assert values["plain"][:, 1].mean() < 0.95 * R2
    mean, spread = values["instrument"].mean(axis=0), values["instrument"].std(axis=0)
    assert mean[:3] == pytest.approx([R1, R2, C], rel=0.016)  # three standard errors of the mean
    assert spread[1] < 0.04 * R2
    assert values["instrument"][:, 3] == pytest.approx(impedance(R1, R2, C), rel=0.01)


def test_one_long_record_gives_r2_within_3_percent(estimate):
    current = square(7200.0)
    voltage = measured(current, 20e-3, seed=11)
    found = estimate(current, voltage, forgetting_time=7200.0)
    assert found["R2"][-1] == pytest.approx(R2, rel=0.03)
    assert estimate(current, voltage, forgetting_time=7200.0, **LEAST_SQUARES)["R2"][-1] < 0.6 * R2


def test_covariance_stays_bounded_and_symmetric_for_least_squares(estimate):
    current = square(3600.0, amplitude=0.06)  # hardly any excitation for so fast a forgetting
    current[::50] += 0.2
    options = {"forgetting_time": 5.0, "maximum_trace": 100.0, "initial_covariance": 10.0}
    for instrumental in (0.0, 1.0):
        found = estimate(
            current, measured(current, 5e-3), instrumental_variable=instrumental, **options
        )
        total = found["p11"] + found["p22"] + found["p33"]
        assert np.all(total[20:] <= 100.0 * (1 + 1e-12))
        assert np.all(total[20:] > 0.0)
        assert all(np.all(np.isfinite(values)) for values in found.values())
        if not instrumental:
            assert found["p13"] == pytest.approx(found["p31"], rel=1e-6, abs=1e-6)


# --- excitation and validity
# ------------------------------------------------------------------------------------------


def test_nothing_moves_while_the_current_rests(estimate):
    current = np.concatenate([square(300.0), np.zeros(36000), square(300.0)])
    voltage = measured(current, 20e-3, seed=3)
    found = estimate(current, voltage)
    kept = ("b0", "b1", "a", "p11", "p23", "p33", "auxiliary_a", "R1", "R2", "C", "excited_time")
    resting = slice(3000 + 200, 3000 + 36000)  # the timeout is 20 s
    for name in kept:
        assert np.ptp(found[name][resting]) == 0.0, name
    assert np.all(found["estimate_valid"][resting] == 1.0)
    z = found["impedance"]
    assert z[2999:] == pytest.approx(impedance(R1, R2, C), rel=0.015)


@pytest.mark.parametrize("level", [0.0, 0.5])
def test_constant_current_gives_no_estimate(estimate, level):
    current = np.full(20000, level)
    found = estimate(current, measured(current, 20e-3))
    assert not found["estimate_valid"].any()
    assert np.all(found["voltage_limit"] == 1.5)
    assert all(np.all(np.isfinite(values)) for values in found.values())


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(-1.3, 1.3), min_size=2, max_size=60))
def test_reversals_are_turning_points_beyond_the_swing(values):
    model = DegradationEstimator(minimum_swing=0.3)
    run, count, direction, extreme = Integrator(model), 0, 0, 0.0
    for k, value in enumerate(values):
        model.current = value
        run.advance(k * PERIOD, PERIOD)
        if direction == 0:
            if abs(value) > 0.3:
                direction, extreme, count = (1 if value > 0 else -1), value, 1
        elif (value - extreme) * direction > 0:
            extreme = value
        elif abs(value - extreme) > 0.3:
            direction, extreme, count = -direction, value, count + 1
        assert model.reversals == count


def alternating(durations, amplitude=0.9):
    """Levels of alternating sign, each held for a number of samples."""
    return np.concatenate([amplitude * (-1) ** k * np.ones(n) for k, n in enumerate(durations)])


@settings(deadline=None, max_examples=20)
@given(durations=st.lists(st.integers(1, 150), min_size=5, max_size=40))
def test_tracked_frequency_is_that_of_reversals_of_equal_sign(estimate, durations):
    """Against the switching times themselves; the first half period starts with the first movement
    and is left out.
    """
    tracked = estimate(alternating(durations), np.zeros(sum(durations)))[
        "tracked_angular_frequency"
    ]
    switched = PERIOD * np.cumsum(durations)[:-1]
    period, expected = None, OMEGA
    for before, last, now in zip(switched, switched[1:], switched[2:], strict=False):
        share = 1.0 if period is None else -math.expm1(-(now - last) / 30.0)
        period = (period or 0.0) + share * (now - before - (period or 0.0))
        expected = 2 * math.pi / period
    assert tracked[-1] == pytest.approx(expected, rel=1e-9)
    assert np.all(tracked[: round(switched[2] / PERIOD)] == OMEGA)


@pytest.mark.parametrize("frequency", [0.03, 0.1, 0.17, 0.2, 0.5, 1.3])
@pytest.mark.parametrize("shape", ["square", "sine", "a quarter of the time", "offset sine"])
def test_tracked_frequency_is_the_fundamental_whatever_the_shape(estimate, frequency, shape):
    """A sample period is the resolution of a reversal; smoothed over 30 s it is 1 % at worst."""
    phase = frequency * PERIOD * np.arange(4000)
    current = {
        "square": np.where(phase % 1 < 0.5, 0.9, -0.9),
        "sine": 0.9 * np.sin(2 * np.pi * phase),
        "a quarter of the time": np.where(phase % 1 < 0.25, 1.2, 0.0),
        "offset sine": 1 + np.sin(2 * np.pi * phase),
    }[shape]
    found = estimate(current, measured(current), excitation_timeout=40.0)[
        "tracked_angular_frequency"
    ]
    assert found[2000:] == pytest.approx(2 * np.pi * frequency, rel=0.01)


def test_tracked_frequency_follows_a_change_and_is_held_while_the_current_rests(estimate):
    """From 0.2 Hz to 0.1 Hz: the period is a low-pass of 30 s; a rest in between does not count as
    a period.
    """
    slow = square(300.0, frequency=0.1)
    current = np.concatenate([square(200.0), slow, np.zeros(2000), slow])
    period = 2 * np.pi / estimate(current, measured(current))["tracked_angular_frequency"]
    assert period[1999] == pytest.approx(5.0, rel=1e-9)
    left = math.exp(-5.0 / 30.0)
    n = np.arange(1, 60)  # half periods of 5 s since the change; the first follows one of 2.5 s
    assert period[2000 + 50 * n] == pytest.approx(
        10.0 - (2.5 + 2.5 * left) * left ** (n - 1), rel=1e-9
    )
    assert np.ptp(period[5060:7000]) == 0.0
    assert period[4999:] == pytest.approx(10.0, rel=1e-3)


def test_impedance_at_the_tracked_frequency_is_compared_with_the_reference_there(estimate):
    """Constant circuit, other frequency: another impedance, no change of it; a stored magnitude
    would derate.
    """
    current = np.concatenate([square(400.0, frequency=0.1), square(600.0, frequency=0.4)])
    found = estimate(current, measured(current), track_frequency=1.0)
    before, after = (impedance(R1, R2, C, 2 * np.pi * f) for f in (0.1, 0.4))
    assert found["impedance"][3999] == pytest.approx(before, rel=1e-4)
    assert found["impedance"][-1] == pytest.approx(after, rel=1e-4)
    assert before / after - 1 == pytest.approx(0.57, abs=0.005)  # as the README says
    assert np.abs(found["impedance_change"]).max() < 1e-4
    back = estimate(current[::-1], measured(current[::-1]), track_frequency=1.0)
    assert np.abs(back["impedance_change"]).max() < 1e-4
    assert np.all(back["voltage_limit"] == 1.5), (
        "the impedance rose by half, the actuator is as it was"
    )
    fixed = estimate(current, measured(current))
    assert fixed["impedance"][1200:] == pytest.approx(impedance(R1, R2, C), rel=1e-4)


def test_impedance_change_at_the_tracked_frequency_is_that_of_the_circuit(estimate):
    """The current slows down while R1 doubles: the change is that of the true circuits at the
    tracked frequency.
    """
    parts = square(400.0, frequency=0.4), square(4000.0, frequency=0.1)
    current = np.concatenate(parts)
    rise = np.concatenate([np.ones(4000), np.full(40000, 2.0)])
    charge, voltage = 0.0, np.empty_like(current)
    for k, (r, i) in enumerate(zip((R1 * rise).tolist(), current.tolist(), strict=True)):
        voltage[k] = R2 * (r * i + charge / C) / (r + R2)
        charge = R2 * C * i + (charge - R2 * C * i) * math.exp(-PERIOD / ((r + R2) * C))
    found = estimate(current, voltage, track_frequency=1.0, forgetting_time=300.0)
    omega = 0.2 * math.pi
    expected = impedance(2 * R1, R2, C, omega) / impedance(R1, R2, C, omega) - 1
    assert found["impedance_change"][-1] == pytest.approx(expected, rel=1e-3)
    assert found["derating_steps"][-1] == expected // 0.05


def test_a_sine_determines_the_impedance_at_its_own_frequency_only(estimate):
    """Two numbers, amplitude and phase, for three parameters: the README says how far off the rest
    is.
    """
    current = 0.9 * np.sin(2 * np.pi * 0.3 * PERIOD * np.arange(36000))
    voltage = measured(current, 5e-3, seed=1)
    for tracked, omega, least, most in ((1.0, 0.6 * math.pi, 0.0, 0.04), (0.0, OMEGA, 0.3, 0.36)):
        found = estimate(current, voltage, track_frequency=tracked)
        error = found["impedance"] / impedance(R1, R2, C, omega) - 1
        assert least <= np.abs(error[found["estimate_valid"] > 0.5]).max() < most


def test_dips_of_the_protection_are_no_reversals_if_the_swing_says_so(estimate):
    current = square(600.0, amplitude=1.3, frequency=0.1)
    current[np.arange(6000) % 50 // 5 == 6] = 0.0
    voltage = measured(current)
    swings = {"minimum_swing": 2.0, "turning_current_start": -1.3}
    aware, naive = (
        estimate(current, voltage, **o)["tracked_angular_frequency"][-1] for o in (swings, {})
    )
    assert aware == pytest.approx(0.2 * math.pi, rel=1e-9)
    assert naive > 1.5 * aware


def test_valid_needs_time_and_reversals(estimate):
    current = square(60.0)
    voltage = measured(current)
    for settling, reversals, expected in ((30.0, 6, 300), (10.0, 6, 125), (10.0, 1, 100)):
        found = estimate(current, voltage, settling_time=settling, minimum_reversals=reversals)
        assert np.argmax(found["estimate_valid"] > 0.5) == expected
        assert np.all(found["impedance_change"][:expected] == 0.0)
        reference = found["impedance"][expected]
        assert found["impedance_change"][expected:] == pytest.approx(
            found["impedance"][expected:] / reference - 1
        )


# --- derating
# --------------------------------------------------------------------------------------------------


def life(hours=5.0):
    """Current, voltage and true impedance of an ageing actuator: R1 falls until 2100 s, then grows
    (fig. 4-7).
    """
    time = PERIOD * np.arange(round(hours * 36000))
    current = square_wave(time, 1.3, 0.1)
    r1 = R1 * (0.9 + 0.1 * np.exp(-time / 700.0) + 5e-5 * np.maximum(time - 2100.0, 0.0))
    charge, voltage = 0.0, np.empty_like(time)
    for k, (r, i) in enumerate(zip(r1.tolist(), current.tolist(), strict=True)):
        voltage[k] = R2 * (r * i + charge / C) / (r + R2)
        charge = R2 * C * i + (charge - R2 * C * i) * math.exp(-PERIOD / ((r + R2) * C))
    return time, current, voltage, impedance(r1, R2, C)


def test_impedance_of_a_five_hour_life_is_tracked_and_derated(estimate):
    time, current, voltage, truth = life()
    noisy = voltage + 4e-3 * np.random.default_rng(2).standard_normal(len(time))
    found = estimate(current, noisy)
    valid = found["estimate_valid"] > 0.5
    first = int(np.argmax(valid))
    assert np.all(valid[first:])
    assert time[first] == pytest.approx(120.0, abs=0.2)
    assert np.abs(found["impedance"][first:] / truth[first:] - 1).max() < 0.02
    bottom = time[first + np.argmin(found["impedance"][first:])]
    assert bottom == pytest.approx(2100.0, abs=400.0)
    # the limit falls when the truth crosses a step, late by the memory of the estimate at most
    limit, change = found["voltage_limit"], truth / truth[first] - 1
    assert np.all(np.diff(limit) <= 0.0)
    steps = int(change[-1] // 0.05)
    assert steps >= 3
    for n in range(1, steps + 1):
        due, taken = (
            time[np.argmax(change >= 0.05 * n)],
            time[np.argmax(limit < 1.5 - 0.05 * n + 0.025)],
        )
        assert taken == pytest.approx(due, abs=600.0)


def test_the_limit_falls_in_steps_to_a_floor_and_never_rises(estimate):
    current = square(1500.0, amplitude=1.3)
    voltage = measured(current, hidden=lambda p: GrowingResistance(p, growth=3.0, endurance=400.0))
    options = {
        "impedance_step": 0.1,
        "voltage_step": 0.3,
        "forgetting_time": 60.0,
        "minimum_voltage_limit": 0.8,
    }
    found = estimate(current, voltage, **options)
    change = np.where(found["estimate_valid"] > 0.5, found["impedance_change"], 0.0)
    expected = 1.5 - 0.3 * np.maximum.accumulate(np.maximum(np.floor(change / 0.1), 0.0))
    assert found["voltage_limit"] == pytest.approx(np.maximum(expected, 0.8), abs=1e-12)
    assert found["voltage_limit"][-1] == 0.8
    # the same actuator, healed: the limit stays
    again = np.concatenate([voltage, measured(square(1500.0, amplitude=1.3))])
    assert estimate(np.tile(current, 2), again, **options)["voltage_limit"][-1] == 0.8


# --- robustness
# --------------------------------------------------------------------------------------------------


def test_single_faults_of_the_sensors_are_passed_over(estimate):
    current = square(600.0)
    voltage = measured(current)
    clean = estimate(current, voltage)["impedance"]
    faulty = np.array(current)
    voltage[[1510, 2222, 4013]] = [1e300, -1e4, 21.0]
    faulty[[1812, 5009]] = [
        1e6,
        -1e300,
    ]  # all between two reversals: the reading before is nearly right
    found = estimate(faulty, voltage)
    assert found["impedance"][1200:] == pytest.approx(clean[1200:], rel=0.005)
    assert np.all(found["voltage_limit"] == 1.5)


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_any_parameters_and_inputs_leave_finite_numbers(compiled, data):
    parameters = {}
    for p in DegradationEstimator.layout.parameters:
        if p.name.endswith("_start"):
            continue
        parameters[p.name] = (
            data.draw(st.sampled_from([p.min, p.max, p.start]), label=p.name)
            if p.max < 1e20
            else 0.0
        )
    parameters |= {
        name: data.draw(st.sampled_from([0.0, 1.0]))
        for name in ("instrumental_variable", "zero_order_hold", "track_frequency")
    }
    period = parameters["sample_period"]
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    size = data.draw(st.sampled_from([1e-6, 1.0, 1e3]))
    current, voltage = size * rng.uniform(-1, 1, (2, 301))
    found = compiled.run(
        period * np.arange(301), {"current": current, "voltage": voltage}, parameters
    ).signals
    for name, values in found.items():
        assert np.all(np.isfinite(values)), name
    for name in ("R1", "R2", "C", "impedance"):
        assert np.all(found[name] >= 0.0), name
