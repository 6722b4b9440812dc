"""The stand against closed forms and an integration by scipy, written out by hand here."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import welch

from fmus.isotonic_stand.model import IsotonicStand
from fmus.kit.integrate import Integrator
from fmus.kit.record.compiled import CompiledModel

# standard gravity, and what the README assumes of the stand
G = 9.80665
PLACING = 0.05
SENSITIVITY = 5.0 / 25.4e-3
CORNER = 2 * math.pi * 200.0
FULL = 25.4e-3
# the declared accuracy, 1e-8 of 0.3 V
READS = 1.5e-11  # m
GRID = 0.01 * np.arange(401)


def mass(t):
    """Weights put on, more of them, all taken off."""
    return (0.0, 0.2, 0.35, 0.0)[min(int(t), 3)]


def displacement(t):
    return 2e-3 + 3e-3 * math.sin(2.0 * t)


def zeroed(t):
    return 1.42 < t < 1.57 or t > 3.0


def simulate(model, times, shown=("tension", "sensor_voltage", "displacement_measured")):
    """Rows of outputs, inputs held over the steps between the times."""
    integrator, rows = Integrator(model), []
    for at, until in zip(times, np.append(times[1:], np.nan), strict=True):
        model.time = float(at)
        rows.append(
            [getattr(model, n)() if callable(getattr(model, n)) else model.tension for n in shown]
        )
        if np.isnan(until):
            return np.array(rows)
        inside = 0.5 * (at + until)
        model.mass, model.displacement = mass(inside), displacement(inside)
        model.zero = zeroed(inside)
        integrator.advance(float(at), float(until - at))
    return np.array(rows)


def in_closed_form(times, linearity=0.0, ripple=0.0, late=0.0, period=0.1, shift=0.0):
    """The same rows by exponentials, samples counted at exact multiples of the period."""
    state, read, zero, taken, rows = np.zeros(2), 0.0, 0.0, 0, []
    rates = np.array([1.0 / PLACING, CORNER])

    def shown(t):
        return state[1] + ripple * math.sin(4 * math.pi * 5003.0 * (t - late))

    for at, until in zip(times, np.append(times[1:], np.nan), strict=True):
        rows.append([state[0], shown(at), read - zero])
        if np.isnan(until):
            return np.array(rows)
        inside = 0.5 * (at + until)
        u = displacement(inside) / FULL
        level = SENSITIVITY * FULL * (u + linearity * 1.5 * math.sqrt(3.0) * (u - u**3))
        settled = np.array([mass(inside) * G, level])
        now = at
        while now < until - 1e-12:
            sample = shift + taken * period
            if abs(sample - now) < 1e-9:
                read, taken = shown(sample) / SENSITIVITY, taken + 1
                zero = read if zeroed(inside) else zero
                sample += period
            target = min(until, sample) if sample > now else until
            state = settled + (state - settled) * np.exp(-rates * (target - now))
            now = target
    return np.array(rows)


@pytest.mark.parametrize(
    ("values", "oracle"),
    [
        ({}, {}),
        (
            {"linearity": 0.02, "carrier_ripple": 0.01, "carrier_shift": 2e-5},
            {"linearity": 0.02, "ripple": 0.01, "late": 2e-5},
        ),
        ({"sample_period": 1 / 30, "sample_shift": 0.013}, {"period": 1 / 30, "shift": 0.013}),
    ],
    ids=["plain", "sensor", "clock"],
)
def test_the_stand_is_its_equations_in_closed_form(values, oracle):
    found = simulate(IsotonicStand(lvdt_sensitivity=SENSITIVITY, **values), GRID)
    exact = in_closed_form(GRID, **oracle)
    assert (np.abs(found - exact).max(axis=0) < 1e-6 * np.abs(exact).max(axis=0)).all()


def test_the_tension_follows_a_weight_in_closed_form():
    found = simulate(IsotonicStand(), GRID)[:, 0]
    exact = np.zeros(GRID.size)
    for at, change in ((1.0, 0.2), (2.0, 0.15), (3.0, -0.35)):
        exact += change * G * np.where(at < GRID, 1.0 - np.exp(-(GRID - at) / PLACING), 0.0)
    assert found == pytest.approx(exact, abs=1e-6)
    assert found[150] == pytest.approx(1.96133, rel=1e-4)  # N, 200 g


def test_a_core_that_weighs_pulls_alone():
    model = IsotonicStand(core_mass=0.05, tension_start=0.05 * G)
    Integrator(model).advance(0.0, 1.0)
    assert model.tension == pytest.approx(0.05 * G, rel=1e-12)


@pytest.mark.parametrize("size", [1e-3, 0.007, 0.1, 0.4])
def test_any_communication_step_takes_the_same_samples(size):
    """The displacement is held at 1 mm up to 2 s, then at 3 mm."""
    model, seen = IsotonicStand(), []
    integrator = Integrator(model)
    for k in range(round(4.0 / size)):
        model.displacement = 1e-3 if (k + 0.5) * size < 2.0 else 3e-3
        model.zero = 0.8 <= k * size < 1.2
        integrator.advance(k * size, size)
        seen.append(model.displacement_measured())
    before, after = seen[round(1.8 / size) - 1], seen[-1]
    assert before == pytest.approx(0.0, abs=READS)
    assert after == pytest.approx(2e-3, abs=READS)


def test_zeroing_waits_for_a_sample_and_stays():
    model = IsotonicStand(displacement=1e-3)
    integrator = Integrator(model)
    integrator.advance(0.0, 0.25)
    assert model.displacement_measured() == pytest.approx(1e-3, abs=READS)
    model.zero = True
    integrator.advance(0.25, 0.04)  # no sample in it
    model.zero = False
    integrator.advance(0.29, 0.06)
    assert model.displacement_measured() == pytest.approx(1e-3, abs=READS)
    model.zero = True
    integrator.advance(0.35, 0.1)
    model.zero = False
    model.displacement = 1.5e-3
    integrator.advance(0.45, 0.2)
    assert model.displacement_measured() == pytest.approx(0.5e-3, abs=READS)


@pytest.mark.parametrize("error", [0.005, -0.02])
def test_linearity_is_the_largest_deviation_as_a_share_of_full_scale(error):
    model = IsotonicStand(linearity=error)
    reach = np.linspace(-FULL, FULL, 4001)
    model.displacement = reach
    deviation = model.lvdt_voltage() / 196.85 - reach
    assert np.abs(deviation).max() == pytest.approx(abs(error) * FULL, rel=1e-6)
    assert abs(reach[np.argmax(np.abs(deviation))]) == pytest.approx(FULL / math.sqrt(3), rel=1e-3)
    assert deviation[[0, 2000, -1]] == pytest.approx(0.0, abs=1e-15)
    # in the middle it is a scale error, 2.6 times as large
    assert deviation[2001] / reach[2001] == pytest.approx(error * 1.5 * math.sqrt(3.0), rel=1e-5)


def test_beyond_full_scale_the_line_goes_on():
    model = IsotonicStand(linearity=0.02, displacement=0.03)
    assert model.lvdt_voltage() == pytest.approx(196.85 * 0.03, rel=1e-12)


def test_sampled_ripple_comes_back_at_four_hertz():
    """Twice 5003 Hz, sampled at 10 Hz: 6 Hz, which is 4 Hz."""
    model = IsotonicStand(carrier_ripple=0.01)
    integrator, read = Integrator(model), []
    for k in range(400):
        integrator.advance(0.1 * k, 0.1)
        read.append(model.displacement_measured())
    frequency, power = welch(np.array(read), fs=10.0, nperseg=200)
    assert frequency[np.argmax(power)] == pytest.approx(4.0, abs=0.05)
    assert np.std(read) == pytest.approx(0.01 / 196.85 / math.sqrt(2.0), rel=1e-3)


def test_inertia_that_is_left_out_is_as_small_as_the_readme_says():
    """200 g on 12 layers, 6300 N/m; the films' end moves at 0.0612 mm/s and turns at once."""
    stiffness, weight, speed = 6300.0, 0.2, 0.0612e-3
    turned = solve_ivp(
        lambda t, y: [y[1], stiffness * (-speed * t - y[0]) / weight],
        (0.0, 0.5),
        [0.0, speed],
        rtol=1e-10,
        atol=1e-15,
        dense_output=True,
    )
    time = np.linspace(0.0, 0.5, 20001)
    pull = stiffness * (-speed * time - turned.sol(time)[0])
    assert np.abs(pull).max() == pytest.approx(4.3e-3, rel=0.02)
    period = 2 * np.median(np.diff(time[1:][np.diff(np.sign(pull)) != 0]))
    assert 1.0 / period == pytest.approx(28.0, rel=0.02)


