"""Stance phase of the gait, eqs. 5.13-5.16, and the joint angle of a given actuator length.

Eq. 5.16 as printed repeats eq. 5.15; the plantar length is that of the M-file (``docs/errata.md``,
row 14). The four lengths together are not a motion of a rigid foot: antagonists of unequal moment
arms cannot both move by 1 mm.
"""

from __future__ import annotations

import math
from typing import Any

from ..kit import UserError, sin
from .kinematics import ACTUATORS as ACTUATORS
from .kinematics import FootKinematics

_AMPLITUDE = 1e-3  # m
_PERIOD = 1.0  # s


def length_changes(time: Any) -> dict[str, Any]:
    """Return the change of each actuator's length in the stance phase (eqs. 5.13-5.16).

    Parameters
    ----------
    time : float or ndarray
        Since contact, in seconds.

    Returns
    -------
    dict of str to float or ndarray
        Actuator to change from the reference length, in metres.
    """
    wave = _AMPLITUDE * sin(2.0 * math.pi / _PERIOD * time)
    return {"an": -wave, "po": wave, "do": -wave - _AMPLITUDE, "pl": wave + _AMPLITUDE}


def lengths(time: Any, foot: FootKinematics) -> dict[str, Any]:
    """Return the length of each actuator in the stance phase, in m; see :func:`length_changes`."""
    return {
        a: foot.scale * getattr(foot, f"l_{a}") + change
        for a, change in length_changes(time).items()
    }


def joint_angle(foot: FootKinematics, actuator: str, length: float) -> float:
    """Return the angle of an actuator's joint at which the actuator has a given length.

    Parameters
    ----------
    foot : FootKinematics
        Foot that has the geometry; its posture is not used.
    actuator : {"an", "po", "do", "pl"}
    length : float
        In metres.

    Returns
    -------
    float
        In rad; of two solutions the one on the side of the reference configuration. For ``an`` and
        ``po`` it is the angle of the ankle, for ``do`` and ``pl`` that of the metatarsal-phalangeal
        joint.

    Raises
    ------
    UserError
        If there is no such actuator, or the length cannot be reached.
    """
    if actuator not in ACTUATORS:
        raise UserError(f"no actuator named {actuator!r}; there are {', '.join(ACTUATORS)}")
    if not math.isfinite(length):
        raise UserError(f"length {length:g} m of actuator {actuator!r} is not a finite number")
    if actuator == "pl":
        return float((length / foot.scale - foot.l_pl) / foot.r_pl)
    unscaled_length, unscaled_radius, angle, _ = getattr(foot, f"{actuator}_triangle")()
    reference = foot.scale * unscaled_length
    radius = foot.scale * unscaled_radius
    # the origin of the actuator as seen from the joint, along the radius and across it
    along = radius - reference * math.cos(angle)
    across = reference * math.sin(angle)
    base = math.hypot(along, across)
    if not abs(base - radius) < length < base + radius:
        raise UserError(
            f"length {length:g} m of actuator {actuator!r} cannot be reached: its triangle closes"
            f" between {abs(base - radius):.6g} m and {base + radius:.6g} m"
        )
    # angle at the joint by the law of cosines, less that of the reference configuration
    cosine = (base**2 + radius**2 - length**2) / (2.0 * base * radius)
    rotation = math.acos(cosine) - math.atan2(across, along)
    return rotation if actuator == "po" else -rotation
