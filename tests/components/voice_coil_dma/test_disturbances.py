"""Disturbances of the bench against its loop by scipy, with registers of whole numbers."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import kstest

from fmus.kit import stack
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel
from fmus.voice_coil_dma.effects import EFFECTS
from fmus.voice_coil_dma.model import VoiceCoilDma
from tests.support.builds import check_that_bad_values_are_refused, check_that_builds_agree
from tests.support.voice_coil import CORNER, B, K, L, M, R, T

SENSITIVITY = 4.5e-4  # V/N, of the load cell
REJECTION = 10 ** (106 / 20)  # section 2.2.2
CONTINUOUS = 4.9 / 3.9  # A
NAMES = ("winding_protection", "clock_jitter", "mains_hum", "bridge_noise")
ALL = {
    "winding_protection": {"protection_share": 0.6, "winding_time": 0.4},
    "clock_jitter": {"clock_jitter": 8e-3},
    "mains_hum": {"common_mode_voltage": 90.0, "mains_frequency": 50.0, "mains_phase": 0.7},
    "bridge_noise": {"bridge_noise": 1e-5},
}
# the tension stays from each of these times to the next, and a sample coincides with each
TIMES = 0.1 * np.arange(31)


def register(start, multiplier, modulus):
    """Whole numbers that a register goes through, its start first."""
    while True:
        yield start
        start = multiplier * start % modulus


def shares(start=24680):
    return ((s + 0.5) / 2147483564 for s in register(start, 40014, 2147483563))


def normals(start=12345, angle=67890):
    """None for the first sample, then Box and Muller's."""
    yield 0.0
    radii = ((s + 0.5) / 2147483564 for s in register(start, 40014, 2147483563))
    turns = ((s + 0.5) / 2147483400 for s in register(angle, 40692, 2147483399))
    for u, w in zip(radii, turns, strict=False):
        yield math.sqrt(-2 * math.log(u)) * math.cos(2 * math.pi * (u + w))


def tension(t):
    """Up and down from tenth to tenth of a second."""
    return 2.0 + 0.5 * (int(10.0 * t) % 3)


def reference(t):
    """Up for a second, and about the tension from then on: the command stays within its limits."""
    return tension(t) + (0.4 if t < 1.0 else 0.3 * (-1) ** int(10.0 * t))


def by_scipy(protection=0.0, jitter=0.0, hum=0.0, noise=0.0):
    """Current, position, velocity and voltage at the times.

    The controller reads when it gets to it, and its command goes out then.
    """
    # current, position, velocity, filtered force, rise of the winding's temperature
    state, rows = np.zeros(5), []
    command, previous, hot, volts = 0.0, 0.0, False, 0.0
    late, normal = shares(), normals()
    sample, now = 0, 0.0

    def flow(until, pull):
        nonlocal state, now
        if until - now < 1e-12:
            return

        def rates(_, y):
            i, _, v, force, rise = y
            return [
                (volts - R * i - K * v) / L,
                v,
                (K * i - B * v - pull) / M,
                CORNER * (pull - force),
                (20.0 * R * i * i - rise) / 0.4,
            ]

        state = solve_ivp(rates, (now, until), state, "LSODA", rtol=1e-11, atol=1e-14).y[:, -1]
        now = until

    for at, until in zip(TIMES, np.append(TIMES[1:], np.nan), strict=True):
        rows.append([*state[:3], volts])
        if np.isnan(until):
            return np.array(rows)
        pull = tension(0.5 * (at + until))
        while sample * T < until - 1e-9:
            instant = sample * T
            flow(instant, pull)
            if state[4] > 20.0 * R * CONTINUOUS**2:
                now_hot = True
            else:
                now_hot = hot and state[4] >= 0.8 * 20.0 * R * CONTINUOUS**2
            if hot != now_hot:  # at the instant, whatever the controller is at
                before = 1.0 - protection * hot
                after = 1.0 - protection * now_hot
                volts = volts / before * after
                hot = now_hot
            added = hum * math.sin(2 * math.pi * 50.0 * instant + 0.7) / REJECTION
            added += noise * next(normal)
            flow(instant + jitter * next(late), pull)
            error = reference(0.5 * (at + until)) - (state[3] + added / SENSITIVITY)
            command = min(max(command + 0.66 * error - 0.06 * previous, 0.0), 10.0)
            previous = error
            volts = command * (1.0 - protection * hot)
            sample += 1
        flow(until, pull)


