"""Polynomials in the delay operator q^-1: stability, reflection of roots, roots in the s-plane.

A polynomial is an array of coefficients of q^0, q^-1, q^-2, ...; its roots are those in z.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from fmus.kit.arrays import Array

Roots = NDArray[np.complex128]
_INSIDE = 1.0 - 1e-7  # largest modulus of a pole that is called stable
# sum of the coefficients, relative to that of their absolute values, below which a root is at one
_AT_ONE = 1e-9
_REFLECTED = 0.995  # largest modulus of a root after its reflection
_AT_ORIGIN = 1e-9  # modulus of a root in z that is a delay, and has no place in the s-plane


def monic(coefficients: ArrayLike) -> Array:
    """Return a monic polynomial: a leading one before coefficients of q^-1, q^-2 and so on."""
    return np.concatenate([[1.0], np.asarray(coefficients, dtype=np.float64)])


def roots(polynomial: Array) -> Roots:
    """Return the roots in z, without those that are delays (leading zeros)."""
    return np.asarray(np.roots(polynomial), dtype=np.complex128)


def integrates(polynomial: Array) -> bool:
    """Return whether a denominator has a root at one."""
    return bool(abs(polynomial.sum()) <= _AT_ONE * np.abs(polynomial).sum())


def stabilised(polynomial: Array) -> Array:
    """Reflect roots on or beyond the unit circle into it (Ljung, section 10.2).

    The magnitude of the frequency response is kept but for a factor.

    Parameters
    ----------
    polynomial : ndarray, shape (p,)
        Monic.

    Returns
    -------
    ndarray, shape (p,)
        The polynomial itself if it is stable.
    """
    z = roots(polynomial)
    size = np.abs(z)
    outside = size >= _INSIDE
    if not outside.any():
        return polynomial
    z[outside] *= np.minimum(1.0 / size[outside], _REFLECTED) / size[outside]
    reflected = np.real(np.poly(z))
    # `roots` leaves out those that are delays
    return np.concatenate([reflected, np.zeros(len(polynomial) - len(reflected))])


def filtered(numerator: Array, denominator: Array, values: Array) -> Array:
    """Filter values along the last axis, from rest."""
    from scipy.signal import lfilter  # half a second to load, which only a black box needs

    # SciPy refuses an empty array
    if not values.size or len(numerator) == len(denominator) == 1:
        return numerator[0] / denominator[0] * values
    if len(denominator) == 1:
        # SciPy convolves row by row where there is no denominator, which is slower than to filter
        denominator = np.append(denominator, 0.0)
    return lfilter(numerator, denominator, values)


def delayed(values: Array, least: int, count: int) -> Array:
    """Return a signal (n,) delayed by ``least`` and more samples (count, n); zero before it."""
    padded = np.concatenate([np.zeros(least + count), values])
    return sliding_window_view(padded, len(values))[count:0:-1]


def from_reflections(coefficients: Array) -> tuple[Array, Array]:
    """Return the monic polynomial of reflection coefficients, and its derivatives by them.

    All its roots are within the unit circle if the coefficients are within -1 and 1, and every such
    polynomial has its coefficients there (Levinson's recursion; Ljung, section 10.1).

    Parameters
    ----------
    coefficients : ndarray, shape (p,)

    Returns
    -------
    polynomial : ndarray, shape (p + 1,)
    slopes : ndarray, shape (p + 1, p)
    """
    # p_{i+1}(q) = p_i(q) + k_i q^-(i+1) p_i(1/q): the coefficients, and k times them reversed
    order = len(coefficients)
    polynomial = np.zeros(order + 1)
    polynomial[0] = 1.0
    slopes = np.zeros((order + 1, order))
    for i, k in enumerate(coefficients):
        grown = slice(i + 2)
        slopes[grown, :i] += k * slopes[i + 1 :: -1, :i]
        slopes[grown, i] = polynomial[i + 1 :: -1]
        polynomial[grown] += k * polynomial[i + 1 :: -1]
    return polynomial, slopes


def reflections(polynomial: Array) -> Array:
    """Return the reflection coefficients (p,) of a stable monic polynomial (p + 1,).

    It is the recursion of :func:`from_reflections`, backwards.
    """
    coefficients = []
    remaining = np.asarray(polynomial, dtype=np.float64)
    while len(remaining) > 1:
        k = np.clip(remaining[-1], -_INSIDE, _INSIDE)  # rounding can put it at one
        coefficients.append(k)
        remaining = (remaining - k * remaining[::-1])[:-1] / (1.0 - k * k)
    return np.array(coefficients[::-1])


def solve_least_squares(columns: Array, target: Array) -> Array:
    """Return the solution of linear least squares, the shortest where there are several."""
    return np.asarray(np.linalg.lstsq(columns, target, rcond=None)[0], dtype=np.float64)


def without_part_in(columns: Array, values: Array) -> Array:
    """Return values (n,) less the combination of columns (n, k) that is closest to them."""
    return values - columns @ solve_least_squares(columns, values)


def columns_of(values: ArrayLike) -> Array:
    """Return signals (n, m) as numbers, of which one alone may have the shape (n,)."""
    columns = np.asarray(values, dtype=np.float64)
    return columns[:, np.newaxis] if columns.ndim == 1 else columns


def triangle(rows: Array) -> Array:
    """Return the factor R (q, q) of the QR decomposition of a transposed matrix.

    The least squares of one row over others are those of the columns of R, instead of many thousand
    samples.

    Parameters
    ----------
    rows : ndarray, shape (q, n)
        Overwritten.
    """
    from scipy.linalg import qr  # that of NumPy copies twice, which takes longer than the rest

    return np.asarray(qr(rows.T, mode="raw", overwrite_a=True, check_finite=False)[1])


def s_plane(z: ArrayLike, step: float) -> Roots:
    """Map poles or zeros from the z-plane to the s-plane, ``s = ln(z) / step`` (thesis, fig. 3-16).

    Poles are exact for inputs with a zero-order hold; zeros have no exact counterpart and are
    mapped by the same rule (Åström, Hagander, Sternby: Automatica 20, 1984).

    Parameters
    ----------
    z : array_like of complex, shape (p,)
    step : float
        Sample period in seconds.

    Returns
    -------
    ndarray of complex, shape (r,)
        rad/s, imaginary parts up to the Nyquist frequency; roots at z = 0, which are delays, are
        left out.
    """
    values = np.asarray(z, dtype=np.complex128)
    return np.asarray(np.log(values[np.abs(values) > _AT_ORIGIN]) / step, dtype=np.complex128)
