"""Claims: stiff and sampled components are diagnosed like the actuator: one changed parameter is
found, in seconds.

Their records are simulated here by matrix exponentials and by SciPy on equations written anew, none
by the kit.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import orchestration as ppy
from fmus import component
from orchestration.experiment.waveforms import multilevel
from tests.support.foot import lengths_at, toe_at
from tests.support.pace import slow_but


def advanced(a, b, step, inputs, start):
    """States (n, s) of a linear system under inputs (n, m) that are held."""
    states, size = len(a), len(a) + b.shape[1]
    augmented = np.zeros((size, size))
    augmented[:states] = step * np.hstack([a, b])
    moved = expm(augmented)[:states]
    found = [np.asarray(start, dtype=float)]
    for u in inputs[:-1]:
        found.append(moved @ np.concatenate([found[-1], u]))
    return np.array(found)


def galvanostat(limit, response=4e-3):
    """A minute at 100 Hz: a limited command behind a lag of 4 ms."""
    time = 0.01 * np.arange(6000)
    command = multilevel(time, [-1.8, -0.9, 0.0, 0.9, 1.8], (0.03, 0.4), 3)
    held = np.clip(command, -limit, limit)[:, None]
    current = advanced(
        np.array([[-1.0 / response]]), np.array([[1.0 / response]]), 0.01, held, [0.0]
    )[:, 0]
    inputs = {
        "current_command": command,
        "voltage": np.zeros(time.size),
        "voltage_limit": np.full(time.size, 15.0),
    }
    return time, inputs | {"voltage_command": np.zeros(time.size)}, {"current": current}


def voice_coil(R):
    """Twelve seconds at 100 Hz with a voltage on the coil: its time constant is a third of a
    millisecond.
    """
    L, K, m, b, cut = 1e-3, 3.9, 0.03, 6.0, 2.0 * np.pi * 100.0
    time = 0.01 * np.arange(1200)
    voltage, tension = (
        multilevel(time, [0.2, 0.8, 1.4, 2.0], (0.1, 0.6), 4),
        multilevel(time, [0.4, 1.0], (0.2, 1.0), 5),
    )
    a = np.array([[-R / L, 0, -K / L, 0], [0, 0, 1, 0], [K / m, 0, -b / m, 0], [0, cut, 0, -cut]])
    by = np.array([[1 / L, 0], [0, 0], [0, -1 / m], [0, 0]])
    # the voltage is held by the converter, which looks every 30th of a second
    inner, instants = 3, np.arange(3600) / 300.0
    seen = voltage[np.minimum((np.arange(3600) // 10 * 10) // inner, 1199)]
    fed = np.column_stack([seen, tension[np.arange(3600) // inner]])
    states = advanced(a, by, instants[1], fed, np.zeros(4))[::inner]
    inputs = {"force_reference": voltage, "tension": tension, "hold": np.zeros(time.size)}
    return time, inputs, {"coil_current": states[:, 0], "position_measured": states[:, 3]}


def arms_at(ankle, mtp, near=1e-6):
    """Moment arms (m) of the four actuators: how much longer each gets by an angle of its joint."""
    by_ankle, by_mtp = (
        [(a - b) / (2.0 * near) for a, b in zip(lengths_at(*up), lengths_at(*down), strict=True)]
        for up, down in (
            ((ankle + near, mtp), (ankle - near, mtp)),
            ((ankle, mtp + near), (ankle, mtp - near)),
        )
    )
    return [*by_ankle[:2], *by_mtp[2:]]


def toe_by(angles, near=1e-6):
    """Derivatives of the toe's place by the three angles, complex."""
    steps = near * np.eye(3)
    return [(toe_at(*(angles + s)) - toe_at(*(angles - s))) / (2.0 * near) for s in steps]


