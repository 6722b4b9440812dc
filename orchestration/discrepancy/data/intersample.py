"""Classification of inputs by their own course: held between samples, or smooth.

Pintelon and Schoukens: System Identification, section 2.6. An output stage that holds its value
moves in steps with rest between them. What a physical quantity does of itself is smooth; then a
straight line from sample to sample is near to it, and a staircase is half a sample late.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from fmus.kit.arrays import Array
from orchestration.identify.noise import noise_std

# of differences: noise shows in all, a smooth course less and less, steps in few of the first
_ORDERS = range(1, 7)
_IN_NOISE = 6.0  # deviations, beyond which no change of noise alone is seen
_IN_GRID = 3.0  # steps of the recorder, likewise
# of the spread, beyond which every sample is another: nothing is seen of how it got there
_LOST = 0.25
_LEVELS = 20  # different values above which equal steps are a recorder's and not a stimulus'
# Correlation of successive changes. cos(2 pi f / f_s) for a sine of frequency f sampled at f_s:
# above the first, a smooth course has five samples a period. Steps with rest between them have
# none, and where every sample steps anew it is negative.
_SMOOTH = 0.3
_SUDDEN = 0.15
_RESTING = 0.25  # share of the samples that a course of steps rests


class IntersampleCourse(StrEnum):
    """IntersampleCourse of an input from sample to sample."""

    STILL = "still"
    STEPS = "steps"
    SMOOTH = "smooth"
    UNCLEAR = "unclear"


def classify_course(values: Array) -> IntersampleCourse:
    """Classify how an input goes from sample to sample.

    It is unclear where every sample has a value of its own.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Any unit.
    """
    changes = np.diff(values)
    if not changes.any():
        return IntersampleCourse.STILL
    if changes.size < 2:  # one change goes any way
        return IntersampleCourse.UNCLEAR
    noise = white_noise(values)
    grid = _resolution(values)
    if noise > _LOST * np.std(values):
        return IntersampleCourse.UNCLEAR
    largest = float(np.abs(changes).max())
    if largest <= max(_IN_NOISE * np.sqrt(2.0) * noise, _IN_GRID * grid):
        return IntersampleCourse.SMOOTH
    variance = noise**2 + grid**2 / 12.0
    power = float(np.mean(changes**2)) - 2.0 * variance
    together = float(np.mean(changes[1:] * changes[:-1])) + variance
    if power <= 0.0:
        return IntersampleCourse.UNCLEAR
    resting = float(np.mean(np.abs(changes) <= max(3.0 * np.sqrt(2.0) * noise, 0.01 * largest)))
    if together > _SMOOTH * power:
        return IntersampleCourse.SMOOTH
    if together < _SUDDEN * power and resting > _RESTING:
        return IntersampleCourse.STEPS
    return IntersampleCourse.UNCLEAR


def white_noise(values: Array) -> float:
    """Estimate the standard deviation of white noise on a signal that is smooth, or moves in steps.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Any unit.

    Returns
    -------
    float
        In the same unit.
    """
    return min(noise_std(values, order) for order in _ORDERS)


def _resolution(values: Array) -> float:
    """Return the least step between different values, 0 for a stimulus of few levels."""
    levels = np.unique(values)
    return float(np.diff(levels).min()) if len(levels) > _LEVELS else 0.0
