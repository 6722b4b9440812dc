"""The humanoid foot: actuator lengths, toe position, torques, compliance and damping at the toe, for any posture.

Thesis chapter 5, eqs. 5.2-5.10, table 5-1. Three revolute joints in a row, ``ankle``, ``tm`` and ``mtp``; four
actuators, ``an`` and ``po`` on the ankle, ``do`` and ``pl`` on the toe. Angles are zero in the reference
configuration and positive in dorsiflexion (toes up). The frame is fixed to the leg with its origin in the ankle, x down
along the leg and y forward, as eq. 5.3 has it.

Antagonists act in parallel: their stiffnesses add at the joint, ``K = R^T K_l R`` with ``R = dl/dtheta``. That is not
eq. 5.7, which adds compliances (``docs/errata.md``, row 13); eqs. 5.11 and 5.12 as printed are in ``thesis.py``.
"""

from __future__ import annotations

from math import radians
from typing import Any

from ..kit import Component, Input, Output, Parameter, Preset, State, cos, maximum, minimum, sin, sqrt

_TABLE = "thesis table 5-1"
_FIGURE = "thesis fig. 5-7, 12-layer actuator"


def _angle(degrees: float, low: float, high: float, doc: str) -> Any:
    return Parameter(radians(degrees), "rad", min=low, max=high, nominal=0.1, display="deg", source=_TABLE, doc=doc)


def _length(metres: float, low: float, high: float, doc: str) -> Any:
    return Parameter(metres, "m", min=low, max=high, nominal=1e-2, display="mm", source=_TABLE, doc=doc)


def _stiffness(actuator: str) -> Any:
    return Parameter(
        9100.0, "N/m", min=1e-3, max=1e12, nominal=1e4, source=_FIGURE, doc=f"stiffness of the {actuator} actuator"
    )


def _damping(actuator: str) -> Any:
    return Parameter(
        1.7e6, "N*s/m", min=1e-3, max=1e15, nominal=1e6, source=_FIGURE, doc=f"damping of the {actuator} actuator"
    )


def attached_length(length: Any, radius: Any, angle: Any, turn: Any) -> Any:
    """Length of an actuator whose attachment has turned about the joint, by the law of cosines.

    Parameters
    ----------
    length : float
        Length at no turn, in metres.
    radius : float
        From the joint to the attachment, in metres.
    angle : float
        Between actuator and radius at the attachment, at no turn, in rad.
    turn : float
        Rotation of the attachment about the joint in rad, positive where it lengthens the actuator.

    Returns
    -------
    float
        In metres: ``l^2 = l0^2 + 2 r ((r - l0 cos(angle)) (1 - cos(turn)) + l0 sin(angle) sin(turn))``.
    """
    along = radius - length * cos(angle)
    half = sin(0.5 * turn)  # 1 - cos(turn) = 2 half^2 without cancellation
    return sqrt(length * length + 2.0 * radius * (2.0 * along * half * half + length * sin(angle) * sin(turn)))


def attached_arm(length: Any, radius: Any, angle: Any, turn: Any) -> Any:
    """Moment arm of such an actuator, the derivative of :func:`attached_length` with respect to ``turn``, in m/rad."""
    along = radius - length * cos(angle)
    across = length * sin(angle)
    return radius * (along * sin(turn) + across * cos(turn)) / attached_length(length, radius, angle, turn)


