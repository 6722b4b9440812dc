"""What is left, looked at before it is whitened away: lines in the spectrum, jumps, and what it goes along with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, median_filter
from scipy.stats import f, norm

Array = NDArray[np.float64]
_ALARM = 1e-9  # probability of seeing any of it in noise; a hum or a slip that matters is far beyond
_END = 4
_SHARE = 0.05  # of the power of what is left, below which a line is not what is wrong
_FOLLOWED = 0.1  # of the line that the output has, below which another there is what the model does not quite follow
_LOBE = 2  # frequencies on either side of a line into which the window spreads it
_FEW = 10  # samples with steps of an input that it takes to judge them
_AFTER = 4  # samples after a step of an input in which no jump is seen
_NEIGHBOURS = 61  # frequencies that tell how large the spectrum is about one of them


@dataclass(frozen=True)
class Line:
    """A periodic part.

    Attributes
    ----------
    frequency : float
        Hz.
    amplitude : float
        In the unit of the residual.
    p_value : float
        Of so high a line anywhere in the spectrum of noise.
    """

    frequency: float
    amplitude: float
    p_value: float


@dataclass(frozen=True)
class Jump:
    """A sudden change.

    Attributes
    ----------
    time : float
        Seconds.
    size : float
        In the unit of the residual.
    p_value : float
        Of so large a change anywhere in noise.
    """

    time: float
    size: float
    p_value: float


def lines(residual: Array, step: float, output: Array | None = None) -> list[Line]:
    """Frequencies at which a residual has far more power than about them.

    The periodogram of noise is exponentially distributed about its local level, which a running median tells once the
    noise is roughly white. Under a periodic input whatever a model gets wrong has lines, too: what is little beside the
    line that the output has there is no disturbance.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        Equally spaced, without gaps.
    step : float
        Seconds between samples.
    output : ndarray, shape (n,), optional
        As it was measured.

    Returns
    -------
    list of Line
        The strongest first.
    """
    n = len(residual)
    if n < 4 * _NEIGHBOURS:
        return []
    centred = residual - residual.mean()
    if not centred.any():
        return []
    # one real pole flattens red noise and cannot swallow a line
    pole = float(centred[1:] @ centred[:-1] / (centred @ centred))
    power = _power(centred, pole)
    level = median_filter(power, _NEIGHBOURS, mode="reflect") / np.log(2.0)
    ratio = power / np.where(level > 0.0, level, np.inf)
    p = np.minimum(1.0, len(power) * np.exp(-ratio))
    frequency = np.fft.rfftfreq(n - 1, step)[_END:-_END]
    passed = np.abs(1.0 - pole * np.exp(-2j * np.pi * frequency * step))
    amplitude = 2.0 * np.sqrt(power) / np.hanning(n - 1).sum() / passed
    least = np.sqrt(2.0 * _SHARE * np.mean(centred**2))
    followed = np.zeros_like(power) if output is None else _FOLLOWED**2 * _power(output - output.mean(), pole)
    matters = (p < _ALARM) & (amplitude > least) & (power > maximum_filter(followed, 2 * _LOBE + 1))
    peaks = [k for k in np.flatnonzero(matters) if power[k] == power[max(0, k - 3) : k + 4].max()]
    found = [Line(float(frequency[k]), float(amplitude[k]), float(p[k])) for k in peaks]
    return sorted(found, key=lambda line: -line.amplitude)


def _power(values: Array, pole: float) -> Array:
    """Periodogram, flattened by a pole, at the frequencies that are judged."""
    flat = values[1:] - pole * values[:-1]
    # at either end the window folds the spectrum onto itself, and what is left is not exponentially distributed
    return np.asarray(np.abs(np.fft.rfft(flat * np.hanning(len(flat))))[_END:-_END] ** 2)


def jumps(residual: Array, time: Array, inputs: Mapping[str, Array]) -> list[Jump]:
    """Steps in a residual where no input steps.

    A sample is held against the one before it, unless a gap lies between; in noise their difference scatters as its own
    median tells.

    Parameters
    ----------
    residual, time : ndarray, shape (n,)
        Where something was measured.
    inputs : Mapping of str to ndarray, shape (n,)

    Returns
    -------
    list of Jump
        In order of time.
    """
    difference, apart = np.diff(residual), np.diff(time)
    near = apart < 1.5 * np.median(apart)
    spread = float(np.median(np.abs(difference[near] - np.median(difference[near])))) / float(norm.ppf(0.75))
    if spread == 0.0:
        return []
    # a record may show an input a sample early, and what a model makes of a step is least right just after it
    moved = np.convolve(steps(inputs, len(time))[1:], np.ones(_AFTER + 2), "full")[1 : len(difference) + 1] > 0.0
    p = np.minimum(1.0, 2.0 * len(difference) * norm.sf(np.abs(difference) / spread))
    return [
        Jump(float(time[k + 1]), float(difference[k]), float(p[k]))
        for k in np.flatnonzero((p < _ALARM) & near & ~moved)
    ]


def startled(innovation: Array, at: NDArray[np.intp], inputs: Mapping[str, Array]) -> float:
    """Return how probable it is in noise that innovations are so much larger where an input steps than elsewhere.

    Parameters
    ----------
    innovation : ndarray, shape (k,)
    at : ndarray of int, shape (k,)
        The samples that they belong to.
    inputs : Mapping of str to ndarray, shape (n,)

    Returns
    -------
    float
        1 where there are too few steps to tell.
    """
    there = steps(inputs, int(at.max(initial=-1)) + 1)[at]
    if min(there.sum(), (~there).sum()) < _FEW:
        return 1.0
    ratio = float(np.mean(innovation[there] ** 2) / np.mean(innovation[~there] ** 2))
    return float(f.sf(ratio, there.sum(), (~there).sum()))


def steps(inputs: Mapping[str, Array], count: int) -> NDArray[np.bool_]:
    """Where any input differs from the sample before by more than a hundredth of its range; `count` without inputs."""
    moved = [np.abs(np.diff(u, prepend=u[:1])) > 0.01 * np.ptp(u) for u in inputs.values() if np.ptp(u) > 0.0]
    return np.any(moved, axis=0) if moved else np.zeros(count, dtype=bool)