def foot_dynamic(ankle_damping):
    """Eight seconds at 50 Hz of a foot that is pulled and pushed, with soft stops; points in the
    plane, DOP853.
    """
    time, step = 0.02 * np.arange(400), 0.02
    rest = arms_at(0.0, 0.0)
    pulls = {
        "an": -5.0 * rest[1] / rest[0] + multilevel(time, [-0.6, -0.2, 0.2, 0.6], (0.1, 0.5), 1),
        "po": np.full(time.size, 5.0),
        "do": -5.0 * rest[3] / rest[2] + multilevel(time, [-0.1, 0.0, 0.1], (0.1, 0.5), 2),
        "pl": np.full(time.size, 5.0),
    }
    push = [multilevel(time, [-1.0, 0.0, 1.0], (0.1, 0.5), seed) for seed in (3, 4)]
    inertia, damping = np.array([1e-3, 5e-4, 2e-5]), np.array([ankle_damping, 0.2, 1e-3])
    low, high = np.array([-0.7, -0.26, -0.15]), np.array([0.7, 0.26, 1.05])

    def flow(_, state, k):
        q, w = state[:3], state[3:]
        an, po, do, pl = (
            arm * pull[k] for arm, pull in zip(arms_at(q[0], q[2]), pulls.values(), strict=True)
        )
        torque = np.array([d.real * push[0][k] + d.imag * push[1][k] for d in toe_by(q)])
        torque -= [an + po, 100.0 * q[1], do + pl]
        beyond = np.maximum(q - high, 0.0) + np.minimum(q - low, 0.0)
        return np.concatenate([w, (torque - damping * w) / inertia - 200.0**2 * beyond])

    states = [np.zeros(6)]
    for k in range(time.size - 1):
        solved = solve_ivp(
            flow, (0.0, step), states[-1], "DOP853", rtol=1e-8, atol=1e-10, args=(k,)
        )
        states.append(solved.y[:, -1])
    inputs = {f"{name}_tension": pull for name, pull in pulls.items()}
    inputs |= {"toe_force_x": push[0], "toe_force_y": push[1]}
    angles = np.array(states)[:, :3].T
    return time, inputs, dict(zip(("ankle_angle", "tm_angle", "mtp_angle"), angles, strict=True))


def foot(r_pl):
    """A minute at 10 Hz of a foot that is led through postures: what its actuators' lengths are
    then.
    """
    time = 0.1 * np.arange(600)
    ankle = multilevel(time, np.linspace(-0.6, 0.6, 9).tolist(), (0.2, 1.0), 1)
    mtp = multilevel(time, np.linspace(-0.1, 1.0, 9).tolist(), (0.2, 1.0), 2)
    lengths = np.array([lengths_at(a, m) for a, m in zip(ankle, mtp, strict=True)]).T
    lengths[3] += (r_pl - 16.3e-3) * mtp
    names = [f"{name}_length" for name in ("an", "po", "do", "pl")]
    return time, {"ankle_angle": ankle, "mtp_angle": mtp}, dict(zip(names, lengths, strict=True))


def estimator(forgetting_time):
    """Five minutes at 10 Hz of recursive least squares over an actuator whose R1 comes and goes;
    eqs. 4.6 to 4.9.
    """
    count, step, R2, C, held, random = 3000, 0.1, 2.35, 2.7, 0.0, np.random.default_rng(9)
    time = step * np.arange(count)
    current = 0.9 * np.sign(np.sin(0.4 * np.pi * time + 0.1))
    R1 = 0.43 * (1.0 + 0.3 * np.sin(2.0 * np.pi * time / 120.0))
    voltage = np.zeros(count)
    for k in range(count):  # R2 across R1 and C in series; C holds `held`, in volts
        voltage[k] = R2 * (R1[k] * current[k] + held) / (R1[k] + R2)
        final, decay = R2 * current[k], math.exp(-step / ((R1[k] + R2) * C))
        held = final + (held - final) * decay
    voltage += 5e-3 * random.standard_normal(count)

    left, theta, covariance = 0.1 ** (step / forgetting_time), np.zeros(3), 1e4 * np.eye(3)
    circuits = np.zeros((count, 3))
    for k in range(1, count):
        phi = np.array([current[k], current[k - 1], -voltage[k - 1]])
        gain = covariance @ phi / (left + phi @ covariance @ phi)
        theta = theta + gain * (voltage[k] - phi @ theta)
        covariance = (covariance - np.outer(gain, phi @ covariance)) / left
        b0, b1, a = theta
        circuits[k] = circuits[k - 1]
        if -1.0 < a < 0.0 < b0 and min(b0 + b1, b1 - a * b0) > 0.0:
            leak = (b0 + b1) / (1.0 + a)
            series = b0 * leak / (leak - b0)
            circuits[k] = series, leak, -step / (math.log(-a) * (series + leak))
    shown = np.vstack([np.zeros(3), circuits[:-1]])  # a sample shows at the next point
    return (
        time,
        {"current": current, "voltage": voltage},
        dict(zip(("R1", "R2", "C"), shown.T, strict=True)),
    )


@dataclass(frozen=True)
class Case:
    """A component, the parameter that is changed, and what is known."""

    make: Callable
    parameter: str
    nominal: float
    value: float
    noise: dict
    settings: dict = field(default_factory=dict)
    free: tuple = ("",)  # ends of the names of parameters that are fitted