class FootGeometry(Component):
    """What both forms of the foot share: geometry, statics, compliance and damping."""

    scale = Parameter(1.0, "1", min=0.1, max=10.0, source=_TABLE, doc="size of the foot relative to table 5-1")
    l1 = _length(0.0508, 0.045, 0.06, "link 1, ankle to tarsal-metatarsal joint")
    l2 = _length(0.0625, 0.055, 0.07, "link 2, tarsal-metatarsal to metatarsal-phalangeal joint")
    l3 = _length(0.0236, 0.015, 0.04, "link 3, metatarsal-phalangeal joint to the middle of the first phalanx")
    l_an = _length(0.0975, 0.08, 0.12, "length of the an actuator in the reference configuration")
    l_po = _length(0.0932, 0.085, 0.12, "length of the po actuator in the reference configuration")
    l_do = _length(0.1133, 0.09, 0.14, "length of the do actuator in the reference configuration")
    l_pl = _length(0.1392, 0.1, 0.18, "length of the pl actuator in the reference configuration")
    r_an = _length(0.0180, 0.01, 0.03, "radius from the ankle to the attachment of an")
    r_po = _length(0.0417, 0.03, 0.045, "radius from the ankle to the attachment of po")
    r_do = _length(0.0231, 0.01, 0.03, "radius from the metatarsal-phalangeal joint to the attachment of do")
    r_pl = _length(0.0163, 0.005, 0.03, "radius on which the tendon of pl lies about the metatarsal-phalangeal joint")
    beta_pf = _angle(49.0, 0.7, 1.0, "angle of link 1 from the x axis in the reference configuration")
    beta_df = _angle(30.9, 0.45, 0.7, "angle of link 2 from link 1 in the reference configuration (printed af)")
    beta_p = _angle(10.1, 0.15, 0.3, "angle of link 3 from link 2 in the reference configuration")
    beta_an = _angle(50.7, 0.6, 1.3, "angle locating the attachment of an, from the leg")
    beta_po = _angle(57.7, 0.9, 1.3, "angle locating the attachment of po, from the leg")
    gamma_an = _angle(6.1, 0.0, 0.3, "angle of the an actuator from the leg")
    gamma_po = _angle(12.9, 0.0, 0.3, "angle of the po actuator from the leg")
    gamma_do = _angle(15.1, 0.05, 0.6, "angle between the do actuator and its attachment radius")
    k_an, k_po, k_do, k_pl = (_stiffness(actuator) for actuator in ("an", "po", "do", "pl"))
    b_an, b_po, b_do, b_pl = (_damping(actuator) for actuator in ("an", "po", "do", "pl"))
    tm_stiffness = Parameter(
        100.0, "N*m/rad", min=1e-3, max=1e9, source="assumed: ten times that of the ankle",
        doc="stiffness of the arch, in the tarsal-metatarsal joint, which no actuator crosses",
    )  # fmt: skip

    an_tension = Input("N", doc="tension in the an actuator (anterior, lifts the foot)")
    po_tension = Input("N", doc="tension in the po actuator (posterior, presses the foot down)")
    do_tension = Input("N", doc="tension in the do actuator (dorsal, lifts the toe)")
    pl_tension = Input("N", doc="tension in the pl actuator (plantar, bends the toe down)")
    toe_force_x = Input("N", doc="force of the ground on the toe along x (down along the leg)")
    toe_force_y = Input("N", doc="force of the ground on the toe along y (forward)")

    # Posture and its rate, in rad and rad/s: inputs of one form, states of the other.
    ankle_angle: Any
    tm_angle: Any
    mtp_angle: Any
    ankle_rate: Any
    tm_rate: Any
    mtp_rate: Any

    # --- actuators: lengths, and R = dl/dtheta, which has one entry for each ---------------------------------------

    def an_triangle(self) -> tuple[Any, Any, Any, Any]:
        """Length, radius and angle of an, and how far its attachment has turned: dorsiflexion shortens it."""
        return self.l_an, self.r_an, self.beta_an - self.gamma_an, -self.ankle_angle

    def po_triangle(self) -> tuple[Any, Any, Any, Any]:
        """Length, radius and angle of po, and how far its attachment has turned: dorsiflexion lengthens it."""
        return self.l_po, self.r_po, self.beta_po - self.gamma_po, self.ankle_angle

    def do_triangle(self) -> tuple[Any, Any, Any, Any]:
        """Length, radius and angle of do, and how far its attachment has turned: dorsiflexion shortens it."""
        return self.l_do, self.r_do, self.gamma_do, -self.mtp_angle

    def arms(self) -> tuple[Any, Any, Any, Any]:
        """Moment arms of an, po, do and pl at the size of table 5-1; only scale multiplies them."""
        an, do = -attached_arm(*self.an_triangle()), -attached_arm(*self.do_triangle())
        return an, attached_arm(*self.po_triangle()), do, self.r_pl

    def an_arm(self) -> Any:
        """Moment arm of an, dl/dtheta of the ankle; negative."""
        return self.scale * self.arms()[0]

    def po_arm(self) -> Any:
        """Moment arm of po, dl/dtheta of the ankle; positive."""
        return self.scale * self.arms()[1]

    def do_arm(self) -> Any:
        """Moment arm of do, dl/dtheta of the metatarsal-phalangeal joint; negative."""
        return self.scale * self.arms()[2]

    def pl_arm(self) -> Any:
        """Moment arm of pl, dl/dtheta of the metatarsal-phalangeal joint: the radius its tendon lies on."""
        return self.scale * self.arms()[3]

    # --- toe: position and J = dx/dtheta (eq. 5.3) ------------------------------------------------------------------

    def link_angles(self) -> tuple[Any, Any, Any]:
        """Angles of the three links from the x axis."""
        first = self.beta_pf + self.ankle_angle
        second = first + self.beta_df + self.tm_angle
        return first, second, second + self.beta_p + self.mtp_angle

    def toe_position(self) -> tuple[Any, Any]:
        """Middle of the first phalanx, x and y."""
        pairs = list(zip((self.l1, self.l2, self.l3), self.link_angles(), strict=True))
        return self.scale * sum(l * cos(a) for l, a in pairs), self.scale * sum(l * sin(a) for l, a in pairs)

    def shape_jacobian(self) -> tuple[tuple[Any, Any], tuple[Any, Any], tuple[Any, Any]]:
        """Columns of J for ankle, tm and mtp at the size of table 5-1."""
        first, second, third = self.link_angles()
        mtp = -self.l3 * sin(third), self.l3 * cos(third)
        tm = mtp[0] - self.l2 * sin(second), mtp[1] + self.l2 * cos(second)
        return (tm[0] - self.l1 * sin(first), tm[1] + self.l1 * cos(first)), tm, mtp

    def jacobian(self) -> list[tuple[Any, Any]]:
        """Columns of J for ankle, tm and mtp (eq. 5.3): derivatives of x and y."""
        return [(self.scale * x, self.scale * y) for x, y in self.shape_jacobian()]

    def toe_velocity(self, axis: int) -> Any:
        """Velocity of the toe, J dtheta/dt (eq. 5.2), along x (0) or y (1)."""
        ankle, tm, mtp = self.jacobian()
        return ankle[axis] * self.ankle_rate + tm[axis] * self.tm_rate + mtp[axis] * self.mtp_rate

    # --- statics ----------------------------------------------------------------------------------------------------

    def joint_torques(self) -> tuple[Any, Any, Any]:
        """Torques on ankle, tm and mtp by tensions and toe force, J^T F - R^T T, positive in dorsiflexion."""
        ankle, tm, mtp = (x * self.toe_force_x + y * self.toe_force_y for x, y in self.jacobian())
        ankle_pull = self.an_arm() * self.an_tension + self.po_arm() * self.po_tension
        mtp_pull = self.do_arm() * self.do_tension + self.pl_arm() * self.pl_tension
        return ankle - ankle_pull, tm, mtp - mtp_pull

    def joint_stiffnesses(self) -> tuple[Any, Any, Any]:
        """Stiffnesses of ankle, tm and mtp: R^T K_l R, which is diagonal, with the arch."""
        ankle = self.k_an * self.an_arm() * self.an_arm() + self.k_po * self.po_arm() * self.po_arm()
        mtp = self.k_do * self.do_arm() * self.do_arm() + self.k_pl * self.pl_arm() * self.pl_arm()
        return ankle, self.tm_stiffness, mtp

    def shape_dampings(self) -> tuple[Any, Any]:
        """Damping of ankle and mtp by the actuators, R^T B_l R, at the size of table 5-1."""
        an, po, do, pl = self.arms()
        return self.b_an * an * an + self.b_po * po * po, self.b_do * do * do + self.b_pl * pl * pl

    def compliance(self, row: int, column: int) -> Any:
        """Entry of C = J K^-1 J^T, toe displacement per toe force."""
        pairs = list(zip(self.jacobian(), self.joint_stiffnesses(), strict=True))
        return sum(j[row] * j[column] / stiffness for j, stiffness in pairs)

    def damping(self, row: int, column: int) -> Any:
        """Entry of J^-T D J^-1 over ankle and mtp: toe force per toe velocity while the arch does not move.

        Arms and J are equally long, so that it is the same at any scale.
        """
        ankle, _, mtp = self.shape_jacobian()
        turned_ankle, turned_mtp = (-ankle[1], ankle[0]), (-mtp[1], mtp[0])
        determinant = ankle[0] * mtp[1] - ankle[1] * mtp[0]
        of_ankle, of_mtp = self.shape_dampings()
        products = of_ankle * turned_mtp[row] * turned_mtp[column] + of_mtp * turned_ankle[row] * turned_ankle[column]
        return products / (determinant * determinant)

    # --- outputs ----------------------------------------------------------------------------------------------------

    @Output("m", nominal=0.1, display="mm")
    def an_length(self) -> Any:
        """Length of the an actuator."""
        return self.scale * attached_length(*self.an_triangle())

    @Output("m", nominal=0.1, display="mm")
    def po_length(self) -> Any:
        """Length of the po actuator."""
        return self.scale * attached_length(*self.po_triangle())

    @Output("m", nominal=0.1, display="mm")
    def do_length(self) -> Any:
        """Length of the do actuator."""
        return self.scale * attached_length(*self.do_triangle())

    @Output("m", nominal=0.1, display="mm")
    def pl_length(self) -> Any:
        """Length of the pl actuator, whose tendon lies on its radius."""
        return self.scale * (self.l_pl + self.r_pl * self.mtp_angle)

    @Output("m/s", nominal=1e-2, display="mm/s")
    def an_length_rate(self) -> Any:
        """Rate of the length of the an actuator."""
        return self.an_arm() * self.ankle_rate

    @Output("m/s", nominal=1e-2, display="mm/s")
    def po_length_rate(self) -> Any:
        """Rate of the length of the po actuator."""
        return self.po_arm() * self.ankle_rate

    @Output("m/s", nominal=1e-2, display="mm/s")
    def do_length_rate(self) -> Any:
        """Rate of the length of the do actuator."""
        return self.do_arm() * self.mtp_rate

    @Output("m/s", nominal=1e-2, display="mm/s")
    def pl_length_rate(self) -> Any:
        """Rate of the length of the pl actuator."""
        return self.pl_arm() * self.mtp_rate

    @Output("m", nominal=0.1, display="mm")
    def toe_x(self) -> Any:
        """Position of the toe along x (down along the leg)."""
        return self.toe_position()[0]

    @Output("m", nominal=0.1, display="mm")
    def toe_y(self) -> Any:
        """Position of the toe along y (forward)."""
        return self.toe_position()[1]

    @Output("m/s", nominal=0.1, display="mm/s")
    def toe_velocity_x(self) -> Any:
        """Velocity of the toe along x."""
        return self.toe_velocity(0)

    @Output("m/s", nominal=0.1, display="mm/s")
    def toe_velocity_y(self) -> Any:
        """Velocity of the toe along y."""
        return self.toe_velocity(1)

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
        """Torque of tensions and toe force on the metatarsal-phalangeal joint, positive in dorsiflexion."""
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

    presets = {
        "prototype": Preset({"scale": 2.5}, doc="the printed 2.5:1 prototype (thesis section 5.2, fig. 5-3)"),
    }


