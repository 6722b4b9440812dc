"""The force loop as linear analysis sees it: eq. 2.1, the loop's Bode data, margins and closed-loop
step.

Not part of the FMU, for it needs python-control. Defaults are those of thesis appendix A1. Equation
2.1 gives the force of the coil over its voltage with the actuator as a spring k1 beside a spring k2
in series with a dashpot b2; the load cell shows the same force but for slide friction and inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.extras import optional

with optional():
    import control

SAMPLE_PERIOD = 1.0 / 30.0
A1_ACTUATOR = {"k1": 3860.0, "k2": 300.0, "b2": 2300.0}


@dataclass(frozen=True)
class Margins:
    """Stability margins of a loop.

    Attributes
    ----------
    phase : float
        Phase margin in degrees.
    crossover : float
        Frequency of gain one, in Hz; the phase margin is read there.
    gain : float
        Factor by which the gain can grow; infinity if without limit.
    phase_crossover : float
        Frequency of phase -180 degrees, in Hz; not a number if there is none.
    """

    phase: float
    crossover: float
    gain: float
    phase_crossover: float


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
    """Coil force over coil voltage, F(s)/V(s) of eq. 2.1 in N/V.

    Parameters
    ----------
    R, L, K, m, b_vc : float
        Coil resistance in ohm, inductance in H, force constant in N/A, moving mass in kg, slide
        damping in N s/m.
    k1, k2, b2 : float
        Actuator: stiffness in N/m at once and delayed, damping in N s/m.
    back_emf : bool
        False leaves the back-EMF out, which is the plant that appendix A1 designs for: (K/R) /
        ((L/R) s + 1).

    Returns
    -------
    control.TransferFunction
    """
    if not back_emf:
        return control.tf([K], [L, R])
    relaxing = np.array([b2, k2])
    mechanical = np.polyadd(np.polymul([m, b_vc, k1], relaxing), [b2 * k2, 0.0])
    denominator = np.polyadd(
        np.polymul([L, R], mechanical), K**2 * np.polymul([1.0, 0.0], relaxing)
    )
    return control.tf(K * mechanical, denominator)


def controller(gain: float = 18.0, zero_time: float = 0.02) -> Any:
    """PI controller gain (zero_time s + 1)/s, from N to V; the defaults are what eq. 2.2 came from
    (errata 3).

    Returns
    -------
    control.TransferFunction
    """
    return control.tf([gain * zero_time, gain], [1.0, 0.0])


def discrete_coefficients(
    gain: float, zero_time: float, period: float = SAMPLE_PERIOD
) -> tuple[float, float]:
    """Coefficients b0 and b1 of eq. 2.2 by Tustin's rule, in V/N.

    Parameters
    ----------
    gain, zero_time : float
        Of :func:`controller`, in V/(N s) and s.
    period : float
        Sample period in s.
    """
    return gain * (zero_time + period / 2.0), gain * (period / 2.0 - zero_time)


def continuous_coefficients(
    b0: float, b1: float, period: float = SAMPLE_PERIOD
) -> tuple[float, float]:
    """Inverse of :func:`discrete_coefficients`: gain in V/(N s) and time of the zero in s."""
    gain = (b0 + b1) / period
    return gain, (b0 - b1) / (2.0 * gain)


def sample_and_hold(period: float = SAMPLE_PERIOD) -> Any:
    """Appendix A1's stand-in for the zero-order hold, (2/T) / (s + 2/T).

    Returns
    -------
    control.TransferFunction
    """
    return control.tf([2.0 / period], [1.0, 2.0 / period])


def force_filter(cutoff: float = 100.0) -> Any:
    """First-order filter of the load cell; ``cutoff`` in Hz.

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
    **about_plant: Any,
) -> Any:
    """Loop transfer function: controller, hold, plant and filter.

    Parameters
    ----------
    gain, zero_time : float
        Of :func:`controller`.
    period : float or None
        Sample period in s; None leaves the hold out.
    cutoff : float or None
        Cutoff frequency of the load-cell filter in Hz; None leaves the filter out.
    **about_plant
        Passed to :func:`plant`.

    Returns
    -------
    control.TransferFunction
    """
    result = controller(gain, zero_time) * plant(**about_plant)
    if period is not None:
        result = result * sample_and_hold(period)
    if cutoff is not None:
        result = result * force_filter(cutoff)
    return result


def margins(system: Any) -> Margins:
    """Gain and phase margin of a loop transfer function, with their frequencies in Hz."""
    gain, phase, phase_crossover, crossover = control.margin(system)
    return Margins(
        float(phase),
        float(crossover) / (2.0 * pi),
        float(gain),
        float(phase_crossover) / (2.0 * pi),
    )


def bode(system: Any, frequencies: Array) -> tuple[Array, Array]:
    """Bode data of fig. 2-5.

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
        In degrees, without jumps.
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
    **about_plant: Any,
) -> Array:
    """Force after a step of 1 N of the reference (fig. 2-6), the filter being in the feedback path
    as in A1.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Evenly spaced seconds from 0.
    gain, zero_time, period, cutoff, **about_plant
        As for :func:`loop`.

    Returns
    -------
    ndarray, shape (n,)
        In N.
    """
    forward = loop(gain, zero_time, period=period, cutoff=None, **about_plant)
    back = 1.0 if cutoff is None else force_filter(cutoff)
    return np.asarray(control.step_response(control.feedback(forward, back), time).outputs)


def rise_time(time: Array, response: Array, final: float = 1.0) -> float:
    """Time in s at which a response first reaches 63.2 % of its final value, interpolated; NaN if
    it does not.
    """
    share = np.asarray(response) / final
    above = np.flatnonzero(share >= 1.0 - np.exp(-1.0))
    if not len(above):
        return float("nan")
    i = max(int(above[0]), 1)
    return float(np.interp(1.0 - np.exp(-1.0), share[i - 1 : i + 1], time[i - 1 : i + 1]))
