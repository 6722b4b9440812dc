"""Statics of the foot: joint torques, and stiffness and damping of the actuators seen at the toe.

Antagonists act in parallel: their stiffnesses add at the joint, ``K = R^T K_l R`` with ``R =
dl/dtheta``. Eq. 5.7 adds compliances instead (``docs/errata.md``, row 13).
"""

from __future__ import annotations

from typing import Any

from ..kit import Input, Output, Parameter, PowerPort, maximum, shared
from .kinematics import ACTUATORS, FootKinematics

_FIGURE = "thesis fig. 5-7, 12-layer actuator"
# Determinant of J over ankle and mtp below which the toe counts as locked, in m^2; within the
# joints' ranges it is above 1e-4. It keeps the damping of a singular posture finite.
_LOCKED = 1e-9


def _stiffness(actuator: str) -> Any:
    return Parameter(
        9100.0,
        "N/m",
        min=1e-3,
        max=1e12,
        nominal=1e4,
        source=_FIGURE,
        doc=f"stiffness of the {actuator} actuator",
    )


def _damping(actuator: str) -> Any:
    return Parameter(
        1.7e6,
        "N*s/m",
        min=1e-3,
        max=1e15,
        nominal=1e6,
        source=_FIGURE,
        doc=f"damping of the {actuator} actuator",
    )


def _muscle(actuator: str) -> PowerPort:
    """Return the port of an actuator that pulls on the foot, its other end being fixed."""
    length = f"{actuator}_length_change"
    tension = f"{actuator}_tension"
    return PowerPort(actuator, "translational", length, tension, (actuator,), delivers=True)