class Foot(FootGeometry):
    """Foot whose joint angles are given (thesis eqs. 5.2-5.10, antagonists in parallel)."""

    name = "foot"
    experiment = (1.0, 0.01)

    ankle_angle = Input(
        "rad", min=-0.7, max=0.7, nominal=0.1, display="deg", doc="angle of the ankle, zero in the reference"
    )
    tm_angle = Input("rad", min=-0.26, max=0.26, nominal=0.1, display="deg", doc="angle of the tarsal-metatarsal joint")
    mtp_angle = Input(
        "rad", min=-0.15, max=1.05, nominal=0.1, display="deg", doc="angle of the metatarsal-phalangeal joint"
    )
    ankle_rate = Input("rad/s", display="deg/s", doc="angular velocity of the ankle")
    tm_rate = Input("rad/s", display="deg/s", doc="angular velocity of the tarsal-metatarsal joint")
    mtp_rate = Input("rad/s", display="deg/s", doc="angular velocity of the metatarsal-phalangeal joint")


def _inertia(default: float, joint: str) -> Any:
    return Parameter(
        default, "kg*m^2", min=1e-7, max=1.0, nominal=1e-4, source="assumed", doc=f"moment of inertia about the {joint}"
    )


def _friction(default: float, joint: str) -> Any:
    return Parameter(
        default, "N*m*s/rad", min=0, max=1e3, nominal=1e-2, source="assumed", doc=f"damping in the {joint}"
    )


