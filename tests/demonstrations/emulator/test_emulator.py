import ast
import subprocess
import sys
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.signal import lsim

from demonstrations import emulator
from demonstrations.emulator.emulator import EmulatedRig, Physics
from demonstrations.emulator.hidden_coupling import LoadDependentVoltage, SaturatingStrain
from demonstrations.emulator.hidden_electrical import GrowingResistance
from demonstrations.emulator.physics import RigParameters, propagate, together

NOMINAL = RigParameters()
quiet = partial(EmulatedRig, voltage_noise=0.0, displacement_noise=0.0)


@dataclass
class SmoothLeakage(Physics):
    linear = False

    def leakage_current(self, voltage: Any) -> Any:
        return super().leakage_current(voltage) + 0.3 * voltage**3


def square_wave(time, amplitude, period):
    return amplitude * np.where(np.floor(2 * time / period + 1e-9) % 2 == 0, 1.0, -1.0)


RIG = [
    *Path(emulator.__file__).parent.glob("hidden_*.py"),
    *(
        Path(emulator.__file__).with_name(n)
        for n in ("emulator.py", "physics.py", "refit.py", "variations.py")
    ),
]


@pytest.mark.parametrize("path", RIG, ids=lambda path: path.stem)
def test_the_rig_imports_nothing_of_the_models(path):
    imported = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            imported.add(node.module or "")
    own = {name for name in imported if name.startswith("demonstrations.emulator")}
    assert {name.split(".")[0] for name in imported - own} <= {
        "__future__",
        "collections",
        "dataclasses",
        "typing",
        "numpy",
        "scipy",
    }


def test_loading_the_rig_loads_nothing_of_the_models():
    loaded = (
        "import sys, demonstrations.emulator.variations, demonstrations.emulator.emulator;"
        " print([m for m in sys.modules if m.split('.')[0] in ('fmus', 'casadi') or"
        " m.startswith('orchestration.')])"
    )
    answer = subprocess.run(
        [sys.executable, "-c", loaded], capture_output=True, text=True, check=True
    ).stdout
    assert all(
        name == "orchestration.rig" or name.startswith("demonstrations.emulator")
        for name in ast.literal_eval(answer)
    )


