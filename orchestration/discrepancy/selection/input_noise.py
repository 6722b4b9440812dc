"""White noise on a measured input that the plant does not see (errors in variables), and what it does to outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Component
from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.encompassing import encompassing
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.data.intersample import Course, course, white_noise
from orchestration.discrepancy.selection.search import Search

Array = NDArray[np.float64]
_LEAST = 2e-4  # of the range, below which an input is as good as known
_BENDS = 6.0 * np.sqrt(
    6.0
)  # deviations of the noise, beyond which a second difference is a step or a bend
# Third differences of white noise change their sign with probability 1/2 + asin(3/4) / pi = 0.77, those of a smooth
# course hardly ever. A quarter of the stretches is enough, because a chirp is smooth enough in some of them only.
_ALTERNATING = 0.68
_STRETCH = 50
_FOLLOWED = 10.0  # fall of minus twice the log-likelihood with which the outputs follow: very strong evidence
REPLICAS = 8  # realisations of the noise


def measured_noise(values: Array) -> float:
    """Standard deviation of white noise on an input (n,), in its unit; zero where there is none to be seen."""
    if course(values) not in (Course.STEPS, Course.SMOOTH):
        return 0.0
    noise = white_noise(values)
    if noise <= _LEAST * np.ptp(values):
        return 0.0
    calm = np.abs(np.diff(values, 2)) < _BENDS * noise
    sign = np.sign(np.diff(values, 3))[calm[:-1] & calm[1:]]
    alternating = (sign[1:] * sign[:-1] < 0.0)[: (len(sign) - 1) // _STRETCH * _STRETCH].reshape(
        -1, _STRETCH
    )
    seen = len(alternating) > 1 and np.quantile(alternating.mean(axis=1), 0.75) > _ALTERNATING
    return noise if seen else 0.0


def noisy_inputs(cls: type[Component], data: Dataset) -> dict[str, float]:
    """Inputs with white noise on them, and its standard deviation, SI."""
    real = [v.name for v in cls.layout.inputs if v.type == "real"]
    found = {name: measured_noise(data.inputs[name]) for name in real if name in data.inputs}
    return {name: noise for name, noise in found.items() if noise > 0.0}


def not_followed(
    search: Search, model: FittedCandidate, noise: Mapping[str, float]
) -> dict[str, float]:
    """Of noisy inputs those whose noise the outputs do not surely follow: it was measured, but was not there.

    Parameters
    ----------
    search : Search
    model : FittedCandidate
        The base model, fitted.
    noise : Mapping of str to float
        By `noisy_inputs`.
    """
    names, data = list(noise), search.data
    try:
        calmer = [{**data.inputs, n: smoothed(data.inputs[n], noise[n])} for n in names]
        amounts = encompassing(
            model, [simulated(search, model, replace(data, inputs=inputs)) for inputs in calmer]
        )
    except UserError:
        return dict(noise)
    return {n: noise[n] for n, a in zip(names, amounts, strict=True) if not a.margin < -_FOLLOWED}


def smoothed(values: Array, noise: float, passes: int = 1) -> Array:
    """An input (n,) with weighted means of three samples, time and again, wherever no step is among them."""
    calm = np.abs(np.diff(values, 2)) < _BENDS * noise
    result = values.copy()
    for _ in range(passes):
        mean = 0.25 * result[:-2] + 0.5 * result[1:-1] + 0.25 * result[2:]
        result[1:-1] = np.where(calm, mean, result[1:-1])
    return result


def simulated(search: Search, model: FittedCandidate, data: Dataset) -> dict[str, Array]:
    """Outputs (n,) of a fitted model over data with other inputs, or with inputs that go otherwise between samples."""
    problem = replace(search, data=data).problem(model.candidate, model.problem.names, search.fixed)
    return problem.model.run(
        data.time, data.inputs, problem.start | model.fit.values, runs=data.runs
    ).signals


def noisier(data: Dataset, noise: Mapping[str, float], seed: int) -> Dataset:
    """The same with as much noise again on its inputs; nothing is drawn at random that is not always the same."""
    random = np.random.default_rng([seed, 24])
    drawn = {
        n: data.inputs[n] + s * random.standard_normal(len(data.time)) for n, s in noise.items()
    }
    return replace(data, inputs={**data.inputs, **drawn})


def disturbances(
    search: Search, model: FittedCandidate, noise: Mapping[str, float]
) -> list[dict[str, Array]]:
    """What noise of the inputs does to the outputs, in realisations (n,) of it."""
    if not noise:
        return []
    now, result = simulated(search, model, search.data), []
    for seed in range(REPLICAS):
        then = simulated(search, model, noisier(search.data, noise, seed))
        result.append({o: then[o] - now[o] for o in model.fit.noise})
    return result
