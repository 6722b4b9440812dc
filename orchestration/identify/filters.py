"""Filters of polynomials in the delay, without `scipy.signal`, which loads all of `scipy.stats`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg.lapack import dtbtrs, ztbtrs

from fmus.kit.arrays import Array


def moving_average(numerator: Array | Sequence[float], values: Array) -> Array:
    """Filter the columns of values by a polynomial in the delay, from rest.

    Parameters
    ----------
    numerator : ndarray, shape (p + 1,)
    values : ndarray, shape (n,) or (n, k)

    Returns
    -------
    ndarray, shape (n,) or (n, k)
    """
    n = len(values)
    if values.ndim == 1:
        return np.convolve(values, numerator)[:n] if n else values
    filtered = np.empty(values.shape)
    for k in range(values.shape[1]):
        filtered[:, k] = moving_average(numerator, values[:, k])
    return filtered


def autoregression(denominator: Any, values: Any) -> Any:
    """Filter the columns of values by one over a polynomial in the delay, from rest.

    The output solves a triangular system whose bands are the coefficients.

    Parameters
    ----------
    denominator : ndarray, shape (p + 1,)
        Real or complex; the first coefficient is one.
    values : ndarray, shape (n,) or (n, k)
        Real or complex.

    Returns
    -------
    ndarray, shape (n,) or (n, k)
        Complex if either is.
    """
    coefficients = np.asarray(denominator)
    if not values.size:
        return values
    solve = ztbtrs if np.iscomplexobj(coefficients) or np.iscomplexobj(values) else dtbtrs
    bands = np.empty((len(coefficients), len(values)), dtype=coefficients.dtype, order="F")
    bands[:] = coefficients[:, np.newaxis]
    filtered = solve(bands, values, uplo="L", diag="U")[0]
    return filtered.reshape(values.shape)
