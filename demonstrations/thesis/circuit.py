"""Circuit of table 3-1 with a sampled current: the records of the thesis, without noise."""

from __future__ import annotations

from math import exp, tanh

import numpy as np
from numpy.typing import ArrayLike

from demonstrations.thesis.actuator import MODEL
from fmus.degradation_estimator.systems import AMPLITUDE, FREQUENCY
from fmus.kit.arrays import Array

CIRCUIT = (MODEL["R1"], MODEL["R2"], MODEL["C"])  # ohm, ohm, F
PERIOD = 0.1  # s, of table 3-1 (errata 21) and appendix A3


def held_coefficients(r1: float, r2: float, c: float, period: float) -> tuple[float, float, float]:
    """Return exact b0, b1 and a of eq. 3.10 for a current that is constant between samples.

    Parameters
    ----------
    r1, r2, c : float
        In ohm and F.
    period : float
        Seconds.
    """
    a = -exp(-period / ((r1 + r2) * c))
    b0 = r1 * r2 / (r1 + r2)
    return b0, (1.0 + a) * r2 - b0, a


def periodic_voltage(r1: float, r2: float, c: float) -> float:
    """Return the largest voltage of a circuit in the periodic state under the square wave.

    The amplitude of the charge is ``tanh(T / (4 tau))`` of its final value.

    Parameters
    ----------
    r1, r2, c : float
        In ohm and F.

    Returns
    -------
    float
        In V.
    """
    swing = tanh(1.0 / (4.0 * FREQUENCY * (r1 + r2) * c))
    return AMPLITUDE * r2 * (r1 + r2 * swing) / (r1 + r2)


def response(current: ArrayLike, r1: ArrayLike = CIRCUIT[0], period: float = PERIOD) -> Array:
    """Return the voltage of the circuit from rest for a current that is constant between samples.

    R1 may change with time.

    Parameters
    ----------
    current : array_like, shape (n,)
        A.
    r1 : array_like, shape (n,) or ()
        Ohm.
    period : float
        Seconds.

    Returns
    -------
    ndarray, shape (n,)
        V.
    """
    i = np.asarray(current, dtype=float)
    resistance = np.broadcast_to(np.asarray(r1, dtype=float), i.shape)
    _, r2, c = CIRCUIT
    charge = 0.0
    voltage = np.empty_like(i)
    for k, (r, now) in enumerate(zip(resistance.tolist(), i.tolist(), strict=True)):
        voltage[k] = r2 * (r * now + charge / c) / (r + r2)
        charge = r2 * c * now + (charge - r2 * c * now) * exp(-period / ((r + r2) * c))
    return voltage
