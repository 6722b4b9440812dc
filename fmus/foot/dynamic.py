"""The dynamic foot: torques accelerate its joints, which end at soft stops."""

from __future__ import annotations

from typing import Any

from ..kit import Parameter, State, outside
from .statics import FootStatics


def _inertia(default: float, joint: str) -> Any:
    return Parameter(
        default,
        "kg*m^2",
        min=1e-7,
        max=1.0,
        nominal=1e-4,
        source="assumed",
        doc=f"moment of inertia about the {joint}",
    )


def _friction(default: float, joint: str) -> Any:
    return Parameter(
        default,
        "N*m*s/rad",
        min=0,
        max=1e3,
        nominal=1e-2,
        source="assumed",
        doc=f"damping in the {joint}",
    )


def _limit(default: float, low: float, high: float, doc: str) -> Any:
    return Parameter(default, "rad", min=low, max=high, display="deg", source="assumed", doc=doc)


class FootDynamic(FootStatics):
    """Foot that moves under tensions and toe force: joint inertias, damping, the arch as a spring,
    and soft stops.

    The leg is still fixed and the inertias are not coupled: each joint carries what it moves as one
    constant inertia.
    """

    name = "foot_dynamic"
    experiment = (1.0, 0.01)

    ankle_inertia = _inertia(1e-3, "ankle")
    tm_inertia = _inertia(5e-4, "tarsal-metatarsal joint")
    mtp_inertia = _inertia(2e-5, "metatarsal-phalangeal joint")
    ankle_damping = _friction(0.02, "ankle")
    tm_damping = _friction(0.2, "tarsal-metatarsal joint")
    mtp_damping = _friction(1e-3, "metatarsal-phalangeal joint")
    ankle_lower = _limit(-0.7, -0.7, 0.0, "angle of the ankle at which plantarflexion is stopped")
    ankle_upper = _limit(0.7, 0.0, 0.7, "angle of the ankle at which dorsiflexion is stopped")
    tm_lower = _limit(
        -0.26, -0.26, 0.0, "angle of the tarsal-metatarsal joint at which plantarflexion is stopped"
    )
    tm_upper = _limit(
        0.26, 0.0, 0.26, "angle of the tarsal-metatarsal joint at which dorsiflexion is stopped"
    )
    mtp_lower = _limit(-0.15, -0.15, 0.0, "angle of the toe at which plantarflexion is stopped")
    mtp_upper = _limit(1.05, 0.0, 1.05, "angle of the toe at which dorsiflexion is stopped")
    stop_frequency = Parameter(
        200.0,
        "rad/s",
        min=1.0,
        max=1e4,
        nominal=100.0,
        source="assumed",
        doc=(
            "natural frequency of each joint's inertia on its stop; the stop's stiffness is its"
            " square times inertia"
        ),
    )

    ankle_angle = State(
        "rad",
        rate="ankle_rate_law",
        min=-1.5,
        max=1.5,
        nominal=0.5,
        display="deg",
        output=True,
        doc="angle of the ankle, zero in the reference configuration",
    )
    tm_angle = State(
        "rad",
        rate="tm_rate_law",
        min=-1.5,
        max=1.5,
        nominal=0.1,
        display="deg",
        output=True,
        doc="angle of the tarsal-metatarsal joint",
    )
    mtp_angle = State(
        "rad",
        rate="mtp_rate_law",
        min=-1.5,
        max=1.5,
        nominal=0.5,
        display="deg",
        output=True,
        doc="angle of the metatarsal-phalangeal joint",
    )
    ankle_rate = State(
        "rad/s",
        rate="ankle_acceleration",
        nominal=0.1,
        display="deg/s",
        output=True,
        doc="angular velocity of the ankle",
    )
    tm_rate = State(
        "rad/s",
        rate="tm_acceleration",
        nominal=1e-2,
        display="deg/s",
        output=True,
        doc="angular velocity of the tarsal-metatarsal joint",
    )
    mtp_rate = State(
        "rad/s",
        rate="mtp_acceleration",
        nominal=0.1,
        display="deg/s",
        output=True,
        doc="angular velocity of the metatarsal-phalangeal joint",
    )

    def ankle_rate_law(self) -> Any:
        """Rate of the ankle's angle."""
        return self.ankle_rate

    def tm_rate_law(self) -> Any:
        """Rate of the tarsal-metatarsal joint's angle."""
        return self.tm_rate

    def mtp_rate_law(self) -> Any:
        """Rate of the metatarsal-phalangeal joint's angle."""
        return self.mtp_rate

    def stop(self, angle: Any, lower: Any, upper: Any) -> Any:
        """Angular acceleration by a soft stop: zero between the limits, proportional to the excess
        beyond them.
        """
        return -self.stop_frequency * self.stop_frequency * outside(angle, lower, upper)

    def ankle_friction(self) -> Any:
        """Friction torque of the ankle."""
        return self.ankle_damping * self.ankle_rate

    def tm_friction(self) -> Any:
        """Friction torque of the tarsal-metatarsal joint."""
        return self.tm_damping * self.tm_rate

    def mtp_friction(self) -> Any:
        """Friction torque of the metatarsal-phalangeal joint."""
        return self.mtp_damping * self.mtp_rate

    def arch_torque(self) -> Any:
        """Restoring torque of the arch."""
        return self.tm_stiffness * self.tm_angle

    def ankle_acceleration(self) -> Any:
        """Angular acceleration of the ankle."""
        torque = self.joint_torques()[0] - self.ankle_friction()
        return torque / self.ankle_inertia + self.stop(
            self.ankle_angle, self.ankle_lower, self.ankle_upper
        )

    def tm_acceleration(self) -> Any:
        """Angular acceleration of the tarsal-metatarsal joint, with the torque of the arch."""
        torque = self.joint_torques()[1] - self.tm_friction() - self.arch_torque()
        return torque / self.tm_inertia + self.stop(self.tm_angle, self.tm_lower, self.tm_upper)

    def mtp_acceleration(self) -> Any:
        """Angular acceleration of the metatarsal-phalangeal joint."""
        torque = self.joint_torques()[2] - self.mtp_friction()
        return torque / self.mtp_inertia + self.stop(self.mtp_angle, self.mtp_lower, self.mtp_upper)