def test_current_step_charges_like_an_rc_circuit():
    p, time, amps = NOMINAL, np.linspace(0, 60, 601), 0.9
    rig = quiet()
    measured = rig.run(time, amps, 0.0)
    constant = (p.R1 + p.R2) * p.C
    assert constant == pytest.approx(7.5, rel=0.01)  # the thesis: approximately 7.5 s
    charge = amps * p.R2 * p.C * (1 - np.exp(-time / constant))
    parallel = p.R1 * p.R2 / (p.R1 + p.R2)
    voltage = amps * (p.R2 + (parallel - p.R2) * np.exp(-time / constant))
    np.testing.assert_allclose(rig.truth["charge"], charge, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(measured["voltage"], voltage, rtol=1e-11)
    np.testing.assert_allclose(measured["displacement"], p.alpha * charge, rtol=1e-11, atol=1e-17)


def test_self_discharge_and_electrical_steady_state():
    p, time = NOMINAL, np.linspace(0, 400, 4001)
    rig = quiet(initial_charge=2.0)
    measured = rig.run(time, 0.0, 0.0)
    np.testing.assert_allclose(
        rig.truth["charge"], 2.0 * np.exp(-time / ((p.R1 + p.R2) * p.C)), rtol=1e-10
    )
    assert measured["voltage"][0] == pytest.approx(2.0 / p.C * p.R2 / (p.R1 + p.R2), rel=1e-12)
    settled = quiet().run(time, 0.5, 0.0)["voltage"][-1]
    assert settled == pytest.approx(0.5 * p.R2, rel=1e-12)


def test_force_step_creeps_like_a_burgers_body_and_leaves_plastic_set():
    p, time, newtons = NOMINAL, np.linspace(0, 1000, 2001), 1.5

    def compliance(t):
        return 1 / p.k1 + t / p.b1 + (1 - np.exp(-p.k2 * t / p.b2)) / p.k2

    held = quiet().run(time, 0.0, newtons)["displacement"]
    np.testing.assert_allclose(held, newtons * compliance(time), rtol=1e-11)
    released = time >= 400
    recovered = quiet().run(time, 0.0, np.where(released, 0.0, newtons))["displacement"]
    after = time[released]
    np.testing.assert_allclose(
        recovered[released],
        newtons * (compliance(after) - compliance(after - 400)),
        rtol=1e-10,
        atol=1e-17,
    )
    set_after_long = quiet().run(
        np.array([0.0, 400.0, 10000.0]), 0.0, np.array([newtons, 0.0, 0.0])
    )["displacement"][-1]
    assert set_after_long == pytest.approx(newtons * 400 / p.b1, rel=1e-12)


@pytest.mark.parametrize("parameters", [NOMINAL, RigParameters.scattered(4)])
def test_agrees_with_transfer_functions_of_the_thesis(parameters):
    p, step = parameters, 0.1
    time = np.arange(1500) * step
    random = np.random.default_rng(7)
    current = np.repeat(random.uniform(-0.9, 0.9, 300), 5)
    force = np.repeat(random.uniform(0.5, 2.75, 30), 50)
    impedance = control.tf([p.R1 * p.R2 * p.C, p.R2], [(p.R1 + p.R2) * p.C, 1])  # 3.9
    electrical = control.tf([p.alpha * p.R2 * p.C], [(p.R1 + p.R2) * p.C, 1])  # 3.6
    mechanical = control.tf(
        [p.b2 / p.k1, 1 + p.k2 / p.k1 + p.b2 / p.b1, p.k2 / p.b1], [p.b2, p.k2, 0]
    )  # 3.7

    def respond(system, signal):
        held = control.c2d(control.ss(system), step, method="zoh")
        return control.forced_response(held, time, signal).outputs

    measured = quiet(p).run(time, current, force)
    np.testing.assert_allclose(
        measured["voltage"], respond(impedance, current), rtol=1e-9, atol=1e-10
    )
    total = respond(electrical, current) + respond(mechanical, force)  # 3.8
    np.testing.assert_allclose(measured["displacement"], total, rtol=1e-9, atol=1e-13)


def test_uneven_sampling_gives_the_same_trajectory():
    even = np.arange(0, 40.05, 0.1)
    keep = np.sort(np.random.default_rng(0).choice(np.arange(1, even.size), 150, replace=False))
    keep = np.concatenate([[0], keep])
    # The inputs change at one kept instant only, so both samplings describe the same held input.
    switch = even[keep[60]]
    runs = [
        quiet().run(t, np.where(t < switch, 0.9, -0.4), np.where(t < switch, 1.0, 2.0))
        for t in (even, even[keep])
    ]
    for name in ("voltage", "displacement"):
        np.testing.assert_allclose(runs[1][name], runs[0][name][keep], rtol=1e-10, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.1, 0.5])
def test_the_integrator_agrees_with_an_adaptive_one(step):
    time = np.arange(0, 60, step)
    inputs = np.array([square_wave(time, 0.9, 5.0), np.where(time < 30, 0.5, 2.0)])
    physics = together([SmoothLeakage, GrowingResistance, LoadDependentVoltage])(NOMINAL)
    start = np.array([0.3, 1e-5, 2e-5, 0.0])

    def slope(_: float, state: np.ndarray, current: float, force: float) -> list[Any]:
        return physics.rates(state, current, force)

    run = propagate(physics, time, inputs, start)
    state, expected = start, [start]
    for k in range(time.size - 1):
        held = (float(inputs[0, k]), float(inputs[1, k]))
        solution = solve_ivp(slope, (0, step), state, "DOP853", args=held, rtol=1e-11, atol=1e-14)
        state = solution.y[:, -1]
        expected.append(state)
    amplitude = np.max(np.abs(expected), axis=0)
    # The rate of the throughput has kinks, where an integrator of constant steps is of second
    # order.
    assert np.all(
        np.max(np.abs(run.state.T - expected), axis=0)
        < np.array([1e-6, 1e-9, 1e-9, 1e-5]) * amplitude
    )


def test_between_samples_linear_physics_is_exact():
    time = np.arange(0, 20, 0.5)
    inputs = np.array([square_wave(time, 0.9, 5.0), np.where(time < 10, 0.5, 2.0)])
    fine = np.arange(0, 19.5, 0.125)
    held = inputs[:, np.searchsorted(time, fine + 1e-9, side="right") - 1]
    start = np.array([0.3, 1e-5, 2e-5])
    state, at_once = propagate(Physics(NOMINAL), time, inputs, start).at(fine)
    np.testing.assert_allclose(
        state, propagate(Physics(NOMINAL), fine, held, start).state, rtol=1e-11, atol=1e-18
    )
    np.testing.assert_array_equal(at_once, held)