@pytest.mark.slow
def test_compiled_and_interpreted_laws_agree():
    run = CompiledModel(IsotonicStand).run(
        GRID,
        {
            "mass": np.array([mass(t + 0.005) for t in GRID]),
            "displacement": np.array([displacement(t + 0.005) for t in GRID]),
            "zero": np.array([float(zeroed(t + 0.005)) for t in GRID]),
        },
    )
    model = type("Finer", (IsotonicStand,), {"tolerance": 1e-12})()
    found = simulate(model, GRID)
    for column, name in enumerate(("tension", "sensor_voltage", "displacement_measured")):
        scale = np.abs(found[:, column]).max()
        assert run.signals[name] == pytest.approx(found[:, column], abs=1e-8 * scale), name


def test_signals_and_defaults_are_those_of_the_design():
    layout = IsotonicStand.layout
    assert {v.name: v.unit for v in layout.inputs} == {
        "mass": "kg",
        "displacement": "m",
        "zero": "1",
    }
    assert {v.name: v.unit for v in layout.measurable} == {
        "tension": "N",
        "sensor_voltage": "V",
        "displacement_measured": "m",
    }
    for p in layout.parameters:
        assert p.starts or p.source, p.name
        unprinted = p.name not in ("gravity", "sample_shift") and not p.starts
        assert p.source.startswith("assumed") == unprinted, p.name
