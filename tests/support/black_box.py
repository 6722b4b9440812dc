"""Data of linear systems, drawn equation by equation: it shares no code with what identifies
them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array


def response(numerator: list[float], denominator: list[float], values: Array) -> Array:
    """Run ``y(t) = sum_k b_k u(t-k) - sum_k f_k y(t-k)`` from rest, sample by sample."""
    u, y = [0.0] * len(numerator), [0.0] * (len(denominator) - 1)
    found = []
    for value in values.tolist():
        u = [value, *u[:-1]]
        now = sum(b * x for b, x in zip(numerator, u, strict=True))
        now -= sum(f * x for f, x in zip(denominator[1:], y, strict=True))
        y = [now, *y[:-1]]
        found.append(now)
    return np.array(found)


@dataclass(frozen=True)
class Drawn:
    """A record, and the truth behind it.

    Attributes
    ----------
    inputs : ndarray, shape (n, m)
    output, truth : ndarray, shape (n,)
        With noise and without.
    """

    inputs: Array
    output: Array
    truth: Array


# the coefficients of the paths and of the noise, by the names that a model gives them
BOX_JENKINS = {
    "b1_1": 0.5,
    "b1_2": 0.2,
    "f1_1": -1.5,
    "f1_2": 0.7,
    "b2_2": 1.0,
    "b2_3": -0.3,
    "f2_1": -0.9,
    "c1": 0.5,
    "d1": -0.8,
}


def box_jenkins_record(
    seed: int, samples: int = 2000, offset: float = 3.0, ratio: float = 20.0, d1: float = -0.8
) -> Drawn:
    """Draw two inputs of random signs, paths with denominators of their own, coloured noise, from
    rest.

    Parameters
    ----------
    seed, samples : int
    offset : float
        Of the output.
    ratio : float
        Power of the output over that of the noise, in dB.
    d1 : float
        The noise is ``(1 + 0.5 q^-1) / (1 + d1 q^-1)`` of white noise.
    """
    random = np.random.default_rng(seed)
    inputs = np.sign(random.standard_normal((samples, 2)))
    truth = response([0.0, 0.5, 0.2], [1.0, -1.5, 0.7], inputs[:, 0])
    truth += response([0.0, 0.0, 1.0, -0.3], [1.0, -0.9], inputs[:, 1])
    noise = response([1.0, 0.5], [1.0, d1], random.standard_normal(samples + 300))[300:]
    noise *= np.std(truth) / np.std(noise) / 10.0 ** (ratio / 20.0)
    return Drawn(inputs, truth + offset + noise, truth + offset)


def fit(truth: Array, simulated: Array) -> float:
    """Return the NRMSE fit in percent."""
    return float(
        100.0 * (1.0 - np.linalg.norm(truth - simulated) / np.linalg.norm(truth - np.mean(truth)))
    )