def test_growing_resistance_follows_its_throughput():
    # Without leakage all of the current reaches the films, so throughput and voltage are known in
    # closed form.
    parameters = RigParameters(R2=1e12)
    time = np.arange(0, 50, 0.1)
    current = square_wave(time, 0.9, 10.0)
    voltage = quiet(parameters, hidden=partial(GrowingResistance, growth=0.8, endurance=30.0)).run(
        time, current, 0.0
    )["voltage"]
    charge = np.concatenate([[0.0], np.cumsum(current[:-1]) * 0.1])
    moved = 0.9 * time
    expected = charge / parameters.C + parameters.R1 * (1 + 0.8 * moved / (30.0 + moved)) * current
    np.testing.assert_allclose(voltage, expected, rtol=1e-8, atol=1e-8)
    # With leakage: the throughput integrates the magnitude of the charging current, here positive,
    # so it is the charge.
    rig = quiet(hidden=GrowingResistance)
    leaky = rig.run(time, 0.9, 0.0)["voltage"]
    resistance = NOMINAL.R1 * (1 + 0.5 * rig.truth["charge"] / (500.0 + rig.truth["charge"]))
    balance = (leaky - rig.truth["charge"] / NOMINAL.C) / resistance + leaky / NOMINAL.R2
    np.testing.assert_allclose(balance, 0.9, rtol=1e-9)

    def seconds_per_coulomb(charge):
        rise = NOMINAL.R1 * (1 + 0.5 * charge / (500.0 + charge))
        return (rise + NOMINAL.R2) / (0.9 * NOMINAL.R2 - charge / NOMINAL.C)

    elapsed = quad(seconds_per_coulomb, 0, rig.truth["charge"][200], epsabs=1e-12, epsrel=1e-12)[0]
    assert elapsed == pytest.approx(time[200], rel=1e-8)


def test_load_dependent_voltage_shifts_and_relaxes():
    p, time, slope, newtons = NOMINAL, np.arange(0, 100, 0.1), 0.02, 2.0
    rig = quiet(hidden=partial(LoadDependentVoltage, sensitivity=slope, levelling_load=1e12))
    voltage = rig.run(time, 0.0, newtons)["voltage"]
    decay = np.exp(-time / ((p.R1 + p.R2) * p.C))
    np.testing.assert_allclose(
        voltage, slope * newtons * p.R2 / (p.R1 + p.R2) * decay, rtol=1e-9, atol=1e-13
    )
    np.testing.assert_allclose(
        rig.truth["charge"], -p.C * slope * newtons * (1 - decay), rtol=1e-9, atol=1e-14
    )


@pytest.mark.slow
def test_a_variation_may_leak_in_a_nonlinear_way():
    voltage = quiet(hidden=SmoothLeakage).run(np.array([0.0, 200.0, 400.0]), 0.9, 0.0)["voltage"]
    start = brentq(lambda v: v / NOMINAL.R1 + v / NOMINAL.R2 + 0.3 * v**3 - 0.9, 0, 5, xtol=1e-13)
    settled = brentq(lambda v: v / NOMINAL.R2 + 0.3 * v**3 - 0.9, 0, 5, xtol=1e-13)
    assert voltage[0] == pytest.approx(start, rel=1e-10)
    assert voltage[-1] == pytest.approx(settled, rel=1e-8)


def test_variations_combine():
    time = np.arange(0, 20, 0.1)
    both, growing = (
        quiet(hidden=together([SaturatingStrain, GrowingResistance])),
        quiet(hidden=GrowingResistance),
    )
    np.testing.assert_array_equal(
        both.run(time, 0.9, 0.5)["voltage"], growing.run(time, 0.9, 0.5)["voltage"]
    )
    assert both.truth["displacement"][-1] < growing.truth["displacement"][-1]


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_has_the_declared_spread_and_colour(colour):
    samples = 200_000
    time = np.arange(samples) * 0.1
    rig = EmulatedRig(seed=11, noise_colour=colour)
    measured = rig.run(time, 0.1, 0.5)
    noise = {name: measured[name] - rig.truth[name] for name in measured}
    effective = (
        samples * (1 - colour) / (1 + colour)
    )  # independent samples worth, for the mean of an AR(1) series
    for name, deviation in (("voltage", 4e-3), ("displacement", 3e-6)):
        series = noise[name] / deviation
        assert abs(np.mean(series)) < 4 / np.sqrt(effective)
        # Bartlett: the variance estimate of an AR(1) series spreads by sqrt(2 (1 + phi^2) / (1 -
        # phi^2) / n).
        assert abs(np.var(series) - 1) < 4 * np.sqrt(
            2 * (1 + colour**2) / (1 - colour**2) / samples
        )
        for lag in (1, 5):
            assert np.mean(series[lag:] * series[:-lag]) == pytest.approx(colour**lag, abs=0.03)
    assert abs(np.mean(noise["voltage"] * noise["displacement"])) / (4e-3 * 3e-6) < 4 / np.sqrt(
        effective
    )


