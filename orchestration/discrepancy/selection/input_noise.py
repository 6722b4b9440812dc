"""White noise on a measured input that the plant does not see (errors in variables)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

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
    data = search.data
    try:
        others = []
        for name, deviation in noise.items():
            denoised = {**data.inputs, name: smoothed_input(data.inputs[name], deviation)}
            others.append(simulated(search, model, replace(data, inputs=denoised)))
        amounts = encompassing(model, others)
    except UserError:
        return dict(noise)
    return {
        name: deviation
        for (name, deviation), amount in zip(noise.items(), amounts, strict=True)
        if not amount.margin < -_FOLLOWED
    }


def smoothed_input(values: Array, noise: float, passes: int = 1) -> Array:
    """Return an input (n,) with weighted means of three samples wherever no step is among them.

    Parameters
    ----------
    values : ndarray, shape (n,)
    noise : float
        Its standard deviation.
    passes : int
        Times that means are taken.
    """
    is_smooth = np.abs(np.diff(values, 2)) < _BENDS * noise
    result = values.copy()
    for _ in range(passes):
        mean = 0.25 * result[:-2] + 0.5 * result[1:-1] + 0.25 * result[2:]
        result[1:-1] = np.where(is_smooth, mean, result[1:-1])
    return result


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
    """Return realisations (n,) of the error of the outputs by noise of the inputs."""
    if not noise:
        return []
    measured = simulated(search, model, search.data)
    realisations = []
    for seed in range(REPLICAS):
        noisy = simulated(search, model, with_more_noise(search.data, noise, seed))
        realisations.append({o: noisy[o] - measured[o] for o in model.fit.noise})
    return realisations
