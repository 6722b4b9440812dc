"""Residuals of the base physics, its parameters refitted, over a record without noise.

The base rig is linear in all but two of its unknowns, the time constants of charging and of creep:
the others follow from linear least squares (variable projection; Golub and Pereyra, SIAM J. Numer.
Anal. 10, 1973).
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from demonstrations.emulator.physics import RigParameters

Array = NDArray[np.float64]
_PASSES = 3  # of weighing every output by its noise and its residual, as maximum likelihood would
_FACTOR = 20.0  # by which a time constant may differ from where the search starts


def refit_residuals(
    period: float,
    current: Array,
    force: Array,
    outputs: Mapping[str, Array],
    noise: Mapping[str, float],
    near: RigParameters,
) -> dict[str, Array]:
    """Refit all eight parameters and the three start values; return the residuals.

    Parameters
    ----------
    period : float
        Of sampling, s.
    current, force : ndarray, shape (n,)
        A and N, held from sample to sample.
    outputs : Mapping[str, ndarray]
        Voltage (V), displacement (m) or both, shape (n,).
    noise : Mapping[str, float]
        Standard deviations; with the residuals, they weigh the outputs against each other.
    near : RigParameters
        Where the search for the time constants starts.

    Returns
    -------
    dict of str to ndarray, shape (n,)
    """
    ages = period * np.arange(current.size)
    flow = period * np.concatenate([[0.0], np.cumsum(force[:-1])])
    start = np.log([(near.R1 + near.R2) * near.C, near.b2 / near.k2])

    def residuals(logarithms: Array) -> dict[str, Array]:
        charging, creep = np.exp(logarithms)
        charge = _relaxing(current, charging, period)
        fading = np.exp(-ages / charging)
        explained = {
            "voltage": [current, charge, fading],
            "displacement": [
                charge,
                fading,
                force,
                _relaxing(force, creep, period),
                flow,
                np.ones_like(ages),
                np.exp(-ages / creep),
            ],
        }
        return {
            output: _project(np.column_stack(explained[output]), signal)
            for output, signal in outputs.items()
        }

    def weighted(logarithms: Array, spread: Mapping[str, float]) -> Array:
        return np.concatenate([r / spread[output] for output, r in residuals(logarithms).items()])

    low = start - np.log(_FACTOR)
    high = start + np.log(_FACTOR)
    nearest = start
    spread = dict(noise)
    for _ in range(_PASSES if len(outputs) > 1 else 1):
        nearest = least_squares(
            weighted, nearest, bounds=(low, high), x_scale=0.1, xtol=1e-6, ftol=1e-6, args=(spread,)
        ).x.clip(low + 1e-9, high - 1e-9)
        spread = {
            output: float(np.hypot(noise[output], np.sqrt(np.mean(r**2))))
            for output, r in residuals(nearest).items()
        }
    return residuals(nearest)


def _relaxing(held: Array, time_constant: float, period: float) -> Array:
    """Return a first-order lag of a held signal, at rest at the start."""
    keep = np.exp(-period / time_constant)
    return np.asarray(lfilter([0.0, 1.0 - keep], [1.0, -keep], held))


def _project(columns: Array, signal: Array) -> Array:
    """Return the residual of the signal after regression on the columns."""
    scaled = columns / np.sqrt(np.einsum("ij,ij->j", columns, columns))
    return np.asarray(
        signal - scaled @ np.linalg.lstsq(scaled.T @ scaled, scaled.T @ signal, rcond=1e-13)[0]
    )
