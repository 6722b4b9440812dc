"""Interpolation of smooth inputs between samples: linear, or by a cubic spline if they are curved.

Simulations interpolate inputs linearly. The area under a straight line differs from that under a
curved signal by a twelfth of the curvature, and a state that integrates the input differs as much.
Therefore a knot is added between two samples so that the area under the two straight lines is that
under the spline. A state then changes as with the spline, except for its decay within the interval.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache

import numpy as np

from fmus.kit.arrays import Array

_STILL = 1e-9  # change relative to the range, below which an input is constant
# A signal is curved if the prediction error of a cubic through two neighbours on either side is
# less than this part of the error of a straight line through one neighbour on either side. The
# ratio is 1.14 for noise and, by rounding, for straight lines; 0.67 for a sine of 4 samples a turn.
_CURVED = 0.8


def is_curved(time: Array, values: Array) -> bool:
    """Return whether a signal is curved from sample to sample, more than by noise and kinks.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    values : ndarray, shape (n,)
        Smooth input, any unit.

    Returns
    -------
    bool
    """
    moving = np.abs(np.diff(values))[1:-2] > _STILL * np.ptp(values)
    if not moving.any():
        return False
    # the median is robust against single kinks and steps
    straight = np.median(np.abs(_prediction_errors(time, values, 1))[moving])
    cubic = np.median(np.abs(_prediction_errors(time, values, 2))[moving])
    return bool(cubic < _CURVED * straight)


def _prediction_errors(time: Array, values: Array, near: int) -> Array:
    """Return the errors (n - 4,) of predicting samples from neighbours.

    The prediction is Lagrange's polynomial through ``near`` samples on either side.
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
    """Add a knot between every two samples if a smooth input is curved.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    inputs : Mapping of str to ndarray, shape (n,)
        Any units.
    linear : bool or collection of str
        Inputs that are smooth: all, none, or some by name. The others are constant from sample to
        sample.

    Returns
    -------
    time : ndarray, shape (n,) or (2n - 1,)
        The argument if no input is curved.
    inputs : Mapping of str to ndarray, shape (n,) or (2n - 1,)
        The argument if no input is curved.
    samples : slice
        Positions of the samples in the result.
    """
    smooth = inputs if linear is True else linear or ()
    full = {}  # inputs as arrays
    offsets = {}  # of knots from straight lines, for smooth inputs
    for name, values in inputs.items():
        full[name] = np.broadcast_to(np.asarray(values, dtype=float), time.shape)
        if name in smooth:
            offsets[name] = _knot_offsets(time.tobytes(), full[name].tobytes())
    if all(offset is None for offset in offsets.values()):
        return time, inputs, slice(None)
    refined = {}
    for name, values in full.items():
        between = (values[:-1] + values[1:]) / 2.0 if name in smooth else values[:-1]
        offset = offsets.get(name)
        refined[name] = _interleaved(values, between if offset is None else between + offset)
    return _interleaved(time, (time[:-1] + time[1:]) / 2.0), refined, slice(None, None, 2)


@lru_cache(maxsize=16)  # a fit simulates the same record hundreds of times
def _knot_offsets(time: bytes, values: bytes) -> Array | None:
    """Return the distances (n - 1,) of knots from straight lines; None for a signal not curved.

    Over an interval h the area under a cubic with end slopes p and q differs from that under the
    chord by h^2 (p - q) / 12, and a knot in its middle adds h / 2 times its distance.
    """
    instants = np.frombuffer(time)
    signal = np.frombuffer(values)
    if not is_curved(instants, signal):
        return None
    from scipy.interpolate import CubicSpline

    slopes = CubicSpline(instants, signal)(instants, 1)
    return np.asarray(-np.diff(instants) * np.diff(slopes) / 6.0)


def _interleaved(samples: Array, between: Array) -> Array:
    """Merge samples with the values between them, in turn."""
    result = np.empty(2 * len(samples) - 1)
    result[::2] = samples
    result[1::2] = between
    return result