ARGUMENTS = {
    "winding_protection": {"protection": 0.6},
    "clock_jitter": {"jitter": 8e-3},
    "mains_hum": {"hum": 90.0},
    "bridge_noise": {"noise": 1e-5},
}


@pytest.mark.parametrize(
    "chosen",
    [(), *(pytest.param((name,), marks=pytest.mark.slow) for name in NAMES), NAMES],
    ids=lambda chosen: "+".join(chosen) or "none",
)
def test_the_disturbed_loop_is_that_of_scipy(chosen):
    cls = stack(VoiceCoilDma, *(EFFECTS[name] for name in chosen), name="disturbed")
    model = cls(**{n: v for name in chosen for n, v in ALL[name].items()})
    integrator, rows = Integrator(model), []
    for at, until in zip(TIMES, np.append(TIMES[1:], np.nan), strict=True):
        model.time = float(at)
        rows.append([model.coil_current, model.position, model.velocity, model.coil_voltage()])
        if np.isnan(until):
            break
        inside = 0.5 * (at + until)
        model.force_reference, model.tension = reference(inside), tension(inside)
        integrator.advance(float(at), float(until - at))
    exact = by_scipy(**{n: v for name in chosen for n, v in ARGUMENTS[name].items()})
    scale = np.abs(exact).max(axis=0)
    assert (np.abs(rows - exact).max(axis=0) < 1e-6 * scale).all()
    assert not chosen or (np.abs(exact - by_scipy()).max(axis=0) > 1e-3 * scale).all()


def test_a_compiled_record_has_the_disturbances_too():
    cls = stack(VoiceCoilDma, *(EFFECTS[name] for name in NAMES), name="disturbed")
    values = {n: v for name in NAMES for n, v in ALL[name].items()}
    inputs = {
        "force_reference": np.array([reference(t + 0.05) for t in TIMES]),
        "tension": np.array([tension(t + 0.05) for t in TIMES]),
    }
    found = CompiledModel(cls).run(TIMES, inputs, values).signals
    exact = by_scipy(**{n: v for given in ARGUMENTS.values() for n, v in given.items()})
    for column, name in enumerate(("coil_current", "position", "velocity", "coil_voltage")):
        scale = np.abs(exact[:, column]).max()
        assert found[name] == pytest.approx(exact[:, column], abs=1e-6 * scale), name


# --- random numbers
# --------------------------------------------------------------------------------------------------


def drawn(effect, state, count, **starts):
    """Values of a state of random numbers after each of some samples."""
    model, values = stack(VoiceCoilDma, EFFECTS[effect])(**starts), []
    own = [d for d in EFFECTS[effect].declared.values() if hasattr(d, "update")]
    for _ in range(count):
        following = {d.name: getattr(model, d.update)() for d in own}
        for name, value in following.items():
            setattr(model, name, value)
        values.append(following[state])
    return np.array(values)


def test_registers_are_those_of_whole_numbers():
    for effect, state, numbers in (
        ("bridge_noise", "bridge_register", register(12345, 40014, 2147483563)),
        ("bridge_noise", "bridge_angle_register", register(67890, 40692, 2147483399)),
        ("clock_jitter", "clock_register", register(24680, 40014, 2147483563)),
    ):
        next(numbers)
        found = drawn(effect, state, 5000)
        assert found.tolist() == [next(numbers) for _ in range(5000)]


def test_noise_is_normal_and_white_and_lateness_is_even():
    noise = drawn("bridge_noise", "bridge_sample", 20000)
    late = drawn("clock_jitter", "late_share", 20000)
    assert kstest(noise, "norm").pvalue > 0.01
    assert kstest(late, "uniform").pvalue > 0.01
    for values in (noise, noise**2, late):
        centred = values - values.mean()
        correlations = [(centred[k:] * centred[:-k]).mean() / centred.var() for k in range(1, 11)]
        assert np.abs(correlations).max() < 4.0 / math.sqrt(20000)


def test_another_seed_is_another_sequence():
    usual = drawn("bridge_noise", "bridge_sample", 2000)
    other = drawn("bridge_noise", "bridge_sample", 2000, bridge_register_start=99.0)
    assert abs(np.corrcoef(usual, other)[0, 1]) < 0.1


@pytest.mark.parametrize("start", [0.0, -1.0, 0.3, 2147483562.0, 1e15, -1e15])
def test_any_start_gives_finite_numbers(start):
    noise = drawn("bridge_noise", "bridge_sample", 3, bridge_register_start=start)
    late = drawn("clock_jitter", "late_share", 3, clock_register_start=start)
    assert np.isfinite(noise).all()
    assert ((late > 0.0) & (late < 1.0)).all()


