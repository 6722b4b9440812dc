"""Kinematics of the foot: actuator lengths and toe position by joint angles, and derivatives.

Thesis eqs. 5.2-5.4, table 5-1. Three revolute joints in a row, ``ankle``, ``tm`` and ``mtp``; four
actuators, ``an`` and ``po`` on the ankle, ``do`` and ``pl`` on the toe. Angles are zero in the
reference configuration and positive in dorsiflexion (toes up). The frame is fixed to the leg with
its origin in the ankle, x down along the leg and y forward, as eq. 5.3 has it.
"""

from __future__ import annotations

from math import radians
from typing import Any

from ..kit import Component, Output, Parameter, Preset, cos, shared, sin, sqrt

ACTUATORS = ("an", "po", "do", "pl")
_TABLE = "thesis table 5-1"


def _angle(degrees: float, low: float, high: float, doc: str) -> Any:
    """Declare an angle in rad by its value in degrees, as in the table, and its range in rad."""
    return Parameter(
        radians(degrees),
        "rad",
        min=low,
        max=high,
        nominal=0.1,
        display="deg",
        source=_TABLE,
        doc=doc,
    )


def _length(metres: float, low: float, high: float, doc: str) -> Any:
    """Declare a length by its value and its range in m."""
    return Parameter(
        metres, "m", min=low, max=high, nominal=1e-2, display="mm", source=_TABLE, doc=doc
    )


def attached_length(length: Any, radius: Any, angle: Any, turn: Any) -> Any:
    """Return the length of an actuator after a rotation of its attachment, by the law of cosines.

    Parameters
    ----------
    length : float
        Length without rotation, in metres.
    radius : float
        From the joint to the attachment, in metres.
    angle : float
        Between actuator and radius at the attachment, without rotation, in rad.
    turn : float
        Rotation of the attachment about the joint in rad, positive where it lengthens the actuator.

    Returns
    -------
    float
        In metres: ``l^2 = l0^2 + 2 r ((r - l0 cos(angle)) (1 - cos(turn)) + l0 sin(angle)
        sin(turn))``.
    """
    along = radius - length * cos(angle)
    half = sin(0.5 * turn)  # 1 - cos(turn) = 2 half^2 without cancellation
    return sqrt(
        length * length
        + 2.0 * radius * (2.0 * along * half * half + length * sin(angle) * sin(turn))
    )


def attached_arm(length: Any, radius: Any, angle: Any, turn: Any) -> Any:
    """Return the moment arm of the actuator, the derivative of :func:`attached_length` with respect
    to ``turn``, in m/rad.
    """
    along = radius - length * cos(angle)
    across = length * sin(angle)
    return (
        radius
        * (along * sin(turn) + across * cos(turn))
        / attached_length(length, radius, angle, turn)
    )


def attached_arm_slope(length: Any, radius: Any, angle: Any, turn: Any) -> Any:
    """Return the derivative of :func:`attached_arm` with respect to ``turn``, in m/rad^2."""
    along = radius - length * cos(angle)
    across = length * sin(angle)
    arm = attached_arm(length, radius, angle, turn)
    product_slope = radius * (along * cos(turn) - across * sin(turn))  # of arm times length
    return (product_slope - arm * arm) / attached_length(length, radius, angle, turn)


