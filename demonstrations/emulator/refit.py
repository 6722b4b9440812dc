"""Residuals of the base physics with refitted parameters on a record without noise.

The base physics is linear in all unknowns but two, the time constants of charging and of creep.
The others follow from linear least squares (variable projection; Golub and Pereyra, SIAM J. Numer.
Anal. 10, 1973).
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from demonstrations.emulator.physics import RigParameters

Array = NDArray[np.float64]
_PASSES = 3  # of weights by noise and residual, an approximation of maximum likelihood
_FACTOR = 20.0  # by which a time constant may differ from its start value


def refit_residuals(
    period: float,
    current: Array,
    force: Array,
    outputs: Mapping[str, Array],
    noise: Mapping[str, float],
    near: RigParameters,
) -> dict[str, Array]:
    """Return the residuals after a fit of all eight parameters and three start values.

    Parameters
    ----------
    period : float
        Sample period, s.
    current, force : ndarray, shape (n,)
        A and N, constant from sample to sample.
    outputs : Mapping[str, ndarray]
        Voltage (V), displacement (m) or both, shape (n,).
    noise : Mapping[str, float]
        Standard deviations by output, which with the residuals are the weights of the outputs.
    near : RigParameters
        Parameters whose time constants are the start of the search.

    Returns
    -------
    dict of str to ndarray, shape (n,)
    """
    ages = period * np.arange(current.size)
    flow = period * np.concatenate([[0.0], np.cumsum(force[:-1])])
    start = np.log([(near.R1 + near.R2) * near.C, near.b2 / near.k2])

    def residuals(logarithms: Array) -> dict[str, Array]:
        charging, creep = np.exp(logarithms)
        charge = _first_order_lag(current, charging, period)
        fading = np.exp(-ages / charging)
        explained = {
            "voltage": [current, charge, fading],
            "displacement": [
                charge,
                fading,
                force,
                _first_order_lag(force, creep, period),
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


def _first_order_lag(signal: Array, time_constant: float, period: float) -> Array:
    """Return the first-order lag of a signal with a zero-order hold, from rest."""
    keep = np.exp(-period / time_constant)
    return np.asarray(lfilter([0.0, 1.0 - keep], [1.0, -keep], signal))


def _project(columns: Array, signal: Array) -> Array:
    """Return the residual (n,) of a signal (n,) after regression on columns (n, p)."""
    scaled = columns / np.sqrt(np.einsum("ij,ij->j", columns, columns))
    return np.asarray(
        signal - scaled @ np.linalg.lstsq(scaled.T @ scaled, scaled.T @ signal, rcond=1e-13)[0]
    )
