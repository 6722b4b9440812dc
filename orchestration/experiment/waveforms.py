"""Test signals on a time vector: those of the thesis, and the usual ones of identification.

Every function returns an array of the shape of `time` (s). Amplitudes are in the unit of the input
(A, N). A signal that steps at t has its new value at t.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import UserError
from fmus.kit.arrays import Array

Seed = int | Sequence[int]

# Share of a period by which a sample may be early and still has the value after a step.
_ROUNDING = 1e-9


def square_wave(time: ArrayLike, amplitude: float, frequency: float, offset: float = 0.0) -> Array:
    """Return a square wave about `offset`, high in the first half of every period from t = 0.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    amplitude, offset : float
        In the unit of the input.
    frequency : float
        Hz, above 0.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If the frequency is not above 0.
    """
    _require_positive("frequency", frequency, "Hz")
    half_periods = np.floor(2 * frequency * _vector(time) + _ROUNDING)
    return offset + amplitude * np.where(half_periods % 2 == 0, 1.0, -1.0)


def force_staircase(
    time: ArrayLike,
    period: float,
    bias: float = 0.5,
    increment: float = 0.25,
    maximum: float = 2.75,
) -> Array:
    """Return the load of figs. 3-6 to 3-9: square waves of growing height above a bias.

    The force is ``bias + (k + 1) increment`` in the first half of period k = 0, 1, ... (from t = 0)
    and the bias in the second half, before t = 0, and after the period that reaches `maximum`.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    period : float
        Duration of one loading and unloading in s, above 0; the thesis does not print its value.
    bias, maximum : float
        N.
    increment : float
        N, above 0.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If period or increment is not above 0, or the maximum lies below the first level.
    """
    _require_positive("period", period, "s")
    _require_positive("increment", increment, "N")
    levels = int(np.floor((maximum - bias) / increment + _ROUNDING))
    if levels < 1:
        raise UserError(
            f"maximum = {maximum} N: must be at least bias + increment = {bias + increment} N"
        )
    half_periods = np.floor(2 * _vector(time) / period + _ROUNDING)
    periods = half_periods // 2
    is_loaded = (half_periods % 2 == 0) & (periods >= 0) & (periods < levels)
    return bias + np.where(is_loaded, (periods + 1) * increment, 0.0)


def multilevel(
    time: ArrayLike, levels: Sequence[float], dwell: tuple[float, float], seed: Seed
) -> Array:
    """Return a random sequence of levels, each for a random time and never twice in a row.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds, increasing.
    levels : sequence of float
        At least two different values, in the unit of the input.
    dwell : tuple of float
        Shortest and longest duration of a level in s; durations are uniformly distributed.
    seed : int or sequence of int
        Seed of the random generator.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If there are fewer than two levels, or ``0 < shortest <= longest`` does not hold.
    """
    choices = np.unique(levels)
    shortest, longest = dwell
    if choices.size < 2:
        raise UserError(f"levels = {list(levels)}: at least two different values are needed")
    if not 0 < shortest <= longest:
        raise UserError(f"dwell = {dwell} s: must satisfy 0 < shortest <= longest")
    t = _vector(time)
    generator = np.random.default_rng(seed)
    count = int(np.ceil((t[-1] - t[0]) / shortest)) + 1
    switches = t[0] + np.cumsum(generator.uniform(shortest, longest, count))
    # A cyclic shift by 1 .. size-1 reaches every other level with the same probability.
    shifts = generator.integers(1, choices.size, count)
    first = generator.integers(choices.size)
    places = (first + np.concatenate([[0], np.cumsum(shifts)])) % choices.size
    return choices[places[np.searchsorted(switches, t, side="right")]]


def steps(
    time: ArrayLike, times: Sequence[float], values: Sequence[float], initial: float = 0.0
) -> Array:
    """Return `initial` before ``times[0]`` and ``values[k]`` from ``times[k]`` on.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    times : sequence of float
        Seconds, increasing.
    values : sequence of float
        As many as `times`, in the unit of the input.
    initial : float
        In the unit of the input.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If `times` and `values` differ in length or `times` does not increase.
    """
    switches = np.asarray(times, dtype=float)
    if switches.size != len(values) or np.any(np.diff(switches) <= 0):
        raise UserError(
            f"steps needs increasing times and as many values: got {list(times)} s and"
            f" {list(values)}"
        )
    levels = np.concatenate([[initial], np.asarray(values, dtype=float)])
    return levels[np.searchsorted(switches, _vector(time), side="right")]


def approach(value: float, target: float, largest: float) -> float:
    """Return a value that was moved towards a target by no more than a largest change."""
    if abs(target - value) <= largest:
        return target
    return value + math.copysign(largest, target - value)


def slewed(time: ArrayLike, target: ArrayLike, slew: float) -> Array:
    """Return a signal that follows another one, no faster than by a slew rate.

    From a step of the target on it is a ramp that begins at the old value.

    Parameters
    ----------
    time, target : array_like, shape (n,)
        Seconds, increasing; and the signal to follow, from whose first value it starts.
    slew : float
        Largest change in the unit of the target per second, above 0.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If the slew rate is not above 0.
    """
    _require_positive("slew", slew, "per second")
    followed = np.array(target, dtype=float)
    wanted = followed.tolist()
    for k, step in enumerate(np.diff(_vector(time)).tolist()):
        followed[k + 1] = approach(followed[k], wanted[k], slew * step)
    return followed


def ramps(time: ArrayLike, times: Sequence[float], values: Sequence[float]) -> Array:
    """Return the linear interpolation of points, constant before the first and after the last.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    times : sequence of float
        Seconds, increasing, at least two.
    values : sequence of float
        As many as `times`, in the unit of the input.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If there are fewer than two points, `times` and `values` differ in length or `times` does
        not increase.
    """
    if len(times) < 2 or len(times) != len(values) or np.any(np.diff(times) <= 0):
        raise UserError(
            f"ramps need two or more increasing times and as many values: {list(times)} s,"
            f" {list(values)}"
        )
    return np.interp(_vector(time), times, values)


def sine(time: ArrayLike, amplitude: float, frequency: float, offset: float = 0.0) -> Array:
    """Return ``offset + amplitude sin(2 pi frequency t)``.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    amplitude, offset : float
        In the unit of the input.
    frequency : float
        Hz, above 0.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If the frequency is not above 0.
    """
    _require_positive("frequency", frequency, "Hz")
    return offset + amplitude * np.sin(2 * np.pi * frequency * _vector(time))


def chirp(
    time: ArrayLike,
    amplitude: float,
    start_frequency: float,
    stop_frequency: float,
    duration: float,
    offset: float = 0.0,
) -> Array:
    """Return a sine whose frequency changes linearly from `start_frequency` to `stop_frequency`.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    amplitude, offset : float
        In the unit of the input.
    start_frequency, stop_frequency : float
        Hz, at t = 0 and at t = `duration`.
    duration : float
        Seconds, above 0.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If the duration is not above 0.
    """
    _require_positive("duration", duration, "s")
    t = _vector(time)
    cycles = start_frequency * t + (stop_frequency - start_frequency) * t**2 / (2 * duration)
    return offset + amplitude * np.sin(2 * np.pi * cycles)


def multisine(
    time: ArrayLike, frequencies: Sequence[float], rms: float, seed: Seed, offset: float = 0.0
) -> Array:
    """Return a sum of sines of equal amplitude and random phases.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    frequencies : sequence of float
        Hz, different from each other and above 0.
    rms : float
        Root mean square over a common period, without the offset, in the unit of the input.
    seed : int or sequence of int
        Seed of the random phases.
    offset : float
        In the unit of the input.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    UserError
        If there are no frequencies, they repeat or are not above 0, or the rms is negative.
    """
    tones = np.asarray(frequencies, dtype=float)
    if tones.size == 0 or np.unique(tones).size != tones.size or np.any(tones <= 0):
        raise UserError(
            f"frequencies = {list(frequencies)} Hz: must be different from each other and above 0"
        )
    if not rms >= 0:
        raise UserError(f"rms = {rms:g}: must be 0 or more")
    t = _vector(time)
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, tones.size)
    total = np.zeros_like(t)
    for tone, phase in zip(tones, phases, strict=True):
        total += np.sin(2 * np.pi * tone * t + phase)
    return offset + rms * np.sqrt(2 / tones.size) * total


def _vector(time: ArrayLike) -> Array:
    return np.asarray(time, dtype=float)


def _require_positive(name: str, value: float, unit: str) -> None:
    if not value > 0:
        raise UserError(f"{name} = {value} {unit}: must be above 0")