class FootKinematics(Component):
    """Geometry of the foot, in a posture and with its rates."""

    scale = Parameter(
        1.0, "1", min=0.1, max=10.0, source=_TABLE, doc="size of the foot relative to table 5-1"
    )
    l1 = _length(0.0508, 0.045, 0.06, "link 1, ankle to tarsal-metatarsal joint")
    l2 = _length(0.0625, 0.055, 0.07, "link 2, tarsal-metatarsal to metatarsal-phalangeal joint")
    l3 = _length(
        0.0236,
        0.015,
        0.04,
        "link 3, metatarsal-phalangeal joint to the middle of the first phalanx",
    )
    l_an = _length(0.0975, 0.08, 0.12, "length of the an actuator in the reference configuration")
    l_po = _length(0.0932, 0.085, 0.12, "length of the po actuator in the reference configuration")
    l_do = _length(0.1133, 0.09, 0.14, "length of the do actuator in the reference configuration")
    l_pl = _length(0.1392, 0.1, 0.18, "length of the pl actuator in the reference configuration")
    r_an = _length(0.0180, 0.01, 0.03, "radius from the ankle to the attachment of an")
    r_po = _length(0.0417, 0.03, 0.045, "radius from the ankle to the attachment of po")
    r_do = _length(
        0.0231, 0.01, 0.03, "radius from the metatarsal-phalangeal joint to the attachment of do"
    )
    r_pl = _length(
        0.0163,
        0.005,
        0.03,
        "radius on which the tendon of pl lies about the metatarsal-phalangeal joint",
    )
    beta_pf = _angle(
        49.0, 0.7, 1.0, "angle of link 1 from the x axis in the reference configuration"
    )
    beta_df = _angle(
        30.9, 0.45, 0.7, "angle of link 2 from link 1 in the reference configuration (printed af)"
    )
    beta_p = _angle(10.1, 0.15, 0.3, "angle of link 3 from link 2 in the reference configuration")
    beta_an = _angle(50.7, 0.6, 1.3, "angle locating the attachment of an, from the leg")
    beta_po = _angle(57.7, 0.9, 1.3, "angle locating the attachment of po, from the leg")
    gamma_an = _angle(6.1, 0.0, 0.3, "angle of the an actuator from the leg")
    gamma_po = _angle(12.9, 0.0, 0.3, "angle of the po actuator from the leg")
    gamma_do = _angle(15.1, 0.05, 0.6, "angle between the do actuator and its attachment radius")

    # Posture and its rates, in rad and rad/s: inputs of `Foot`, states of `FootDynamic`.
    ankle_angle: Any
    tm_angle: Any
    mtp_angle: Any
    ankle_rate: Any
    tm_rate: Any
    mtp_rate: Any

    # --- actuators: lengths, and R = dl/dtheta, with one entry for each
    # ----------------------------------------------------------------------------------------------

    def an_triangle(self) -> tuple[Any, Any, Any, Any]:
        """Length, radius, angle and rotation of an's attachment; dorsiflexion shortens it."""
        return self.l_an, self.r_an, self.beta_an - self.gamma_an, -self.ankle_angle

    def po_triangle(self) -> tuple[Any, Any, Any, Any]:
        """Length, radius, angle and rotation of po's attachment; dorsiflexion lengthens it."""
        return self.l_po, self.r_po, self.beta_po - self.gamma_po, self.ankle_angle

    def do_triangle(self) -> tuple[Any, Any, Any, Any]:
        """Length, radius, angle and rotation of do's attachment; dorsiflexion shortens it."""
        return self.l_do, self.r_do, self.gamma_do, -self.mtp_angle

    @shared
    def arms(self) -> tuple[Any, Any, Any, Any]:
        """Moment arms of an, po, do and pl at the size of table 5-1, without ``scale``."""
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
        """Moment arm of pl, dl/dtheta of the metatarsal-phalangeal joint: the radius its tendon
        lies on.
        """
        return self.scale * self.arms()[3]

    def arm_slopes(self) -> tuple[Any, Any, Any, Any]:
        """Derivatives of the moment arms by the angle of the joint that each turns, m/rad.

        In the order an (anterior), po (posterior), do (dorsal) and pl (plantar).
        """
        triangles = self.an_triangle(), self.po_triangle(), self.do_triangle()
        an, po, do = (self.scale * attached_arm_slope(*triangle) for triangle in triangles)
        return an, po, do, 0.0 * self.scale * self.r_pl  # zero, in the unit of a length

    @shared
    def length_changes(self) -> tuple[Any, Any, Any, Any]:
        """Changes of the lengths of an, po, do and pl from the reference configuration."""
        triangles = self.an_triangle(), self.po_triangle(), self.do_triangle()
        an, po, do = (
            self.scale * (attached_length(*triangle) - triangle[0]) for triangle in triangles
        )
        return an, po, do, self.scale * self.r_pl * self.mtp_angle

    def length_rates(self) -> tuple[Any, Any, Any, Any]:
        """Rates of the lengths of an, po, do and pl, R dtheta/dt (eq. 5.4)."""
        return (
            self.an_arm() * self.ankle_rate,
            self.po_arm() * self.ankle_rate,
            self.do_arm() * self.mtp_rate,
            self.pl_arm() * self.mtp_rate,
        )

    # --- toe: position and J = dx/dtheta (eq. 5.3)
    # ----------------------------------------------------------------------------------------------

    def link_angles(self) -> tuple[Any, Any, Any]:
        """Angles of the three links from the x axis."""
        first = self.beta_pf + self.ankle_angle
        second = first + self.beta_df + self.tm_angle
        return first, second, second + self.beta_p + self.mtp_angle

    def toe_position(self) -> tuple[Any, Any]:
        """Position of the toe, the middle of the first phalanx, x and y."""
        links = list(zip((self.l1, self.l2, self.l3), self.link_angles(), strict=True))
        x = self.scale * sum(length * cos(angle) for length, angle in links)
        y = self.scale * sum(length * sin(angle) for length, angle in links)
        return x, y

    @shared
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

    # --- outputs
    # ----------------------------------------------------------------------------------------------

    @Output("m", nominal=0.1, display="mm")
    def an_length(self) -> Any:
        """Length of the an actuator."""
        return self.scale * self.l_an + self.length_changes()[0]

    @Output("m", nominal=0.1, display="mm")
    def po_length(self) -> Any:
        """Length of the po actuator."""
        return self.scale * self.l_po + self.length_changes()[1]

    @Output("m", nominal=0.1, display="mm")
    def do_length(self) -> Any:
        """Length of the do actuator."""
        return self.scale * self.l_do + self.length_changes()[2]

    @Output("m", nominal=0.1, display="mm")
    def pl_length(self) -> Any:
        """Length of the pl actuator, whose tendon lies on its radius."""
        return self.scale * self.l_pl + self.length_changes()[3]

    @Output("m", nominal=1e-3, display="mm")
    def an_length_change(self) -> Any:
        """Length of the an actuator less that in the reference configuration."""
        return self.length_changes()[0]

    @Output("m", nominal=1e-3, display="mm")
    def po_length_change(self) -> Any:
        """Length of the po actuator less that in the reference configuration."""
        return self.length_changes()[1]

    @Output("m", nominal=1e-3, display="mm")
    def do_length_change(self) -> Any:
        """Length of the do actuator less that in the reference configuration."""
        return self.length_changes()[2]

    @Output("m", nominal=1e-3, display="mm")
    def pl_length_change(self) -> Any:
        """Length of the pl actuator less that in the reference configuration."""
        return self.length_changes()[3]

    @Output("m/s", nominal=1e-2, display="mm/s")
    def an_length_rate(self) -> Any:
        """Rate of the length of the an actuator."""
        return self.length_rates()[0]

    @Output("m/s", nominal=1e-2, display="mm/s")
    def po_length_rate(self) -> Any:
        """Rate of the length of the po actuator."""
        return self.length_rates()[1]

    @Output("m/s", nominal=1e-2, display="mm/s")
    def do_length_rate(self) -> Any:
        """Rate of the length of the do actuator."""
        return self.length_rates()[2]

    @Output("m/s", nominal=1e-2, display="mm/s")
    def pl_length_rate(self) -> Any:
        """Rate of the length of the pl actuator."""
        return self.length_rates()[3]

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

    presets = {
        "prototype": Preset(
            {"scale": 2.5}, doc="the printed 2.5:1 prototype (thesis section 5.2, fig. 5-3)"
        ),
    }