class FootStatics(FootKinematics):
    """Forces in the foot, common to given and dynamic posture."""

    muscles = tuple(map(_muscle, ACTUATORS))
    ports = (
        *muscles,
        PowerPort("toe_along_leg", "translational", "toe_x", "toe_force_x", ("toe_flange_x",)),
        PowerPort("toe_forward", "translational", "toe_y", "toe_force_y", ("toe_flange_y",)),
    )

    k_an, k_po, k_do, k_pl = (_stiffness(actuator) for actuator in ACTUATORS)
    b_an, b_po, b_do, b_pl = (_damping(actuator) for actuator in ACTUATORS)
    tm_stiffness = Parameter(
        100.0,
        "N*m/rad",
        min=1e-3,
        max=1e9,
        source="assumed: ten times that of the ankle",
        doc="stiffness of the arch, in the tarsal-metatarsal joint, which no actuator crosses",
    )

    an_tension = Input("N", doc="tension in the an actuator (anterior, lifts the foot)")
    po_tension = Input("N", doc="tension in the po actuator (posterior, presses the foot down)")
    do_tension = Input("N", doc="tension in the do actuator (dorsal, lifts the toe)")
    pl_tension = Input("N", doc="tension in the pl actuator (plantar, bends the toe down)")
    toe_force_x = Input("N", doc="force of the ground on the toe along x (down along the leg)")
    toe_force_y = Input("N", doc="force of the ground on the toe along y (forward)")

    def tensions(self) -> tuple[Any, Any, Any, Any]:
        """Tensions of an, po, do and pl as they pull on the joints."""
        return self.an_tension, self.po_tension, self.do_tension, self.pl_tension

    @shared
    def joint_torques(self) -> tuple[Any, Any, Any]:
        """Torques on ankle, tm and mtp by tensions and toe force, J^T F - R^T T, positive in
        dorsiflexion.
        """
        ankle, tm, mtp = (x * self.toe_force_x + y * self.toe_force_y for x, y in self.jacobian())
        an, po, do, pl = self.tensions()
        ankle_pull = self.an_arm() * an + self.po_arm() * po
        mtp_pull = self.do_arm() * do + self.pl_arm() * pl
        return ankle - ankle_pull, tm, mtp - mtp_pull

    @shared
    def joint_stiffnesses(self) -> tuple[Any, Any, Any]:
        """Stiffnesses of ankle, tm and mtp: R^T K_l R, which is diagonal, with the arch."""
        ankle = (
            self.k_an * self.an_arm() * self.an_arm() + self.k_po * self.po_arm() * self.po_arm()
        )
        mtp = self.k_do * self.do_arm() * self.do_arm() + self.k_pl * self.pl_arm() * self.pl_arm()
        return ankle, self.tm_stiffness, mtp

    @shared
    def shape_dampings(self) -> tuple[Any, Any]:
        """Damping of ankle and mtp by the actuators, R^T B_l R, at the size of table 5-1."""
        an, po, do, pl = self.arms()
        return self.b_an * an * an + self.b_po * po * po, self.b_do * do * do + self.b_pl * pl * pl

    def compliance(self, row: int, column: int) -> Any:
        """Entry of C = J K^-1 J^T, toe displacement per toe force."""
        pairs = zip(self.jacobian(), self.joint_stiffnesses(), strict=True)
        return sum(j[row] * j[column] / stiffness for j, stiffness in pairs)

    def damping(self, row: int, column: int) -> Any:
        """Entry of J^-T D J^-1 over ankle and mtp: toe force per toe velocity while the arch does
        not move.

        Arms and J are proportional to ``scale``, so that the damping does not depend on it.
        """
        ankle, _, mtp = self.shape_jacobian()
        # J^-1 has the rows -mtp_normal and ankle_normal over the determinant of J
        ankle_normal = (-ankle[1], ankle[0])
        mtp_normal = (-mtp[1], mtp[0])
        determinant = ankle[0] * mtp[1] - ankle[1] * mtp[0]
        of_ankle, of_mtp = self.shape_dampings()
        numerator = (
            of_ankle * mtp_normal[row] * mtp_normal[column]
            + of_mtp * ankle_normal[row] * ankle_normal[column]
        )
        return numerator / maximum(determinant * determinant, _LOCKED * _LOCKED)

    # --- outputs
    # ----------------------------------------------------------------------------------------------

    @Output("N*m", nominal=0.1)
    def ankle_torque(self) -> Any:
        """Torque of tensions and toe force on the ankle, positive in dorsiflexion."""
        return self.joint_torques()[0]

    @Output("N*m", nominal=0.1)
    def tm_torque(self) -> Any:
        """Torque of the toe force on the tarsal-metatarsal joint, positive in dorsiflexion."""
        return self.joint_torques()[1]

    @Output("N*m", nominal=0.1)
    def mtp_torque(self) -> Any:
        """Torque of tensions and toe force on the metatarsal-phalangeal joint, positive in
        dorsiflexion.
        """
        return self.joint_torques()[2]

    @Output("m/N", nominal=1e-3, display="mm/N")
    def toe_compliance_xx(self) -> Any:
        """Compliance of the toe, displacement along x per force along x."""
        return self.compliance(0, 0)

    @Output("m/N", nominal=1e-3, display="mm/N")
    def toe_compliance_xy(self) -> Any:
        """Compliance of the toe, displacement along x per force along y, and the reverse."""
        return self.compliance(0, 1)

    @Output("m/N", nominal=1e-3, display="mm/N")
    def toe_compliance_yy(self) -> Any:
        """Compliance of the toe, displacement along y per force along y."""
        return self.compliance(1, 1)

    @Output("N*s/m", nominal=1e6)
    def toe_damping_xx(self) -> Any:
        """Damping of the toe, force along x per velocity along x."""
        return self.damping(0, 0)

    @Output("N*s/m", nominal=1e6)
    def toe_damping_xy(self) -> Any:
        """Damping of the toe, force along x per velocity along y, and the reverse."""
        return self.damping(0, 1)

    @Output("N*s/m", nominal=1e6)
    def toe_damping_yy(self) -> Any:
        """Damping of the toe, force along y per velocity along y."""
        return self.damping(1, 1)
