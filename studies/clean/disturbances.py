"""Kinds of measurement noise, each drawn at a given standard deviation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from fmus.kit.arrays import Array

RUN_IN = 200  # samples of an autoregression before those that count
OUTLIERS = 0.01  # share of samples
RESERVE = 2.5  # range of a converter over what is measured with it
LEVELS = 4096  # of twelve bits


def gaussian(clean: Array, deviation: float, rng: np.random.Generator) -> Array:
    """Return white Gaussian noise."""
    return clean + deviation * rng.standard_normal(clean.size)


def autoregressive(clean: Array, deviation: float, rng: np.random.Generator) -> Array:
    """Return noise of a first-order autoregression with a coefficient up to 0.9."""
    colour = rng.uniform(0.3, 0.9)
    return clean + deviation * coloured(colour, clean.size, rng)


def coloured(colour: float, n: int, rng: np.random.Generator) -> Array:
    """Return a first-order autoregression of unit variance."""
    drive = np.sqrt(1.0 - colour**2) * rng.standard_normal(n + RUN_IN)
    return np.asarray(lfilter([1.0], [1.0, -colour], drive)[RUN_IN:])


def student(clean: Array, deviation: float, rng: np.random.Generator) -> Array:
    """Return noise of Student's t with three degrees of freedom, whose variance is three."""
    return clean + deviation / np.sqrt(3.0) * rng.standard_t(3.0, clean.size)


def with_outliers(clean: Array, deviation: float, rng: np.random.Generator) -> Array:
    """Return noise in which one sample in a hundred is 10 to 50 standard deviations off."""
    noisy = gaussian(clean, deviation, rng)
    hit = rng.random(clean.size) < OUTLIERS
    size = rng.uniform(10.0, 50.0, clean.size) * rng.choice([-1.0, 1.0], clean.size)
    return np.where(hit, noisy + deviation * size, noisy)


def quantised(clean: Array, deviation: float, rng: np.random.Generator) -> Array:
    """Return a twelve-bit reading with noise of a third of a step; `deviation` does not count."""
    step = RESERVE * np.ptp(clean) / LEVELS
    return np.asarray(
        step * np.round((clean + step / 3.0 * rng.standard_normal(clean.size)) / step)
    )


def varying(clean: Array, deviation: float, rng: np.random.Generator) -> Array:
    """Return noise four times as large in one half of the record, or with the measured size."""
    part = np.arange(clean.size) / clean.size
    if rng.random() < 0.5:
        level = np.where(part < rng.uniform(0.3, 0.7), 1.0, 4.0)
    else:
        away = np.abs(clean - np.median(clean))
        level = 1.0 + 3.0 * away / away.max()
    return clean + deviation * level / np.sqrt(np.mean(level**2)) * rng.standard_normal(clean.size)


ON_OUTPUTS: dict[str, Callable[[Array, float, np.random.Generator], Array]] = {
    "Gaussian": gaussian,
    "AR": autoregressive,
    "t3": student,
    "outliers": with_outliers,
    "12 bit": quantised,
    "varying": varying,
    "on input": gaussian,
    "jitter": gaussian,
}
INPUT_NOISE = 0.005  # of the standard deviation of a measured input, where the kind is "on input"
JITTER = 0.005  # s, of the clock, where the kind is "jitter", and at most a quarter of a step


def jittered(time: Array, rng: np.random.Generator) -> Array:
    """Return jittered time stamps of samples that were taken evenly."""
    step = time[1] - time[0]
    late = np.clip(
        min(JITTER, 0.25 * step) * rng.standard_normal(time.size), -0.45 * step, 0.45 * step
    )
    return np.asarray(time + late)
