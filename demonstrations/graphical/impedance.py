"""Impedance from a record by batch least squares in windows, as in the thesis.

The model is ``v(t) = b0 i(t) + b1 i(t-1) - a v(t-1)`` (eq. 4.6). Section 4.3 describes an estimate
from every 1000 samples. The M-file of appendix A3 does not clear its normal matrices between
windows, so that window n has all samples up to its end (``docs/errata.md``, row 7). This module has
both estimates; noise on the voltage biases both (row 9).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fmus.kit import UserError
from fmus.kit.arrays import Array

Conversion = Callable[[ArrayLike, float], Array]


def tustin(theta: ArrayLike, period: float) -> Array:
    """Convert estimates by Tustin's rule, eqs. 3.11-3.13 (4.3-4.5).

    Parameters
    ----------
    theta : array_like, shape (..., 3)
        ``b0`` (ohm), ``b1`` (ohm) and ``a``.
    period : float
        Sample period in seconds.

    Returns
    -------
    ndarray, shape (..., 3)
        R1 (ohm), R2 (ohm) and C (F); not finite if no circuit has the estimate.
    """
    b0, b1, a = np.moveaxis(np.asarray(theta, dtype=float), -1, 0)
    total = b0 + b1
    excess = b1 - a * b0
    with np.errstate(divide="ignore", invalid="ignore"):
        r1 = total * (b0 - b1) / (2.0 * excess)
        r2 = total / (1.0 + a)
        c = excess * period / total**2
    return np.stack([r1, r2, c], axis=-1)


def zero_order_hold(theta: ArrayLike, period: float) -> Array:
    """Convert estimates exactly for a current that is constant between samples.

    ``a = -exp(-period / ((R1 + R2) C))``, ``b0 = R1 R2 / (R1 + R2)`` and ``b1 = (1 + a) R2 - b0``,
    solved for the circuit. Parameters and result are those of :func:`tustin`.

    Parameters
    ----------
    theta : array_like, shape (..., 3)
    period : float

    Returns
    -------
    ndarray, shape (..., 3)
    """
    b0, b1, a = np.moveaxis(np.asarray(theta, dtype=float), -1, 0)
    total = b0 + b1
    excess = b1 - a * b0
    with np.errstate(divide="ignore", invalid="ignore"):
        r1 = b0 * total / excess
        r2 = total / (1.0 + a)
        c = -period / (np.log(-a) * (r1 + r2))
    return np.stack([r1, r2, c], axis=-1)


def magnitude(circuit: ArrayLike, angular_frequency: float) -> Array:
    """Return the magnitude of the impedance (ohm), eq. 4.10.

    Parameters
    ----------
    circuit : array_like, shape (..., 3)
        R1 (ohm), R2 (ohm) and C (F).
    angular_frequency : float
        rad/s.

    Returns
    -------
    ndarray, shape (...)
    """
    r1, r2, c = np.moveaxis(np.asarray(circuit, dtype=float), -1, 0)
    zero = np.hypot(1.0, r1 * c * angular_frequency)
    pole = np.hypot(1.0, (r1 + r2) * c * angular_frequency)
    return r2 * zero / pole


@dataclass(frozen=True)
class ImpedanceWindows:
    """Estimates of the circuit and the impedance, one for each window.

    Attributes
    ----------
    end : ndarray, shape (n,)
        Time of the end of each window, in seconds from the first sample.
    theta : ndarray, shape (n, 3)
        ``b0``, ``b1`` and ``a``.
    circuit : ndarray, shape (n, 3)
        R1 (ohm), R2 (ohm) and C (F).
    impedance : ndarray, shape (n,)
        Ohm.
    """

    end: Array
    theta: Array
    circuit: Array
    impedance: Array


def least_squares_windows(
    current: ArrayLike,
    voltage: ArrayLike,
    period: float,
    samples: int = 1000,
    *,
    cumulative: bool = False,
    angular_frequency: float = 0.628,
    conversion: Conversion = tustin,
) -> ImpedanceWindows:
    """Estimate the circuit in consecutive windows by least squares (section 4.3).

    Parameters
    ----------
    current, voltage : array_like, shape (m,)
        A and V, at a fixed sample period.
    period : float
        Seconds.
    samples : int
        Number of equations in a window; each needs the sample before it.
    cumulative : bool
        Keep the equations of earlier windows, as the M-file of appendix A3 does (errata 7).
    angular_frequency : float
        Frequency of the impedance, rad/s.
    conversion : callable
        :func:`tustin`, as printed, or :func:`zero_order_hold`.

    Returns
    -------
    ImpedanceWindows
        A rest that is shorter than a window is omitted.

    Raises
    ------
    UserError
        If the record is shorter than a window or not finite, or a window does not excite the
        circuit.
    """
    i = np.asarray(current, dtype=float)
    v = np.asarray(voltage, dtype=float)
    _check(i, v, period, samples)
    count = (i.size - 1) // samples
    equations = np.column_stack([i[1:], i[:-1], -v[:-1], v[1:]])[: count * samples]
    theta = np.empty((count, 3))
    triangle = np.empty((0, 4))
    for n, window in enumerate(equations.reshape(count, samples, 4)):
        # R of the QR factorisation has the information of all equations so far
        known = np.vstack([triangle, window]) if cumulative else window
        triangle = np.asarray(np.linalg.qr(known, mode="r"), dtype=np.float64)
        theta[n], _, rank, _ = np.linalg.lstsq(triangle[:, :3], triangle[:, 3])
        if rank < 3:
            raise UserError(
                f"window from {n * samples * period:g} s to {(n + 1) * samples * period:g} s: the"
                " current does not vary enough"
            )
    circuit = conversion(theta, period)
    ends = np.asarray(period * samples * np.arange(1, count + 1), dtype=np.float64)
    return ImpedanceWindows(ends, theta, circuit, magnitude(circuit, angular_frequency))


def _check(current: Array, voltage: Array, period: float, samples: int) -> None:
    """Raise UserError for a record from which no window can be estimated."""
    if current.ndim != 1 or current.shape != voltage.shape:
        raise UserError(
            f"current has shape {current.shape} and voltage {voltage.shape}: both must be vectors"
            " of one length"
        )
    if not period > 0.0:
        raise UserError(f"period = {period:g} s: must be above 0")
    if samples < 3:
        raise UserError(
            f"samples = {samples}: three parameters need at least 3 samples in a window"
        )
    if current.size - 1 < samples:
        raise UserError(
            f"record of {current.size} samples: a window of {samples} needs {samples + 1}"
        )
    bad = np.flatnonzero(~(np.isfinite(current) & np.isfinite(voltage)))
    if bad.size:
        raise UserError(f"sample {bad[0]}: current and voltage must be finite numbers")
