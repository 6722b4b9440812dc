"""The humanoid foot with a given posture; this module offers the moving ones, too.

Thesis chapter 5: geometry in ``kinematics.py``, forces in ``statics.py``, motion in ``dynamic.py``,
with a leg that moves and a ground in ``free.py``, and with its actuators in ``driven.py``.
"""

from __future__ import annotations

from ..kit import Input, PowerPort
from .driven import FootDisplacementDriven
from .dynamic import FootDynamic
from .free import FootFree
from .statics import FootStatics

__all__ = ["Foot", "FootDisplacementDriven", "FootDynamic", "FootFree"]


def _joint(name: str) -> PowerPort:
    """Return the port of a joint; the source of the angle bears the torque."""
    angle = f"{name}_angle"
    torque = f"{name}_torque"
    return PowerPort(name, "rotational", angle, torque, (name,), delivers=True, rate=f"{name}_rate")


class Foot(FootStatics):
    """Foot whose joint angles are given (thesis eqs. 5.2-5.10, antagonists in parallel)."""

    name = "foot"
    ports = (*FootStatics.ports, *map(_joint, ("ankle", "tm", "mtp")))
    experiment = (1.0, 0.01)

    ankle_angle = Input(
        "rad",
        min=-0.7,
        max=0.7,
        nominal=0.1,
        display="deg",
        doc="angle of the ankle, zero in the reference",
    )
    tm_angle = Input(
        "rad",
        min=-0.26,
        max=0.26,
        nominal=0.1,
        display="deg",
        doc="angle of the tarsal-metatarsal joint",
    )
    mtp_angle = Input(
        "rad",
        min=-0.15,
        max=1.05,
        nominal=0.1,
        display="deg",
        doc="angle of the metatarsal-phalangeal joint",
    )
    ankle_rate = Input("rad/s", display="deg/s", doc="angular velocity of the ankle")
    tm_rate = Input("rad/s", display="deg/s", doc="angular velocity of the tarsal-metatarsal joint")
    mtp_rate = Input(
        "rad/s", display="deg/s", doc="angular velocity of the metatarsal-phalangeal joint"
    )