def _limit(default: float, low: float, high: float, doc: str) -> Any:
    return Parameter(default, "rad", min=low, max=high, display="deg", source="assumed", doc=doc)


class FootDynamic(FootGeometry):
    """Foot that moves under tensions and toe force: joint inertias, damping, the arch as a spring, and soft stops.

    The leg is still fixed and the inertias are not coupled: each joint carries what it moves as one constant inertia.
    """

    name = "foot_dynamic"
    experiment = (1.0, 0.01)
    tolerance = 1e-10

    ankle_inertia = _inertia(1e-3, "ankle")
    tm_inertia = _inertia(5e-4, "tarsal-metatarsal joint")
    mtp_inertia = _inertia(2e-5, "metatarsal-phalangeal joint")
    ankle_damping = _friction(0.02, "ankle")
    tm_damping = _friction(0.2, "tarsal-metatarsal joint")
    mtp_damping = _friction(1e-3, "metatarsal-phalangeal joint")
    ankle_lower = _limit(-0.7, -0.7, 0.0, "angle of the ankle at which plantarflexion is stopped")
    ankle_upper = _limit(0.7, 0.0, 0.7, "angle of the ankle at which dorsiflexion is stopped")
    tm_lower = _limit(-0.26, -0.26, 0.0, "angle of the tarsal-metatarsal joint at which plantarflexion is stopped")
    tm_upper = _limit(0.26, 0.0, 0.26, "angle of the tarsal-metatarsal joint at which dorsiflexion is stopped")
    mtp_lower = _limit(-0.15, -0.15, 0.0, "angle of the toe at which plantarflexion is stopped")
    mtp_upper = _limit(1.05, 0.0, 1.05, "angle of the toe at which dorsiflexion is stopped")
    stop_frequency = Parameter(
        200.0, "rad/s", min=1.0, max=1e4, nominal=100.0, source="assumed",
        doc="natural frequency of each joint's inertia on its stop; the stop's stiffness is its square times inertia",
    )  # fmt: skip

    ankle_angle = State(
        "rad", rate="ankle_rate_law", min=-1.5, max=1.5, nominal=0.5, display="deg", output=True,
        doc="angle of the ankle, zero in the reference configuration",
    )  # fmt: skip
    tm_angle = State(
        "rad", rate="tm_rate_law", min=-1.5, max=1.5, nominal=0.1, display="deg", output=True,
        doc="angle of the tarsal-metatarsal joint",
    )  # fmt: skip
    mtp_angle = State(
        "rad", rate="mtp_rate_law", min=-1.5, max=1.5, nominal=0.5, display="deg", output=True,
        doc="angle of the metatarsal-phalangeal joint",
    )  # fmt: skip
    ankle_rate = State(
        "rad/s", rate="ankle_acceleration", nominal=0.1, display="deg/s", output=True,
        doc="angular velocity of the ankle",
    )  # fmt: skip
    tm_rate = State(
        "rad/s", rate="tm_acceleration", nominal=1e-2, display="deg/s", output=True,
        doc="angular velocity of the tarsal-metatarsal joint",
    )  # fmt: skip
    mtp_rate = State(
        "rad/s", rate="mtp_acceleration", nominal=0.1, display="deg/s", output=True,
        doc="angular velocity of the metatarsal-phalangeal joint",
    )  # fmt: skip

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
        """Angular acceleration that a soft stop gives: none between the limits, proportional to what is beyond."""
        beyond = maximum(angle - upper, 0.0) + minimum(angle - lower, 0.0)
        return -self.stop_frequency * self.stop_frequency * beyond

    def ankle_acceleration(self) -> Any:
        """Angular acceleration of the ankle."""
        torque = self.joint_torques()[0] - self.ankle_damping * self.ankle_rate
        return torque / self.ankle_inertia + self.stop(self.ankle_angle, self.ankle_lower, self.ankle_upper)

    def tm_acceleration(self) -> Any:
        """Angular acceleration of the tarsal-metatarsal joint, which the arch pulls back."""
        torque = self.joint_torques()[1] - self.tm_damping * self.tm_rate - self.tm_stiffness * self.tm_angle
        return torque / self.tm_inertia + self.stop(self.tm_angle, self.tm_lower, self.tm_upper)

    def mtp_acceleration(self) -> Any:
        """Angular acceleration of the metatarsal-phalangeal joint."""
        torque = self.joint_torques()[2] - self.mtp_damping * self.mtp_rate
        return torque / self.mtp_inertia + self.stop(self.mtp_angle, self.mtp_lower, self.mtp_upper)
