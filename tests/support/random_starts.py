"""The least loss of a Box-Jenkins or ARMAX model from random starts of SciPy.

It shares no code with what it judges: SciPy's `least_squares` with derivatives by differences, over
reflection coefficients of F, C and D, with a dense least squares for all other parameters. It
searches the models of decision 57: F stable, zeros of C and D no nearer to the unit circle than a
time constant of the record's length puts them.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from fmus.kit.arrays import Array

LARGEST = 1.0 - 1e-7  # reflection coefficient; beyond it is rounding


def _within(radius: float, coordinates: Array) -> Array:
    """Return a polynomial with all roots within a radius (Levinson)."""
    polynomial = np.array([1.0])
    for k in LARGEST * np.tanh(coordinates):
        polynomial = np.append(polynomial, 0.0)
        polynomial = polynomial + k * polynomial[::-1]
    return polynomial * radius ** np.arange(len(polynomial))


class Criterion:
    """Errors of ``A y = sum_i B_i/F_i u_i + offset + C/D e`` by the coordinates of F, C and D.

    Parameters
    ----------
    inputs, output : ndarray, shape (n, m) and (n,)
    counts : dict
        na, nb, nf, nc, nd and nk.
    """

    def __init__(self, inputs: Array, output: Array, counts: dict):
        self.inputs = inputs - inputs.mean(axis=0)
        self.output = output - output.mean()
        self.counts = {"na": 0, "nf": (0,) * inputs.shape[1], "nd": 0} | counts
        reach = [b + k - 1 for b, k in zip(counts["nb"], counts["nk"], strict=True)]
        self.first = max(self.counts["na"], *reach)
        self.orders = [*self.counts["nf"], self.counts["nc"], self.counts["nd"]]
        within_record = float(np.exp(-1.0 / (len(output) - self.first)))
        self.radii = [*(1.0 for _ in self.counts["nf"]), within_record, within_record]

    def errors(self, coordinates: Array) -> Array:
        """Return the errors (samples,), with the best of all linear parameters."""
        parts = np.split(coordinates, np.cumsum(self.orders)[:-1])
        *paths, c, d = map(_within, self.radii, parts)
        samples = len(self.output) - self.first
        columns = [np.ones(samples)]
        for k in range(1, self.counts["na"] + 1):
            columns.append(self.output[self.first - k :][:samples])
        for i, f in enumerate(paths):
            for k in range(self.counts["nb"][i]):
                start = self.first - self.counts["nk"][i] - k
                columns.append(lfilter([1.0], f, self.inputs[start : start + samples, i]))
            impulse = np.zeros(samples)
            for k in range(len(f) - 1):
                impulse[:] = 0.0
                impulse[k] = 1.0
                columns.append(lfilter([1.0], f, impulse))
        whitened = lfilter(d, c, np.array(columns)).T
        target = lfilter(d, c, self.output[self.first :])
        scale = np.linalg.norm(whitened, axis=0)
        solution = np.linalg.lstsq(whitened / scale, target, rcond=1e-12)[0]
        return target - whitened / scale @ solution

    def least(self, starts: int, seed: int) -> float:
        """Return the natural logarithm of the least mean square from so many random starts."""
        random = np.random.default_rng(seed)
        lowest = np.inf
        for _ in range(starts):
            begin = random.choice([0.5, 1.0, 2.0]) * random.standard_normal(sum(self.orders))
            end = least_squares(self.errors, begin, max_nfev=60, xtol=1e-8, ftol=1e-9)
            lowest = min(lowest, 2.0 * end.cost / len(end.fun))
        return float(np.log(lowest))
