"""Denoising of inputs: white noise that was measured, but that the plant did not see.

A correction may undo what such noise does to a model, by smoothing it, and would be taken for what
the model lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fmus.kit.arrays import Array
from orchestration.discrepancy.conclude import Diagnosis
from orchestration.discrepancy.data import Dataset, IntersampleCourse, classify_course
from orchestration.discrepancy.laws.base import search_of
from orchestration.discrepancy.selection import noisy_inputs, unfollowed_noise

_STEP = 5.0  # deviations of a difference, beyond which it is a step
_ALONE = 3.0  # times the difference next to it, which a step exceeds
_FEWEST = 5  # samples, which a spline needs
_SURE = 3.0  # standard errors of a deviation
_SAME = 5.0  # standard errors of a difference, up to which two levels are one


def noise_of_inputs(diagnosis: Diagnosis) -> dict[str, float]:
    """Return the standard deviation of input noise that the outputs do not follow, by input, SI."""
    search = search_of(diagnosis)
    noise = noisy_inputs(search.base, search.data)
    return unfollowed_noise(search, diagnosis.selection.best, noise) if noise else {}


def with_denoised_inputs(
    diagnosis: Diagnosis,
    noise: Mapping[str, float],
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Return a diagnosis with its models fitted to inputs without noise, and otherwise the same.

    Parameters
    ----------
    diagnosis : Diagnosis
    noise : Mapping of str to float
        Of `noise_of_inputs`.
    progress : callable
        Told what is being done.

    Raises
    ------
    UserError
        If a model cannot be simulated with these inputs.
    """
    estimation = _denoised(diagnosis.estimation, noise)
    validation = diagnosis.validation
    selection = diagnosis.selection
    search = replace(search_of(diagnosis, progress), data=estimation)
    steps = [replace(step, chosen=search.refit(step.chosen)) for step in selection.steps]
    whole = replace(search, data=_denoised(diagnosis.usable, noise))
    return replace(
        diagnosis,
        estimation=estimation,
        validation=replace(validation, data=_denoised(validation.data, noise)),
        selection=replace(selection, base=search.refit(selection.base), steps=steps),
        final=whole.refit(diagnosis.final),
    )


def _denoised(data: Dataset, noise: Mapping[str, float]) -> Dataset:
    """Return data with the likeliest course of each noisy input, of every run by itself."""
    inputs = dict(data.inputs)
    for name, deviation in noise.items():
        values = np.array(inputs[name], dtype=float)
        for run in data.runs:
            values[run.samples] = smooth(data.time[run.samples], values[run.samples], deviation)
        inputs[name] = values
    return replace(data, inputs=inputs)


def smooth(time: Array, values: Array, deviation: float) -> Array:
    """Return the levels between steps, or else the smooth course, behind noisy values.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
    deviation : float
        Standard deviation of white noise on the values.
    """
    rise = np.abs(np.diff(values))
    large = rise > _STEP * np.sqrt(2.0) * deviation
    if classify_course(values) is not IntersampleCourse.STEPS:
        # of a ramp and of a fast course the neighbours rise as much
        beside = np.maximum(np.append(0.0, rise[:-1]), np.append(rise[1:], 0.0))
        large &= rise > _ALONE * beside
    parts = np.split(np.arange(len(values)), np.flatnonzero(large) + 1)
    levels = _levels([values[part] for part in parts], deviation)
    result = values.copy()
    for part, level in zip(parts, levels, strict=True):
        if _is_level(values[part], level, deviation):
            result[part] = level
        else:
            result[part] = _spline(time[part], values[part])
    return result


def _levels(parts: Sequence[Array], deviation: float) -> Array:
    """Return the mean of every part, one for all parts that differ by noise alone."""
    means = np.array([part.mean() for part in parts])
    counts = np.array([len(part) for part in parts])
    order = np.argsort(means)
    inverse_counts = 1.0 / counts[order][1:] + 1.0 / counts[order][:-1]
    far = np.diff(means[order]) > _SAME * deviation * np.sqrt(inverse_counts)
    group = np.empty(len(parts), dtype=int)
    group[order] = np.append(0, np.cumsum(far))
    return np.asarray((np.bincount(group, means * counts) / np.bincount(group, counts))[group])


def _is_level(values: Array, level: float, deviation: float) -> bool:
    """Return whether noise explains the distance of values (n,) from a level."""
    rms = float(np.sqrt(np.mean((values - level) ** 2)))
    return len(values) < _FEWEST or rms <= deviation * (1.0 + _SURE / np.sqrt(2.0 * len(values)))


def _spline(time: Array, values: Array) -> Array:
    """Return a spline, smoothed by cross-validation (Craven, Wahba, Numer. Math. 31, 1978)."""
    from scipy.interpolate import make_smoothing_spline

    return np.asarray(make_smoothing_spline(time - time[0], values)(time - time[0]))
