"""Recursive filter, without `scipy.signal`, which loads all of `scipy.stats`."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg.lapack import dtbtrs, ztbtrs


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
