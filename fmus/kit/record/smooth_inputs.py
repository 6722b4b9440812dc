"""Interpolation of smooth inputs between samples: lines, or a cubic spline where a course bends.

The area under a straight line differs from that under a curved course by a twelfth of the
curvature, and so does a state that integrates the input. Simulations take inputs in straight
pieces. Two of them between two samples, which meet where their area is that of the spline, move a
state as the spline does, except for the decay of the state within the interval.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache

import numpy as np

from fmus.kit.arrays import Array

_STILL = 1e-9  # of the range, below which an input did not move
# Error with which a cubic through two neighbours on either side predicts a sample, over that of a
# straight line through one on either side, below which a course is curved. Noise makes it 1.14,
# straight lines as much by rounding; a sine of 4 samples a period, 0.67.
_CURVED = 0.8


def is_curved(time: Array, values: Array) -> bool:
    """Return whether a course bends from sample to sample, beyond noise and kinks.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    values : ndarray, shape (n,)
        Of a smooth input, any unit.
    """
    moving = np.abs(np.diff(values))[1:-2] > _STILL * np.ptp(values)
    if not moving.any():
        return False
    # the median decides, so that neither a kink nor a step does
    straight = np.median(np.abs(_prediction_errors(time, values, 1))[moving])
    cubic = np.median(np.abs(_prediction_errors(time, values, 2))[moving])
    return bool(cubic < _CURVED * straight)


def _prediction_errors(time: Array, values: Array, near: int) -> Array:
    """Return the errors (n - 4,) of predicting samples from neighbours.

    Each is predicted by the polynomial through ``near`` samples on either side of it (Lagrange).
    """
    places = [k for k in range(-near, near + 1) if k]

    def shifted(signal: Array, k: int) -> Array:
        return signal[2 + k : len(signal) - 2 + k]

    at = shifted(time, 0)
    error = -shifted(values, 0)
    for k in places:
        others = [shifted(time, j) for j in places if j != k]
        error = error + shifted(values, k) * np.prod(
            [(at - t) / (shifted(time, k) - t) for t in others], axis=0
        )
    return error


def with_knots(
    time: Array, inputs: Mapping[str, Array], linear: bool | Collection[str]
) -> tuple[Array, Mapping[str, Array], slice]:
    """Add a knot between every two samples of smooth inputs, where one of them is curved.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs : Mapping of str to ndarray, shape (n,)
    linear : bool or collection of str
        Inputs that are smooth, all or those named; others are held until the next sample.

    Returns
    -------
    time, inputs
        As given if nothing is curved, else (2n - 1,).
    samples : slice
        Positions of the given samples in them.
    """
    smooth = inputs if linear is True else linear or ()
    full = {}
    bends = {}
    for name, values in inputs.items():
        full[name] = np.broadcast_to(np.asarray(values, dtype=float), time.shape)
        if name in smooth:
            bends[name] = _bend(time.tobytes(), full[name].tobytes())
    if all(bend is None for bend in bends.values()):
        return time, inputs, slice(None)
    fed = {}
    for name, values in full.items():
        between = (values[:-1] + values[1:]) / 2.0 if name in smooth else values[:-1]
        bend = bends.get(name)
        fed[name] = _alternating(values, between if bend is None else between + bend)
    return _alternating(time, (time[:-1] + time[1:]) / 2.0), fed, slice(None, None, 2)


@lru_cache(maxsize=16)  # a fit simulates the same record hundreds of times
def _bend(time: bytes, values: bytes) -> Array | None:
    """Return the distances of the knots from straight lines (n - 1,); None if nothing bends."""
    instants = np.frombuffer(time)
    course = np.frombuffer(values)
    if not is_curved(instants, course):
        return None
    from scipy.interpolate import CubicSpline

    slopes = CubicSpline(instants, course)(instants, 1)
    return np.asarray(-np.diff(instants) * np.diff(slopes) / 6.0)


def _alternating(samples: Array, between: Array) -> Array:
    """Merge samples with the values between them."""
    result = np.empty(2 * len(samples) - 1)
    result[::2] = samples
    result[1::2] = between
    return result
