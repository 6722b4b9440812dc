"""Stimuli: courses of an input between two levels, held between samples or in straight lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fmus.kit.arrays import Array

Places = NDArray[np.int_]

HELD = ("prbs", "steps")
NAMES = ("prbs", "multisine", "steps", "chirp", "ramp")


def stimulus(
    name: str, samples: int, slow: float, levels: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Draw the samples of a stimulus.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    samples : int
    slow : float
        Slowest time constant of the plant, in samples.
    levels : tuple of float
        Range of the input.
    rng : numpy.random.Generator
    """
    low, high = levels
    unit = _UNIT[name](np.arange(samples), slow, rng)
    share = rng.uniform(0.75, 1.0)
    middle = 0.5 * (low + high) + 0.5 * (1.0 - share) * (high - low) * rng.uniform(-1.0, 1.0)
    return np.asarray(middle + 0.5 * share * (high - low) * unit)


def _prbs(k: Places, slow: float, rng: np.random.Generator) -> Array:
    dwell = max(2, int(slow * rng.uniform(0.2, 0.6)))
    return rng.choice([-1.0, 1.0], len(k) // dwell + 1)[k // dwell]


def _steps(k: Places, slow: float, rng: np.random.Generator) -> Array:
    ends = np.cumsum(np.maximum(2, slow * rng.uniform(0.3, 2.0, len(k))).astype(int))
    return rng.uniform(-1.0, 1.0, len(k))[np.searchsorted(ends, k, side="right")]


def _multisine(k: Places, slow: float, rng: np.random.Generator) -> Array:
    frequencies = np.geomspace(3.0 / len(k), 0.5 / slow, 7)
    phases = rng.uniform(0.0, 2.0 * np.pi, 7)
    waves = np.sin(2.0 * np.pi * frequencies[:, None] * k + phases[:, None]).sum(axis=0)
    return np.asarray(waves / np.abs(waves).max())


def _chirp(k: Places, slow: float, rng: np.random.Generator) -> Array:
    first, last = 2.0 / len(k), 0.6 / slow
    rate = np.log(last / first) / len(k)
    phase = 2.0 * np.pi * first / rate * np.expm1(rate * k)
    return np.asarray(np.sin(phase + rng.uniform(0.0, 2.0 * np.pi)))


def _ramp(k: Places, slow: float, rng: np.random.Generator) -> Array:
    corners = np.arange(0, len(k) + 1, max(2, int(slow * rng.uniform(0.7, 2.0))))
    corners = np.append(corners, len(k))
    return np.asarray(np.interp(k, corners, rng.uniform(-1.0, 1.0, len(corners))))


_UNIT = {
    "prbs": _prbs,
    "multisine": _multisine,
    "steps": _steps,
    "chirp": _chirp,
    "ramp": _ramp,
}