CASES = {
    "galvanostat": Case(
        galvanostat, "current_limit", 1.3, 1.1, {"current": 1e-3}, {"response_time": 4e-3}
    ),
    "voice_coil_dma": Case(
        voice_coil,
        "R",
        3.0,
        3.6,
        {"coil_current": 1e-3, "position_measured": 1e-5},
        {"controller_on": 0.0},
    ),
    "degradation_estimator": Case(
        estimator,
        "forgetting_time",
        60.0,
        90.0,
        dict.fromkeys(("R1", "R2", "C"), 1e-3),
        {"instrumental_variable": 0.0, "maximum_trace": 1e15, "forgetting_time": 60.0},
        free=("forgetting_time",),
    ),
    "foot": Case(
        foot,
        "r_pl",
        16.3e-3,
        18e-3,
        dict.fromkeys(("an_length", "po_length", "do_length", "pl_length"), 1e-5),
        free=("r_pl", "l_pl", "r_an", "r_po"),
    ),
    # of its geometry a record of angles says little: that is known from the drawing
    "foot_dynamic": Case(
        foot_dynamic,
        "ankle_damping",
        0.02,
        0.03,
        dict.fromkeys(("ankle_angle", "tm_angle", "mtp_angle"), 1e-4),
        free=("_damping", "_inertia"),
    ),
}


def diagnosed(name, actual, seed):
    """Diagnose a clean record of a specimen."""
    case, random = CASES[name], np.random.default_rng(seed)
    time, inputs, outputs = case.make(actual)
    measured = {
        o: outputs[o] + size * random.standard_normal(time.size) for o, size in case.noise.items()
    }
    held = [p.name for p in component(name).layout.parameters if not p.name.endswith(case.free)]
    record = {"time": time, **inputs, **measured}
    calibrated = {"effects": [], "laws": False, "interpolate": False}
    return ppy.diagnose(record, name, settings=case.settings, hold=held, **calibrated)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    slow_but(
        ["galvanostat", "voice_coil_dma", "degradation_estimator", "foot", "foot_dynamic"],
        "galvanostat",
        "degradation_estimator",
    ),
)
def test_a_changed_parameter_of_a_stiff_component_is_found(name):
    case = CASES[name]
    found = diagnosed(name, case.value, 7)
    assert (found.verdict, found.causes) == ("recalibrate", [])
    assert found.changed == [case.parameter]
    assert found.parameters[case.parameter].value == pytest.approx(case.value, rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    slow_but(["galvanostat", "voice_coil_dma", "degradation_estimator", "foot"], "voice_coil_dma"),
)
def test_a_clean_record_of_a_stiff_component_is_consistent(name):
    found = diagnosed(name, CASES[name].nominal, 8)
    assert (found.verdict, found.causes) == ("consistent", [])


def dry_slide():
    """Six seconds at 500 Hz of a coil on a slide with 0.3 N of dry friction, by Runge and Kutta in
    steps of 50 us.
    """
    R, L, K, m, b, cut, spring, damping = 3.0, 1e-3, 3.9, 0.3, 6.0, 2.0 * np.pi * 100.0, 300.0, 1.0
    n, inner, step, random = 3000, 40, 0.002, np.random.default_rng(3)
    voltage = np.repeat(random.choice([0.8, 2.0, 3.2, 4.4], n // 50 + 1), 50)[:n]

    def flow(state, v):
        i, x, w, z = state
        dry, pull = 0.3 * math.tanh(w / 1e-4), spring * x + damping * w
        return (v - R * i - K * w) / L, w, (K * i - b * w - dry - pull) / m, cut * (x - z)

    def moved(state, by, rate):
        return [s + by * r for s, r in zip(state, rate, strict=True)]

    state, states, dt = [0.0, 0.0, 0.0, 0.0], [], step / inner
    for v in voltage:
        states.append(state)
        for _ in range(inner):
            k1 = flow(state, v)
            k2 = flow(moved(state, dt / 2, k1), v)
            k3 = flow(moved(state, dt / 2, k2), v)
            k4 = flow(moved(state, dt, k3), v)
            mean = [
                (p + 2.0 * q + 2.0 * r + s) / 6.0 for p, q, r, s in zip(k1, k2, k3, k4, strict=True)
            ]
            state = moved(state, dt, mean)
    i, x, w, z = np.array(states).T
    outputs = {
        "coil_current": i + 1e-3 * random.standard_normal(n),
        "position_measured": z + 1e-5 * random.standard_normal(n),
    }
    return (
        step * np.arange(n),
        {"force_reference": voltage, "tension": spring * x + damping * w},
        outputs,
    )


@pytest.mark.slow
def test_dry_friction_of_the_bench_is_named_and_no_parameter_takes_its_place():
    time, inputs, outputs = dry_slide()
    known = {"controller_on": 0.0, "m": 0.3, "sample_period": 0.002}
    record = {"time": time, **inputs, **outputs}
    found = ppy.diagnose(
        record, "voice_coil_dma", settings=known, effects=["coulomb_friction"], laws=False
    )
    assert (found.verdict, found.causes) == ("cause", ["coulomb_friction"])
    assert found.parameters["coulomb_force"].value == pytest.approx(0.3, rel=0.02)
    assert found.parameters["L"].value == pytest.approx(1e-3, rel=0.05)
