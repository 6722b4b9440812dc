"""Noise as it comes on a bench, drawn with NumPy alone: what a perfect model leaves of a record of
a first-order plant.

Nothing here is the kit's: neither the stimuli nor the plant nor the noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
SAMPLES, STEP = 2000, 0.1
TIME = STEP * np.arange(SAMPLES)
SWING = 1.0  # standard deviation of the output that is simulated


@dataclass(frozen=True)
class Clean:
    """A record of which the model is right: input, its two states, output simulated and
    measured.
    """

    time: Array
    input: Array
    states: dict[str, Array]
    simulated: Array
    measured: Array

    @property
    def residual(self) -> Array:
        """Measured minus simulated."""
        return self.measured - self.simulated


def _stimulus(random: np.random.Generator, kind: int, n: int) -> Array:
    """Multilevel, square wave, chirp, pseudorandom binary, multisine, triangle."""
    time = STEP * np.arange(n)
    period = random.uniform(4.0, 20.0)
    if kind == 0:
        return np.repeat(random.choice([-1.0, -0.4, 0.3, 1.0], n), random.integers(5, 60))[:n]
    if kind == 1:
        return np.where(np.sin(2.0 * np.pi * time / period) >= 0.0, 1.0, -1.0)
    if kind == 2:
        return np.sin(2.0 * np.pi * (0.02 + 0.3 * time / time[-1]) * time)
    if kind == 3:
        return np.repeat(random.choice([-1.0, 1.0], n), random.integers(3, 20))[:n]
    if kind == 4:
        phases = random.uniform(0.0, 2.0 * np.pi, 12)
        return sum(
            np.sin(2.0 * np.pi * (k + 1) * time / 60.0 + phase) for k, phase in enumerate(phases)
        )
    return 2.0 * np.abs(2.0 * (time / period % 1.0) - 1.0) - 1.0


def _lag(values: Array, pole: float, start: float = 0.0) -> Array:
    """x[k + 1] = pole x[k] + (1 - pole) u[k]."""
    result = np.empty(len(values))
    x = start
    for k, value in enumerate(values):
        result[k] = x
        x = pole * x + (1.0 - pole) * value
    return result


def coloured(white: Array, pole: float) -> Array:
    """First-order autoregression of unit size, from white noise of unit size, begun long before."""
    if pole == 0.0:
        return white
    x, result = white[0] / np.sqrt(1.0 - pole**2), np.empty(len(white))
    for k, value in enumerate(white):
        result[k] = x = pole * x + value
    return result * np.sqrt(1.0 - pole**2)


Noise = Callable[
    [np.random.Generator, Array], Array
]  # of unit size or thereabouts, given the output that is simulated


def gaussian(pole: float = 0.0) -> Noise:
    return lambda random, y: coloured(random.standard_normal(len(y)), pole)


def student(pole: float = 0.0, freedom: float = 3.0) -> Noise:
    return lambda random, y: coloured(random.standard_t(freedom, len(y)) / np.sqrt(3.0), pole)


def outliers(pole: float = 0.0, share: float = 0.01) -> Noise:
    """A hundredth of the samples is 5 to 20 standard deviations away."""

    def drawn(random: np.random.Generator, y: Array) -> Array:
        far = random.uniform(5.0, 20.0, len(y)) * random.choice([-1.0, 1.0], len(y))
        return coloured(random.standard_normal(len(y)), pole) + np.where(
            random.random(len(y)) < share, far, 0.0
        )

    return drawn


def slowly_varying(pole: float = 0.0, ratio: float = 5.0) -> Noise:
    """The level goes up and down by this ratio, two and a half times in the record."""

    def drawn(random: np.random.Generator, y: Array) -> Array:
        phase = 2.0 * np.pi * (2.5 * np.arange(len(y)) / len(y) + random.random())
        level = ratio ** (0.5 * np.sin(phase))
        return level * coloured(random.standard_normal(len(y)), pole)

    return drawn


def growing_with_size(pole: float = 0.0, share: float = 2.0) -> Noise:
    """The level is that of an instrument with an error in proportion to what it shows."""

    def drawn(random: np.random.Generator, y: Array) -> Array:
        return (0.4 + share * np.abs(y - y.mean()) / y.std()) * coloured(
            random.standard_normal(len(y)), pole
        )

    return drawn


def clean(
    seed: int, noise: Noise, level: float = 0.05, step: float = 0.0, n: int = SAMPLES
) -> Clean:
    """A plant with a fast and a slow part and a feedthrough, with noise; a converter with steps may
    read it.
    """
    random = np.random.default_rng(seed)
    time = STEP * np.arange(n)
    u = _stimulus(random, seed % 6, n)
    fast, slow = _lag(u, 0.9), _lag(u, 0.995)
    y = 0.3 * u + fast + slow
    y *= SWING / y.std()
    measured = y + level * noise(random, y)
    if step:
        measured = step * np.round(measured / step)
    return Clean(time, u, {"fast": fast, "slow": slow}, y, measured)


def controlled(
    seed: int, noise: Noise, gain: float, late: int, n: int = SAMPLES, level: float = 0.05
) -> Clean:
    """The plant in a loop: a controller moves the input by what it measured, at once or some
    samples later.
    """
    random = np.random.default_rng(seed)
    wanted = np.repeat(random.choice([-1.0, -0.3, 0.5, 1.0], n), random.integers(20, 80))[:n]
    disturbance = level * noise(random, wanted)
    u, fast, measured, error = np.empty(n), np.empty(n), np.empty(n), 0.0
    x = integral = 0.0
    for k in range(n):
        fast[k], measured[k] = x, x + disturbance[k]
        error = wanted[max(k - late, 0)] - measured[max(k - late, 0)]
        integral += 0.05 * gain * error
        u[k] = gain * error + integral
        x = 0.9 * x + 0.1 * u[k]
    return Clean(STEP * np.arange(n), u, {"fast": fast}, fast, measured)


ADC = 2.0 * 4.0 / 2**12  # step of a 12-bit converter over twice the range of the output
KINDS: dict[str, Callable[[int], Clean]] = {
    **{
        f"Gaussian, AR {pole:g}": lambda s, p=pole: clean(s, gaussian(p))
        for pole in (0.0, 0.5, 0.9, 0.95)
    },
    **{
        f"Student t3, AR {pole:g}": lambda s, p=pole: clean(s, student(p))
        for pole in (0.0, 0.9, 0.95)
    },
    **{
        f"1 % outliers, AR {pole:g}": lambda s, p=pole: clean(s, outliers(p)) for pole in (0.0, 0.9)
    },
    **{
        f"level in time, AR {pole:g}": lambda s, p=pole: clean(s, slowly_varying(p))
        for pole in (0.0, 0.9)
    },
    **{
        f"level by size, AR {pole:g}": lambda s, p=pole: clean(s, growing_with_size(p))
        for pole in (0.0, 0.9)
    },
    "12 bit, noise of a step": lambda s: clean(s, gaussian(), ADC, ADC),
    "12 bit, noise of a step, AR 0.9": lambda s: clean(s, gaussian(0.9), ADC, ADC),
    **{
        f"steps of {1 / share:.3g} noise": lambda s, f=share: clean(s, gaussian(), 0.05 * f, 0.05)
        for share in (0.5, 0.3, 0.1)
    },
    "steps, no noise": lambda s: clean(s, gaussian(), 0.0, 0.02),
}
LOOPS: dict[str, Callable[[int], Clean]] = {
    f"loop, gain {gain:g}, {late} late, AR {pole:g}": lambda s, g=gain, k=late, p=pole: controlled(
        s, gaussian(p), g, k
    )
    for gain in (0.5, 2.0)
    for late in (0, 1, 3)
    for pole in (0.0, 0.9)
}
