"""Noise of what a model takes as known: the clock of a record, and its inputs.

Noise of an output stays in that output, while noise of an input goes through the model and is
coloured there (Soederstroem: Errors-in-variables methods in system identification, Automatica 43,
2007), and that of the clock is an error in proportion to every slope. Laws gain by both: one that
is flat around two levels removes the noise of a square wave. So a record is also read by an even
clock, and with smooth inputs or such at levels; the fit of the model without terms says which is
right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import uniform_filter1d

from fmus.kit.arrays import Array, Mask
from orchestration.diagnosis.fitting import effective_samples
from orchestration.diagnosis.law_model import LawModel
from orchestration.diagnosis.readings import TIME
from orchestration.diagnosis.runs import Record
from orchestration.records.quality import jumps_of, noise_of, outliers_of

_APART = 4.0  # standard deviations of the noise between levels: normal samples have no such gap
_STILL = 1.5  # of the noise, up to which an input is at its levels
_WHITE = 0.8  # share of samples of noise that are independent, of the clock or about levels
_FEWEST = 6  # samples of an input that can be smoothed
_PLACE = 50  # samples over which an input is about as smooth
_NOISY = 1e-6  # of a step or of a spread: less is rounding
_JITTER = 0.3  # of a step, deviation of stamps of an even clock: within half a step they have 0.29
_STIFFNESS = 10.0 ** np.arange(-3.0, 8.0)  # weights of squared third differences
_THIRD = (1.0, -3.0, 3.0, -1.0)


def evenly(model: LawModel, record: Record) -> Record:
    """Return a record by the even clock of which its time stamps are noisy readings.

    As it is if its clock is even, or drifts, or leaves out samples.
    """
    count = np.arange(len(record.time))
    step, first = np.polyfit(count, record.time, 1)
    late = record.time - first - step * count
    is_noise = _NOISY * step < late.std() < _JITTER * step
    if not is_noise or effective_samples(late) < _WHITE * len(late):
        return record
    even = np.ascontiguousarray(record.time[0] + step * count)
    return model.simulated(replace(record, time=even, denoised=(*record.denoised, TIME)))


def with_quiet_inputs(model: LawModel, record: Record) -> Record:
    """Return a record with inputs without noise: at levels, or smooth between jumps.

    As it is if no input has noise.
    """
    inputs = record.inputs.copy()
    names = []
    for j, variable in enumerate(model.inputs):
        values = inputs[:, j]
        noise = noise_of(values)
        if variable in model.recorded and noise > _NOISY * float(np.std(values)):
            levels = _levels(values, noise)
            inputs[:, j] = _smooth(values, noise) if levels is None else levels
            names.append(variable.name)
    if not names:
        return record
    return model.simulated(replace(record, inputs=inputs, denoised=(*record.denoised, *names)))


def without_outliers(model: LawModel, record: Record, errors: Array) -> Record:
    """Return a record with gaps for outliers, by the errors (n, ny) that a model leaves.

    See `outliers_of`.
    """
    outputs = record.outputs.copy()
    for error, column in zip(errors.T, outputs.T, strict=True):
        column[outliers_of(error, record.inputs)] = np.nan
    lost = np.isfinite(record.outputs) & ~np.isfinite(outputs)
    # a name for each of its values
    names = [model.outputs[j].name for j in np.nonzero(lost)[1]]
    if not names:
        return record
    return replace(record, outputs=outputs, denoised=(*record.denoised, *names))


def _levels(values: Array, noise: float) -> Array | None:
    """Return the levels of samples (n,) with noise; None if they move between or about levels."""
    order = np.argsort(values)
    places = np.zeros(len(values), dtype=int)
    places[order[1:]] = np.cumsum(np.diff(values[order]) > _APART * noise)
    levels = np.bincount(places, values) / np.bincount(places)
    moved = values - levels[places]
    is_still = np.std(moved) < _STILL * noise
    # two levels taken for one leave a slow error, which is worse than noise
    return levels[places] if is_still and effective_samples(moved) > _WHITE * len(moved) else None


def _smooth(values: Array, noise: float) -> Array:
    """Return samples (n,) without noise, by the smallest squared third differences beside jumps.

    How stiff they are is chosen from place to place, by the smallest unbiased estimate of the error
    (Stein: Estimation of the mean of a multivariate normal distribution, Annals of Statistics 9,
    1981); the variance of the noise is what the best leaves in all by generalised cross-validation
    (Craven and Wahba: Smoothing noisy data with spline functions, Numerische Mathematik 31, 1979),
    and traces are estimated by a random probe.
    """
    count = len(values)
    if count < _FEWEST:
        return values
    penalty = _penalty(count, jumps_of(values, noise))
    probe = np.random.default_rng(0).choice([-1.0, 1.0], count)
    tried = np.empty((len(_STIFFNESS), count))
    free = np.empty(len(_STIFFNESS))
    for k, stiffness in enumerate(_STIFFNESS):
        matrix = stiffness * penalty
        matrix[-1] += 1.0
        tried[k], through = solveh_banded(matrix, np.column_stack([values, probe])).T
        free[k] = max(1.0 - float(probe @ through) / count, 1.0 / count)
    squares = (values - tried) ** 2
    means = squares.mean(axis=1)
    best = np.argmin(means / free**2)
    errors = uniform_filter1d(squares, _PLACE, axis=1, mode="nearest")
    errors -= 2.0 * means[best] / free[best] * free[:, np.newaxis]
    return np.asarray(np.take_along_axis(tried, errors.argmin(axis=0)[np.newaxis], axis=0)[0])


def _penalty(count: int, jumps: Mask) -> Array:
    """Return the diagonals (4, n) of the squared third differences, of which none is over a jump.

    From above, as `scipy.linalg.solveh_banded` takes them.
    """
    last = count - len(_THIRD) + 1
    free = ~(jumps[:-2] | jumps[1:-1] | jumps[2:])
    diagonals = np.zeros((len(_THIRD), count))
    for i, one in enumerate(_THIRD):
        for k, other in enumerate(_THIRD[i:]):
            diagonals[-1 - k, i + k : i + k + last] += one * other * free
    return diagonals
