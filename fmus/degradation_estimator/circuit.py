"""Circuit of an estimate, R2 across R1 and C in series (fig. 4-2), and its impedance.

An estimate is ``b0``, ``b1`` and ``a`` of ``v(t) = b0 i(t) + b1 i(t-1) - a v(t-1)`` (eq. 4.6), a
circuit is ``R1``, ``R2`` and ``C``.
"""

from __future__ import annotations

from typing import Any

from ..kit import clip, hypot, log, logical_and, where
from .recursion import Vector

# Smallest resistance, in ohm, and smallest decay per sample of a circuit that can be computed.
_SMALL = 1e-9


def is_circuit(estimate: Vector, zero_order_hold: Any) -> Any:
    """Return whether an estimate is that of a circuit with positive R1, R2 and C.

    Parameters are those of :func:`circuit_parameters`, whose formulas are positive then.
    """
    b0, b1, a = estimate
    decays = logical_and(1.0 + a > _SMALL, where(zero_order_hold, -a, b0 - b1) > _SMALL)
    are_resistances = logical_and(b0 > _SMALL, b0 + b1 > _SMALL)
    return logical_and(decays, logical_and(are_resistances, b1 - a * b0 > _SMALL))


def circuit_parameters(estimate: Vector, zero_order_hold: Any, period: Any) -> Vector:
    """Return R1, R2 and C of an estimate, by zero-order hold or Tustin's rule (eqs. 4.3-4.5).

    With a zero-order hold of the current, ``a = -exp(-T_s / tau)``, ``b0 = R1 R2 / (R1 + R2)`` and
    ``b1 = (1 + a) R2 - b0``, where ``tau = (R1 + R2) C``.

    Parameters
    ----------
    estimate : tuple of 3
    zero_order_hold : bool
        Whether the current is constant between samples; else Tustin's rule.
    period : float
        Sample period T_s in seconds.

    Returns
    -------
    tuple of 3
        R1 (ohm), R2 (ohm) and C (F); arbitrary finite numbers unless it :func:`is_circuit`.
    """
    b0, b1, a = estimate
    known = is_circuit(estimate, zero_order_hold)
    total = where(known, b0 + b1, 1.0)  # (1 + a) R2
    excess = where(known, b1 - a * b0, 1.0)  # with a hold (1 + a) R2^2 / (R1 + R2)
    R2 = total / where(known, 1.0 + a, 1.0)
    R1_with_hold = b0 * total / excess
    R1_by_tustin = total * (b0 - b1) / (2.0 * excess)
    R1 = where(zero_order_hold, R1_with_hold, R1_by_tustin)
    log_of_pole = log(clip(where(known, -a, 0.5), _SMALL, 1.0 - _SMALL))  # -T_s / tau
    C_with_hold = -period / (log_of_pole * where(known, R1 + R2, 1.0))
    C_by_tustin = excess * period / (total * total)
    return R1, R2, where(zero_order_hold, C_with_hold, C_by_tustin)


def magnitude(circuit: Vector, angular_frequency: Any) -> Any:
    """Return the magnitude of a circuit's impedance in ohm, at an angular frequency in rad/s
    (eq. 4.10).
    """
    R1, R2, C = circuit
    return (
        R2 * hypot(1.0, R1 * C * angular_frequency) / hypot(1.0, (R1 + R2) * C * angular_frequency)
    )