# --- hum
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mains", "seen"), [(60.0, 0.0), (50.0, 10.0)])
def test_hum_is_folded_by_thirty_hertz(mains, seen):
    """1 V at both inputs are 11 mN; 60 Hz look like an offset, 50 Hz like 10 Hz."""
    cls = stack(VoiceCoilDma, EFFECTS["mains_hum"])
    model = cls(common_mode_voltage=1.0, mains_frequency=mains, mains_phase=math.pi / 2)
    read = []
    for k in range(300):
        model.time = k * T
        read.append(-model.force_error())
    found = np.abs(np.fft.rfft(read)) / 300
    assert np.fft.rfftfreq(300, T)[np.argmax(found)] == pytest.approx(seen, abs=0.05)
    assert np.abs(read).max() == pytest.approx(0.011137494, rel=1e-6)


def test_hum_passes_the_converter_as_the_force_does():
    cls = stack(VoiceCoilDma, EFFECTS["mains_hum"])
    model = cls(common_mode_voltage=1.0, mains_phase=math.pi / 2, converters_on=True)
    level = 20.0 / 65536 / 0.45
    assert model.force_measured() == pytest.approx(round(0.011137494 / level) * level, rel=1e-9)


# --- protection
# --------------------------------------------------------------------------------------------------


def heated(current, seconds, **values):
    """Times at which the protection trips and lets go while the coil is held by its resistance."""
    cls = stack(VoiceCoilDma, EFFECTS["winding_protection"])
    model = cls(controller_on=False, protection_share=1.0, K=3.9, **values)
    integrator, changes = Integrator(model), []
    for k in range(round(seconds / 0.1)):
        model.force_reference = current * 3.0
        model.tension = 3.9 * current * (1.0 - model.winding_hot)  # nothing moves but for a moment
        before = model.winding_hot
        integrator.advance(0.1 * k, 0.1)
        if model.winding_hot != before:
            changes.append(0.1 * (k + 1))
    return changes, model


@pytest.mark.slow
def test_protection_trips_in_closed_form_and_lets_go():
    """T ln(i^2 / (i^2 - i_c^2)), then T ln(1 / 0.8) without current, then on again from there."""
    current, time = 2.0, 60.0
    changes, _ = heated(current, 80.0)
    ratio = current**2 / CONTINUOUS**2
    tripped = time * math.log(ratio / (ratio - 1.0))
    released = tripped + time * math.log(1.0 / 0.8)
    again = released + time * math.log((ratio - 0.8) / (ratio - 1.0))
    expected = [t for t in (tripped, released, again) if t < 80.0]
    assert len(expected) >= 3
    # seen at the end of steps of 0.1 s, each change late by one at most
    assert (np.array(changes[:3]) - expected >= 0.0).all()
    assert changes[:3] == pytest.approx(expected, abs=0.3)


@pytest.mark.slow
def test_the_continuous_force_never_trips():
    changes, model = heated(0.999 * CONTINUOUS, 400.0)
    assert changes == []
    assert model.winding_rise == pytest.approx(20.0 * 3.0 * (0.999 * CONTINUOUS) ** 2, rel=2e-3)


# --- as FMUs
# --------------------------------------------------------------------------------------------------


def test_builds_agree_on_all_disturbances(tmp_path):
    cls = stack(VoiceCoilDma, *(EFFECTS[name] for name in NAMES), name="disturbed")
    values = {n: v for name in NAMES for n, v in ALL[name].items()}
    ranges = {"force_reference": (0.0, 8.0), "tension": (0.0, 5.0)}
    check_that_builds_agree(cls, values, ranges, tmp_path, sizes=(0.003, 0.01, 0.1))


@pytest.mark.parametrize(
    ("name", "bad", "allowed"),
    [
        ("bridge_noise", {"bridge_noise": -1e-6}, "[0, 1] V"),
        ("mains_hum", {"common_mode_rejection": 0.0}, "[1, 1e+12]"),
        ("clock_jitter", {"clock_jitter": -1e-3}, "[0, 10] s"),
        ("winding_protection", {"protection_share": 1.5}, "[0, 1]"),
    ],
)
def test_bad_values_are_refused(tmp_path, name, bad, allowed):
    check_that_bad_values_are_refused(stack(VoiceCoilDma, EFFECTS[name]), bad, allowed, tmp_path)
