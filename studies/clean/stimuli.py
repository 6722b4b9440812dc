"""Shapes of stimuli between -1 and 1, as functions of time.

They are functions so that they can be evaluated between samples, too.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fmus.kit.arrays import Array

Shape = Callable[[Array], Array]
SMOOTH = ("chirp", "multisine", "triangle")  # what a generator may make without holding samples


def square(period: float, duration: float, rng: np.random.Generator) -> Shape:
    """Alternate, four periods of the plant on either side."""
    return lambda t: np.where(np.floor(t / (4.0 * period)) % 2 == 0, 1.0, -1.0)


def chirp(period: float, duration: float, rng: np.random.Generator) -> Shape:
    """Sweep a decade and a half upwards, logarithmically, over the record."""
    low, high = 1.0 / (20.0 * period), 1.5 / period
    rate = np.log(high / low) / duration
    return lambda t: np.sin(2.0 * np.pi * low / rate * np.expm1(rate * t))


def pseudo_random_binary(period: float, duration: float, rng: np.random.Generator) -> Shape:
    """Toggle or not after each period."""
    bits = rng.choice([-1.0, 1.0], size=int(4.0 * duration / period) + 8)
    return lambda t: bits[np.floor(t / period).astype(int)]


def triangle(period: float, duration: float, rng: np.random.Generator) -> Shape:
    """Ramp up and down."""
    return lambda t: 1.0 - 2.0 * np.abs((t / (6.0 * period)) % 2.0 - 1.0)


def multisine(period: float, duration: float, rng: np.random.Generator) -> Shape:
    """Add eight harmonics of equal size with random phases."""
    phases = rng.uniform(0.0, 2.0 * np.pi, 8)
    base = 2.0 * np.pi / (12.0 * period)

    def shape(t: Array) -> Array:
        return (
            sum(np.sin((k + 1) ** 1.3 * base * t + phase) for k, phase in enumerate(phases)) / 6.0
        )

    return shape


def step_and_rest(period: float, duration: float, rng: np.random.Generator) -> Shape:
    """Return one pulse in the first half, then nothing."""
    begin, end = 0.1 * duration, rng.uniform(0.35, 0.5) * duration
    return lambda t: np.where((t >= begin) & (t < end), 1.0, 0.0)


STIMULI: dict[str, Callable[[float, float, np.random.Generator], Shape]] = {
    "square": square,
    "chirp": chirp,
    "PRBS": pseudo_random_binary,
    "triangle": triangle,
    "multisine": multisine,
    "step and rest": step_and_rest,
}
