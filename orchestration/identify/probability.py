"""Distributions and ranks, from the special functions that `scipy.stats` is made of.

Loading `scipy.stats` takes as long as all the rest that a diagnosis loads. Quantiles and tails that
`scipy.special` has by themselves are taken from there.
"""

from __future__ import annotations

from math import log, pi

import numpy as np
from scipy.special import gammaincinv, poch

from fmus.kit.arrays import Array


def student_log_density(values: Array, freedom: float) -> Array:
    """Return the logarithm of the density of Student's t distribution of unit scale.

    Parameters
    ----------
    values : ndarray, shape (n,)
    freedom : float
        Degrees of freedom, finite.

    Returns
    -------
    ndarray, shape (n,)
    """
    at_zero = log(poch(0.5 * freedom, 0.5)) - 0.5 * log(pi * freedom)
    return np.asarray(at_zero - 0.5 * (freedom + 1.0) * np.log1p(values**2 / freedom))


def chi_squared_quantile(probability: float, freedom: float) -> float:
    """Return the value below which a chi-squared variable is with a probability.

    Parameters
    ----------
    probability, freedom : float

    Returns
    -------
    float
    """
    return 2.0 * float(gammaincinv(0.5 * freedom, probability))


def ranks(values: Array) -> Array:
    """Return the ranks of values, from one; equal values share the mean of their ranks.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite.

    Returns
    -------
    ndarray, shape (n,)
    """
    order = np.argsort(values)
    ordered = values[order]
    begins = np.flatnonzero(np.diff(ordered, prepend=np.nan) != 0.0)
    ends = np.append(begins[1:], len(values))
    result = np.empty(len(values))
    result[order] = np.repeat(0.5 * (begins + ends + 1), ends - begins)
    return result
