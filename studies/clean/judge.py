"""A naive judge: plain least squares on the simulation error, from five starts.

It knows nothing of a diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from fmus.kit.arrays import Array, Mask

Outputs = Mapping[str, Array]
STARTS = 5
SCATTER = 0.7  # standard deviation of the logarithm, of starts beside nominal


def noise_scale(y: Array) -> float:
    """Return the noise of an output, robustly from its third differences.

    The variance of third differences is twenty times that of white noise.
    """
    present = y[np.isfinite(y)]
    scale = float(np.median(np.abs(np.diff(present, 3)))) / (0.6745 * np.sqrt(20.0))
    return max(scale, 1e-4 * float(np.std(present)), 1e-12)


def pooled_error(
    measured: Outputs, simulated: Outputs, used: Mapping[str, Mask] | None = None
) -> float:
    """Return the root mean square of all errors over the noise of their outputs."""
    parts = [
        ((y - simulated[o]) / noise_scale(y))[np.isfinite(y) & (used[o] if used else True)]
        for o, y in measured.items()
    ]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def least_squares_fit(
    simulate: Callable[[dict[str, float]], Outputs],
    measured: Outputs,
    nominal: Mapping[str, float],
    *,
    used: Mapping[str, Mask] | None = None,
    starts: int = STARTS,
    sizes: Mapping[str, float] | None = None,
    evaluations: int = 40,
    seed: int = 1,
) -> tuple[float, dict[str, float]]:
    """Return the least pooled error that plain least squares reaches, and its parameters.

    Parameters
    ----------
    simulate : callable
        Outputs of parameter values.
    measured : Mapping of str to ndarray, shape (n,)
    nominal : Mapping of str to float
        Where the first search starts; what is positive is searched in its logarithm unless it has a
        size.
    used : Mapping of str to ndarray of bool, optional
        Samples that count.
    starts : int
        The others are scattered about nominal.
    sizes : Mapping of str to float, optional
        Of values that are searched linearly, such as starting states.
    evaluations : int
        Of each search, at most; derivatives are not counted.
    seed : int
    """
    sizes = dict(sizes or {})
    names = list(nominal)
    free: Sequence[str] = [n for n in names if n not in sizes]

    def values(q: Array) -> dict[str, float]:
        return {
            n: nominal[n] + sizes[n] * x if n in sizes else nominal[n] * float(np.exp(x))
            for n, x in zip(names, q, strict=True)
        }

    def errors(q: Array) -> Array:
        with np.errstate(all="ignore"):
            simulated = simulate(values(q))
        rows = [
            ((y - simulated[o]) / noise_scale(y))[np.isfinite(y) & (used[o] if used else True)]
            for o, y in measured.items()
        ]
        return np.nan_to_num(np.clip(np.concatenate(rows), -1e9, 1e9), nan=1e9)

    rng = np.random.default_rng(seed)
    scattered = np.array([SCATTER if n in free else 0.0 for n in names])
    best: tuple[float, Array] = (np.inf, np.zeros(len(names)))
    for k in range(starts):
        start = scattered * rng.standard_normal(len(names)) if k else np.zeros(len(names))
        low, high = np.full(len(names), -12.0), np.full(len(names), 12.0)
        low, high = (
            np.where(scattered > 0.0, edge, sign * np.inf)
            for edge, sign in ((low, -1.0), (high, 1.0))
        )
        found = least_squares(errors, start, bounds=(low, high), x_scale=1.0, max_nfev=evaluations)
        best = min(
            best, (float(np.sqrt(2.0 * found.cost / found.fun.size)), found.x), key=lambda b: b[0]
        )
    return best[0], values(best[1])
