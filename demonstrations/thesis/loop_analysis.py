"""Linear analysis of the force loop: plant of eq. 2.1, Bode data, margins and closed-loop step.

Defaults are those of thesis appendix A1.
Equation 2.1 is the force of the coil over its voltage, with the actuator as a spring k1 in parallel
with a spring k2 and a dashpot b2 in series. The load cell measures that force less slide friction
and inertia.
"""

from __future__ import annotations

import math
from math import pi
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.extras import optional
from orchestration.linear import LoopMargins, linear_model_of

with optional():
    import control

SAMPLE_PERIOD = 1.0 / 30.0
A1_ACTUATOR = {"k1": 3860.0, "k2": 300.0, "b2": 2300.0}


def plant(
    *,
    R: float = 3.0,
    L: float = 1e-3,
    K: float = 3.9,
    m: float = 0.03,
    b_vc: float = 6.0,
    k1: float = 3860.0,
    k2: float = 300.0,
    b2: float = 2300.0,
    back_emf: bool = True,
) -> Any:
    """Return the transfer function of the plant, F(s)/V(s) of eq. 2.1 in N/V.

    Parameters
    ----------
    R, L, K, m, b_vc : float
        Coil resistance in ohm, inductance in H, force constant in N/A, moving mass in kg, damping
        of the slide in N s/m.
    k1, k2, b2 : float
        Instantaneous and delayed stiffness of the actuator in N/m, its damping in N s/m.
    back_emf : bool
        If False, the back-EMF is left out, as in the design of appendix A1: (K/R) / ((L/R) s + 1).

    Returns
    -------
    control.TransferFunction
    """
    if not back_emf:
        return control.tf([K], [L, R])
    # Polynomials in s. The actuator has the stiffness k1 + b2 k2 s / (b2 s + k2); `mechanical` is
    # that of coil and actuator, force over displacement, times b2 s + k2.
    relaxation = np.array([b2, k2])
    mechanical = np.polyadd(np.polymul([m, b_vc, k1], relaxation), [b2 * k2, 0.0])
    motional = K**2 * np.polymul([1.0, 0.0], relaxation)  # of the back-EMF
    denominator = np.polyadd(np.polymul([L, R], mechanical), motional)
    return control.tf(K * mechanical, denominator)


def controller(gain: float = 18.0, zero_time: float = 0.02) -> Any:
    """Return the PI controller gain (zero_time s + 1)/s of eq. 2.2.

    Parameters
    ----------
    gain : float
        In V/(N s).
    zero_time : float
        Time constant of the zero, s.

    Returns
    -------
    control.TransferFunction
        From force error in N to voltage in V. With the defaults, Tustin's rule at 30 Hz gives the
        coefficients of eq. 2.2 (errata 3).
    """
    return control.tf([gain * zero_time, gain], [1.0, 0.0])


def discrete_coefficients(
    gain: float, zero_time: float, period: float = SAMPLE_PERIOD
) -> tuple[float, float]:
    """Return the coefficients of eq. 2.2 for a PI controller, by Tustin's rule.

    Parameters
    ----------
    gain, zero_time : float
        Of :func:`controller`, in V/(N s) and s.
    period : float
        Sample period in s.

    Returns
    -------
    b0, b1 : float
        In V/N.
    """
    return gain * (zero_time + period / 2.0), gain * (period / 2.0 - zero_time)


def continuous_coefficients(
    b0: float, b1: float, period: float = SAMPLE_PERIOD
) -> tuple[float, float]:
    """Return gain, V/(N s), and time of the zero, s: the inverse of `discrete_coefficients`."""
    gain = (b0 + b1) / period
    return gain, (b0 - b1) / (2.0 * gain)


def sample_and_hold(period: float = SAMPLE_PERIOD) -> Any:
    """Return appendix A1's approximation of the zero-order hold, (2/T) / (s + 2/T).

    Returns
    -------
    control.TransferFunction
    """
    return control.tf([2.0 / period], [1.0, 2.0 / period])


def force_filter(cutoff: float = 100.0) -> Any:
    """Return the first-order filter of the load cell; ``cutoff`` in Hz.

    Returns
    -------
    control.TransferFunction
    """
    return control.tf([1.0], [1.0 / (2.0 * pi * cutoff), 1.0])


def loop(
    gain: float = 18.0,
    zero_time: float = 0.02,
    *,
    period: float | None = SAMPLE_PERIOD,
    cutoff: float | None = 100.0,
    **plant_parameters: Any,
) -> Any:
    """Return the loop transfer function, the product of controller, plant, hold and filter.

    Parameters
    ----------
    gain, zero_time : float
        Gain and time of the zero of :func:`controller`.
    period : float or None
        Sample period in s; None leaves the hold out.
    cutoff : float or None
        Cutoff frequency of the load-cell filter in Hz; None leaves the filter out.
    **plant_parameters
        Keyword arguments of :func:`plant`.

    Returns
    -------
    control.TransferFunction
    """
    factors = [controller(gain, zero_time), plant(**plant_parameters)]
    if period is not None:
        factors.append(sample_and_hold(period))
    if cutoff is not None:
        factors.append(force_filter(cutoff))
    return math.prod(factors[1:], start=factors[0])


def margins(system: Any) -> LoopMargins:
    """Return gain and phase margin of a loop transfer function, with their frequencies in Hz."""
    return linear_model_of(system).margins()


def bode(system: Any, frequencies: Array) -> tuple[Array, Array]:
    """Return Bode data of a transfer function, as in fig. 2-5.

    Parameters
    ----------
    system : control.TransferFunction
    frequencies : ndarray, shape (n,)
        In Hz, ascending.

    Returns
    -------
    magnitude : ndarray, shape (n,)
        In dB.
    phase : ndarray, shape (n,)
        In degrees, unwrapped.
    """
    response = system(2j * pi * np.asarray(frequencies, dtype=float))
    return 20.0 * np.log10(np.abs(response)), np.degrees(np.unwrap(np.angle(response)))


def closed_loop_step(
    time: Array,
    gain: float = 18.0,
    zero_time: float = 0.02,
    *,
    period: float | None = SAMPLE_PERIOD,
    cutoff: float | None = 100.0,
    **plant_parameters: Any,
) -> Array:
    """Return the force after a reference step of 1 N (fig. 2-6), with A1's filter in the feedback.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Evenly spaced seconds from 0.
    gain, zero_time, period, cutoff, **plant_parameters
        As for :func:`loop`.

    Returns
    -------
    ndarray, shape (n,)
        In N.
    """
    forward = loop(gain, zero_time, period=period, cutoff=None, **plant_parameters)
    feedback = 1.0 if cutoff is None else force_filter(cutoff)
    return np.asarray(control.step_response(control.feedback(forward, feedback), time).outputs)


def rise_time(time: Array, response: Array, final: float = 1.0) -> float:
    """Return the time after which a step response first reaches 63.2 % of its final value.

    It is the time constant of a first-order lag, not the rise time from 10 to 90 %.

    Parameters
    ----------
    time, response : ndarray, shape (n,)
        Times in s after the step, and the response to it.
    final : float
        Final value, in the unit of the response.

    Returns
    -------
    float
        In s, interpolated between samples; NaN if the response does not get there.
    """
    level = 1.0 - np.exp(-1.0)
    share = np.asarray(response) / final
    reached = np.flatnonzero(share >= level)
    if not len(reached):
        return float("nan")
    i = max(int(reached[0]), 1)
    return float(np.interp(level, share[i - 1 : i + 1], time[i - 1 : i + 1]))
