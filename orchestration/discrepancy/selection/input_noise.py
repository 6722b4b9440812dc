"""White noise on a measured input that the plant does not see (errors in variables)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solveh_banded

from fmus.kit import Component, UserError
from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates import FittedCandidate, encompassing
from orchestration.discrepancy.data import Dataset, IntersampleCourse, classify_course, white_noise
from orchestration.discrepancy.selection.search import Search

_LEAST = 2e-4  # of the range, below which an input is as good as known
# deviations of the noise, beyond which a second difference is a step or a bend
_BENDS = 6.0 * np.sqrt(6.0)
# Third differences of white noise change their sign with probability 1/2 + asin(3/4) / pi = 0.77,
# those of a smooth course hardly ever. A quarter of the stretches is enough, because a chirp is
# smooth enough in some of them only.
_ALTERNATING = 0.68
_STRETCH = 50
# fall of minus twice the log-likelihood with which the outputs follow: very strong evidence
_FOLLOWED = 10.0
REPLICAS = 8  # realisations of the noise
_STEP = 5.0  # deviations of a difference, beyond which it is a step
_ALONE = 3.0  # times the difference next to it, which a step exceeds
_FEWEST = 5  # samples, which smoothing needs
_SURE = 3.0  # standard errors of a deviation
_SAME = 5.0  # standard errors of a difference, up to which two levels are one
# Of the penalty on curvature: courses that bend within one sample to 300 samples, three a decade
# of the weight, between which the risk hardly changes.
_WEIGHTS = np.geomspace(1e-2, 1e10, 37)


def input_noise_std(values: Array) -> float:
    """Return the standard deviation of white noise on an input (n,); zero where none is seen."""
    if classify_course(values) not in (IntersampleCourse.STEPS, IntersampleCourse.SMOOTH):
        return 0.0
    noise = white_noise(values)
    if noise <= _LEAST * np.ptp(values) or not _alternates_as_noise(values, noise):
        return 0.0
    return noise


def _alternates_as_noise(values: Array, noise: float) -> bool:
    """Return whether third differences of an input change their sign as often as those of noise.

    Parameters
    ----------
    values : ndarray, shape (n,)
    noise : float
        Standard deviation that the noise would have; where an input steps or bends by more than
        that makes, its differences do not count.
    """
    is_smooth = np.abs(np.diff(values, 2)) < _BENDS * noise
    sign = np.sign(np.diff(values, 3))[is_smooth[:-1] & is_smooth[1:]]
    alternates = sign[1:] * sign[:-1] < 0.0
    whole_stretches = len(alternates) // _STRETCH * _STRETCH
    stretches = alternates[:whole_stretches].reshape(-1, _STRETCH)
    if len(stretches) < 2:
        return False
    return bool(np.quantile(stretches.mean(axis=1), 0.75) > _ALTERNATING)


def noisy_inputs(cls: type[Component], data: Dataset) -> dict[str, float]:
    """Return inputs with white noise on them, and its standard deviation, SI."""
    real = [v.name for v in cls.layout.inputs if v.type == "real"]
    deviations = {name: input_noise_std(data.inputs[name]) for name in real if name in data.inputs}
    return {name: deviation for name, deviation in deviations.items() if deviation > 0.0}


def unfollowed_noise(
    search: Search, model: FittedCandidate, noise: Mapping[str, float]
) -> dict[str, float]:
    """Return the noise that the outputs do not surely follow: it was measured, but was not there.

    Parameters
    ----------
    search : Search
    model : FittedCandidate
        The base model, fitted.
    noise : Mapping of str to float
        By `noisy_inputs`.
    """
    try:
        others = [
            simulated(search, model, denoised(search.data, {name: deviation}))
            for name, deviation in noise.items()
        ]
        amounts = encompassing(model, others)
    except UserError:
        return dict(noise)
    return {
        name: deviation
        for (name, deviation), amount in zip(noise.items(), amounts, strict=True)
        if not amount.margin < -_FOLLOWED
    }


def denoised(data: Dataset, noise: Mapping[str, float]) -> Dataset:
    """Return data with the likeliest course of each noisy input, of every run by itself.

    Parameters
    ----------
    data : Dataset
    noise : Mapping of str to float
        Standard deviation of white noise, by input, SI.
    """
    inputs = dict(data.inputs)
    for name, deviation in noise.items():
        values = np.array(inputs[name], dtype=float)
        for run in data.runs:
            part = run.samples
            values[part] = denoised_course(data.time[part], values[part], deviation)
        inputs[name] = values
    return replace(data, inputs=inputs)


def denoised_course(time: Array, values: Array, deviation: float) -> Array:
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
            result[part] = _smoothed(time[part], values[part], deviation)
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


def _smoothed(time: Array, values: Array, deviation: float) -> Array:
    """Return values smoothed by a penalty on their curvature, as large as their noise asks for.

    The sum of squared second differences is penalised (Whittaker, Proc. Edinburgh Math. Soc. 41,
    1922), by the weight with the least unbiased estimate of the risk (Mallows, Technometrics 15,
    1973).

    Parameters
    ----------
    time, values : ndarray, shape (n,)
    deviation : float
        Standard deviation of white noise on the values.
    """
    penalty = _curvature_penalty(time)
    # eigenvalues of the penalty over equal steps
    spectrum = (2.0 - 2.0 * np.cos(np.pi * np.arange(len(values)) / len(values))) ** 2

    def smoothed(weight: float) -> Array:
        band = weight * penalty
        band[-1] += 1.0
        return np.asarray(solveh_banded(band, values, check_finite=False))

    def risk(weight: float) -> float:
        freedom = float(np.sum(1.0 / (1.0 + weight * spectrum)))
        return float(np.sum((values - smoothed(weight)) ** 2)) + 2.0 * deviation**2 * freedom

    return smoothed(min(_WEIGHTS, key=risk))


def _curvature_penalty(time: Array) -> Array:
    """Return the upper band (3, n) of the squared second differences of values at instants (n,)."""
    steps = np.diff(time) / np.median(np.diff(time))
    whole = steps[:-1] + steps[1:]
    before = 2.0 / (steps[:-1] * whole)
    after = 2.0 / (steps[1:] * whole)
    band = np.zeros((3, len(time)))
    band[2, :-2] += before**2
    band[2, 1:-1] += (before + after) ** 2
    band[2, 2:] += after**2
    band[1, 1:-1] -= before * (before + after)
    band[1, 2:] -= after * (before + after)
    band[0, 2:] += before * after
    return band


def simulated(search: Search, model: FittedCandidate, data: Dataset) -> dict[str, Array]:
    """Return the signals (n,) of a fitted model over data with other inputs or interpolation."""
    problem = replace(search, data=data).problem(model.candidate, model.problem.names, search.fixed)
    return problem.model.run(
        data.time, data.inputs, problem.start | model.fit.values, runs=data.runs
    ).signals


def with_more_noise(data: Dataset, noise: Mapping[str, float], seed: int) -> Dataset:
    """Return data with as much noise again on its inputs; the same seed draws the same noise."""
    random = np.random.default_rng([seed, 24])
    drawn = {
        name: data.inputs[name] + deviation * random.standard_normal(len(data.time))
        for name, deviation in noise.items()
    }
    return replace(data, inputs={**data.inputs, **drawn})


def disturbances(
    search: Search, model: FittedCandidate, noise: Mapping[str, float]
) -> list[dict[str, Array]]:
    """Return realisations (n,) of the error that the outputs have from denoised inputs.

    Parameters
    ----------
    search : Search
        Over inputs without noise.
    model : FittedCandidate
    noise : Mapping of str to float
        That the inputs had, SI.
    """
    if not noise:
        return []
    exact = simulated(search, model, search.data)
    realisations = []
    for seed in range(REPLICAS):
        noisy = with_more_noise(search.data, noise, seed)
        answer = simulated(search, model, denoised(noisy, noise))
        realisations.append({o: answer[o] - exact[o] for o in model.fit.noise})
    return realisations
