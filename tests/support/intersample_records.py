"""Records of the actuator whose inputs are known between samples, made by SciPy's exact solution of
linear systems.

A smooth input is a function of time: it goes in as straight lines over a fortieth of a sample. A
held one is constant from sample to sample.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.linalg import expm
from scipy.signal import StateSpace, chirp, lfilter, sawtooth, square

from fmus.kit.arrays import Array
from tests.support.measured import Measured

TRUE = {
    "R1": 0.47,
    "R2": 2.2,
    "C": 2.5,
    "alpha": 6.4e-5,
    "k1": 6000.0,
    "b1": 1.8e6,
    "k2": 1.1e4,
    "b2": 1.8e6,
}
NOISE = {"voltage": 4e-3, "displacement": 3e-6}  # V, m
_FINE = 40  # parts of a sample


def circuit(p: Mapping[str, float] = TRUE) -> StateSpace:
    """Charge, Kelvin and Maxwell elongation under current and force (thesis, eqs. 3.5-3.9)."""
    leak = p["C"] * (p["R1"] + p["R2"])
    a = np.diag([-1.0 / leak, -p["k2"] / p["b2"], 0.0])
    b = np.array([[p["R2"] / (p["R1"] + p["R2"]), 0.0], [0.0, 1.0 / p["b2"]], [0.0, 1.0 / p["b1"]]])
    c = np.array([[1.0 / p["C"] - p["R1"] / leak, 0.0, 0.0], [p["alpha"], 1.0, 1.0]])
    d = np.array([[p["R1"] * p["R2"] / (p["R1"] + p["R2"]), 0.0], [0.0, 1.0 / p["k1"]]])
    return StateSpace(a, b, c, d)


def _driven(plant: StateSpace, i: int, u: Array, step: float, held: bool) -> Array:
    """Outputs (n, 2) under one input (n,) from rest; no state acts on another, so that each is a
    filter.
    """
    states = len(plant.A)
    whole = np.zeros(
        (states + 2, states + 2)
    )  # the states, the input, and how much it changes in a step
    whole[:states, :states], whole[:states, states], whole[states, -1] = (
        plant.A,
        plant.B[:, i],
        1.0 / step,
    )
    exact = expm(step * whole)
    drive = np.outer(u[:-1], exact[:states, states])
    if not held:
        drive += np.outer(np.diff(u), exact[:states, -1])
    x = np.zeros((len(u), states))
    for k in range(states):
        x[1:, k] = lfilter([1.0], [1.0, -exact[k, k]], drive[:, k])
    return np.asarray(x @ plant.C.T + np.outer(u, plant.D[:, i]))


def _levels(time: Array, seed: int, values: int, dwell: float) -> Array:
    random = np.random.default_rng([seed, 7])
    which = np.floor(time / dwell + 1e-9).astype(int)
    return np.asarray(
        random.permutation(np.resize(np.linspace(-1.0, 1.0, values), which.max() + 1))[which]
    )


def _multisine(time: Array, seed: int, duration: float, highest: float) -> Array:
    phases = np.random.default_rng([seed, 9]).uniform(0.0, 2.0 * np.pi, int(highest * duration))
    sines = (
        np.cos(2.0 * np.pi * (k + 1) * time / duration + phase) for k, phase in enumerate(phases)
    )
    return np.asarray(sum(sines) / np.sqrt(len(phases)))


def stimulus(kind: str, time: Array, seed: int, rate: float) -> Array:
    """Current between about -1 and 1 A at instants (n,), in seconds."""
    duration = float(np.ceil(time[-1]))
    made: dict[str, Callable[[], Array]] = {
        "chirp": lambda: chirp(time, 0.01, duration, rate / 12.0),
        "multisine": lambda: _multisine(time, seed, duration, rate / 15.0),
        "triangle": lambda: sawtooth(2.0 * np.pi * time / 13.3, 0.5),
        "square": lambda: square(2.0 * np.pi * time / 11.0),
        "prbs": lambda: _levels(time, seed, 2, 2.0),
        "multilevel": lambda: _levels(time, seed, 7, 3.0),
        "every sample": lambda: _levels(time, seed, 50, 1.0 / rate),
    }
    return np.asarray(made[kind]())


def record(
    kind: str,
    held: bool,
    seed: int,
    duration: float = 120.0,
    rate: float = 10.0,
    noise: float = 1.0,
    force: str | None = None,
    force_held: bool = True,
    input_noise: float = 0.0,
    restless: float = 0.0,
    jitter: float = 0.0,
    outputs: tuple[str, ...] = ("voltage", "displacement"),
) -> Measured:
    """Measure the actuator driven with a current that is held between samples, or is as it is
    between them.

    The force is 1 N, or a stimulus about it. Noise is in units of `NOISE`; that of the inputs,
    which the actuator does not see, is a share of their range. A restless current that is held has
    noise that it does see. The clock jitters by so many seconds either way, and says so.
    """
    random = np.random.default_rng([seed, 11])
    coarse = np.arange(round(duration * rate)) / rate
    fine = np.arange((len(coarse) - 1) * _FINE + 1) / (rate * _FINE)
    early = round(jitter * rate * _FINE)
    at = np.clip(
        np.arange(len(coarse)) * _FINE + random.integers(-early, early + 1, len(coarse)),
        0,
        len(fine) - 1,
    )
    at[0] = 0

    def course(kind: str | None, held: bool, seed: int) -> Array:
        if kind is None:
            return np.ones(len(fine)) * 0.0
        values = stimulus(kind, coarse, seed, rate)
        values = values + restless * np.ptp(values) * np.random.default_rng(
            [seed, 13]
        ).standard_normal(len(coarse))
        return (
            values[np.searchsorted(at, np.arange(len(fine)), "right") - 1]
            if held
            else stimulus(kind, fine, seed, rate)
        )

    drives = [
        (course(kind, held, seed), held),
        (1.0 + 0.5 * course(force, force_held, seed + 1), force_held),
    ]
    plant, y = circuit(), np.zeros((len(fine), 2))
    for i, (u, is_held) in enumerate(drives):  # the sum of what each does alone
        y += _driven(plant, i, u, float(fine[1]), is_held)
    measured = {
        name: y[at, k] + noise * NOISE[name] * random.standard_normal(len(coarse))
        for k, name in enumerate(NOISE)
        if name in outputs
    }
    inputs = {name: u[at] for name, (u, _) in zip(("current", "force"), drives, strict=True)}
    inputs = {
        n: u + input_noise * np.ptp(u) * random.standard_normal(len(u)) for n, u in inputs.items()
    }
    return Measured(fine[at], inputs, measured)
