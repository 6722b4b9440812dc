"""Inputs freed of white noise that was measured, but that the plant did not see.

A correction may undo what such noise does to a model, by smoothing it, and would be taken for what the model lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_smoothing_spline

from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.intersample import Course, course
from orchestration.discrepancy.diagnosis import Diagnosis
from orchestration.discrepancy.laws.base import search_of, usable
from orchestration.discrepancy.selection.input_noise import noisy_inputs, not_followed

Array = NDArray[np.float64]
_STEP = 5.0  # deviations of a difference, beyond which it is a step
_ALONE = 3.0  # times what is next to it, which a step is
_FEWEST = 5  # samples, which a spline needs
_SURE = 3.0  # standard errors of a deviation
_SAME = 5.0  # standard errors of a difference, up to which two levels are one


def noise_of_inputs(diagnosis: Diagnosis) -> dict[str, float]:
    """Inputs with noise that the outputs of a diagnosed model do not follow, and its standard deviation, SI."""
    search = search_of(diagnosis)
    noise = noisy_inputs(search.base, search.data)
    return not_followed(search, diagnosis.selection.best, noise) if noise else {}


def calmed(
    diagnosis: Diagnosis,
    noise: Mapping[str, float],
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Return a diagnosis of which the models are fitted to inputs without noise; everything else stays as it is.

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
    estimation, validation = _calm(diagnosis.estimation, noise), diagnosis.validation
    search, before = replace(search_of(diagnosis, progress), data=estimation), diagnosis.selection
    steps = [replace(step, chosen=search.refit(step.chosen)) for step in before.steps]
    whole = replace(search, data=_calm(usable(diagnosis), noise))
    return replace(
        diagnosis,
        estimation=estimation,
        validation=replace(validation, data=_calm(validation.data, noise)),
        selection=replace(before, base=search.refit(before.base), steps=steps),
        final=whole.refit(diagnosis.final),
    )


def _calm(data: Dataset, noise: Mapping[str, float]) -> Dataset:
    """The same with the likeliest calm course of each noisy input, of every run by itself."""
    inputs = dict(data.inputs)
    for name, deviation in noise.items():
        values = np.array(inputs[name], dtype=float)
        for run in data.runs:
            values[run.samples] = smooth(data.time[run.samples], values[run.samples], deviation)
        inputs[name] = values
    return replace(data, inputs=inputs)


def smooth(time: Array, values: Array, deviation: float) -> Array:
    """Take values (n,) to be levels between steps, or else a smooth course.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
    deviation : float
        Standard deviation of white noise on the values.
    """
    rise = np.abs(np.diff(values))
    large = rise > _STEP * np.sqrt(2.0) * deviation
    if course(values) is not Course.STEPS:
        # of a ramp and of a fast course the neighbours rise as much
        beside = np.maximum(np.append(0.0, rise[:-1]), np.append(rise[1:], 0.0))
        large &= rise > _ALONE * beside
    parts = np.split(np.arange(len(values)), np.flatnonzero(large) + 1)
    levels = _levels([values[part] for part in parts], deviation)
    result = values.copy()
    for part, level in zip(parts, levels, strict=True):
        result[part] = (
            level
            if _is_level(values[part], level, deviation)
            else _course(time[part], values[part])
        )
    return result


def _levels(parts: Sequence[Array], deviation: float) -> Array:
    """Means of parts, those together that noise alone tells apart."""
    means, counts = (
        np.array([part.mean() for part in parts]),
        np.array([len(part) for part in parts]),
    )
    order = np.argsort(means)
    far = np.diff(means[order]) > _SAME * deviation * np.sqrt(
        1.0 / counts[order][1:] + 1.0 / counts[order][:-1]
    )
    group = np.empty(len(parts), dtype=int)
    group[order] = np.append(0, np.cumsum(far))
    return np.asarray((np.bincount(group, means * counts) / np.bincount(group, counts))[group])


def _is_level(values: Array, level: float, deviation: float) -> bool:
    """Whether noise explains how far values (n,) are from a level."""
    rms = float(np.sqrt(np.mean((values - level) ** 2)))
    return len(values) < _FEWEST or rms <= deviation * (1.0 + _SURE / np.sqrt(2.0 * len(values)))


def _course(time: Array, values: Array) -> Array:
    """A spline, as smooth as cross-validation asks for (Craven, Wahba, Numer. Math. 31, 1978)."""
    return np.asarray(make_smoothing_spline(time - time[0], values)(time - time[0]))