def test_coloured_noise_is_stationary_from_the_first_sample():
    first = [
        EmulatedRig(seed=s, noise_colour=0.9).run([0.0, 0.1], 0.0, 0.0)["voltage"]
        for s in range(1500)
    ]
    spread = np.std(np.array(first) / 4e-3, axis=0)
    np.testing.assert_allclose(spread, 1.0, atol=4 / np.sqrt(2 * 1500))


def test_a_seed_repeats_the_sequence_of_runs():
    time = np.arange(0, 10, 0.1)
    one, same, other = EmulatedRig(seed=5), EmulatedRig(seed=5), EmulatedRig(seed=6)
    runs = [rig.run(time, 0.5, 1.0)["voltage"] for rig in (one, one, same, same, other)]
    np.testing.assert_array_equal(runs[0], runs[2])
    np.testing.assert_array_equal(runs[1], runs[3])
    assert not np.any(runs[0] == runs[1])
    assert not np.any(runs[0] == runs[4])
    np.testing.assert_array_equal(one.truth["voltage"], other.truth["voltage"])


def test_quantisation_rounds_to_whole_counts():
    time = np.arange(0, 30, 0.1)
    rig = quiet(voltage_resolution=1e-2, displacement_resolution=1e-6)
    measured = rig.run(time, 0.7, 1.0)
    for name, count in (("voltage", 1e-2), ("displacement", 1e-6)):
        counts = measured[name] / count
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
        assert np.max(np.abs(measured[name] - rig.truth[name])) <= count / 2 * (1 + 1e-9)
        assert np.unique(measured[name]).size < time.size


def test_drawn_specimens():
    assert RigParameters.scattered(1) == RigParameters.scattered(1) != RigParameters.scattered(2)
    assert RigParameters.scattered(1, spread=0.0) == NOMINAL
    nominal = np.array(list(asdict(NOMINAL).values()))
    factors = (
        np.array([list(asdict(RigParameters.scattered(s)).values()) for s in range(1000)]) / nominal
    )
    np.testing.assert_allclose(np.std(np.log(factors), axis=0), 0.15, rtol=4 / np.sqrt(2 * 1000))


def test_voltage_agrees_with_lsim_of_the_state_space_form():
    p, time = NOMINAL, np.arange(0, 30, 0.05)
    current = np.sin(0.7 * time)
    constant = (p.R1 + p.R2) * p.C
    system = (
        [[-1 / constant]],
        [[p.R2 / (p.R1 + p.R2)]],
        [[p.R2 / constant]],
        [[p.R1 * p.R2 / (p.R1 + p.R2)]],
    )
    _, expected, _ = lsim(system, current, time, interp=False)
    np.testing.assert_allclose(
        quiet().run(time, current, 0.0)["voltage"], expected.ravel(), rtol=1e-9, atol=1e-11
    )


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: RigParameters(R1=0.0), "R1"),
        (lambda: RigParameters(C=float("nan")), "C"),
        (lambda: EmulatedRig(noise_colour=1.0), "noise_colour"),
        (lambda: EmulatedRig(voltage_noise=-1e-3), "voltage_noise"),
        (lambda: EmulatedRig().run([0.0, 0.0], 0.0, 0.0), "time"),
        (lambda: EmulatedRig().run([], 0.0, 0.0), "time"),
        (lambda: EmulatedRig().run([0.0, 1.0], [0.0, np.nan], 0.0), "current"),
        (lambda: EmulatedRig().run([0.0, 1.0], 0.0, [1.0, 1.0, 1.0]), "force"),
    ],
)
def test_refusals_name_what_is_wrong(call, text):
    with pytest.raises(ValueError, match=text):
        call()


def test_one_sample_is_a_record():
    measured = quiet().run([0.0], 0.5, 1.0)
    assert measured["displacement"][0] == pytest.approx(1.0 / NOMINAL.k1, rel=1e-12)
