"""The free foot: its leg moves, the inertias of its links are coupled, and it steps on a ground.

Thesis section 6.2 proposes to relax the infinite inertia of the upper body. The links are uniform
rods; the equations of motion are Lagrange's for the two velocities of the leg and four joints. In
the angles a_i of the links from the x axis, the kinetic energy of the links is ``sum A_ij cos(a_i -
a_j) da_i da_j / 2`` with constants A; first moments s couple them to the leg. A joint turns all
links beyond it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..kit import Input, Output, Parameter, PowerPort, State, cos, outside, shared, sin, where
from .dynamic import FootDynamic
from .ground import Ground

# links that turn with ankle, tm, mtp and the second mtp joint
_BEYOND = ((0, 1, 2, 3), (1, 2, 3), (2,), (3,))
# joints that turn heel, ball, first toe and other toes
_TURNED_BY = ((0,), (0, 1), (0, 1, 2), (0, 1, 3))
_LINKS = range(4)


def _mass(default: float, part: str) -> Any:
    return Parameter(
        default, "kg", min=0, max=1e6, nominal=0.1, source="assumed", doc=f"mass of {part}"
    )


def _work(doc: str, rate: str) -> Any:
    return State("J", rate=rate, nominal=1e-3, output=True, doc=doc)


def _velocity(doc: str, rate: str) -> Any:
    return State(
        "m/s", rate=rate, nominal=0.1, display="mm/s", output=True, doc=f"velocity of the leg {doc}"
    )


def solve(matrix: Sequence[Sequence[Any]], right: Sequence[Any]) -> list[Any]:
    """Solve a linear system by Gaussian elimination without pivoting, for numbers and symbols.

    Parameters
    ----------
    matrix : sequence of sequence, shape (n, n)
        Symmetric and positive definite, so that no pivot is zero.
    right : sequence, shape (n,)
        The right-hand side.

    Returns
    -------
    list, shape (n,)
    """
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    size = len(rows)
    for k in range(size):
        for i in range(k + 1, size):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    solution: list[Any] = []
    for k in reversed(range(size)):
        known = sum(a * x for a, x in zip(rows[k][k + 1 : size], solution, strict=True))
        solution.insert(0, (rows[k][size] - known) / rows[k][k])
    return solution


class Contact(NamedTuple):
    """A point of the foot that may touch the ground.

    Attributes
    ----------
    turns : list of tuple
        Index of each joint that turns the point, with the distance of the point from that joint
        along x and y in m.
    velocity : tuple of two
        Velocity over the ground along x and y, in m/s.
    force : tuple of two
        Force of the ground on the point along x and y, in N.
    """

    turns: list[tuple[int, Any, Any]]
    velocity: tuple[Any, Any]
    force: tuple[Any, Any]


class FootFree(Ground, FootDynamic):
    """Foot under a leg that moves up, down, forward and backward and stays upright, on a ground
    that pushes and rubs.
    """

    name = "foot_free"
    # no port at the toe: its force does work along a path in space, which is not an output
    ports = (
        *FootDynamic.muscles,
        PowerPort(
            "leg_along",
            "translational",
            "leg_height",
            "leg_force_x",
            ("leg_flange_x",),
            delivers=True,
        ),
        PowerPort("leg_forward", "translational", "leg_advance", "leg_force_y", ("leg_flange_y",)),
    )
    tolerance = 1e-9  # contacts are short, and an error in one persists
    experiment = (1.0, 0.005)

    leg_held = Parameter(
        False, "1", type="boolean", doc="whether the leg is held where it is, as by a stand"
    )
    leg_mass = _mass(0.2, "the leg and what it carries")
    m1 = _mass(0.06, "link 1")
    m2 = _mass(0.03, "link 2")
    m3 = _mass(0.01, "link 3, the first toe")
    m4 = _mass(0.01, "link 4, the other toes")
    gravity = Parameter(
        9.80665, "m/s^2", min=0, max=100.0, nominal=10.0, doc="acceleration of gravity"
    )
    l4 = Parameter(
        0.0236,
        "m",
        min=0.015,
        max=0.04,
        nominal=1e-2,
        display="mm",
        source="assumed: as long as link 3",
        doc="link 4, second metatarsal-phalangeal joint to the middle of the other toes",
    )
    mtp2_inertia = Parameter(
        2e-5,
        "kg*m^2",
        min=1e-7,
        max=1.0,
        nominal=1e-4,
        source="assumed: that of mtp_inertia",
        doc="moment of inertia about the second metatarsal-phalangeal joint",
    )
    mtp2_damping = Parameter(
        1e-3,
        "N*m*s/rad",
        min=0,
        max=1e3,
        nominal=1e-2,
        source="assumed: that of mtp_damping",
        doc="damping in the second metatarsal-phalangeal joint",
    )
    mtp2_stiffness = Parameter(
        0.5,
        "N*m/rad",
        min=0,
        max=1e9,
        source="assumed",
        doc="stiffness of the second metatarsal-phalangeal joint, which no actuator crosses",
    )

    leg_force_x = Input("N", doc="force of the body on the leg along x (down)")
    leg_force_y = Input("N", doc="force of the body on the leg along y (forward)")

    mtp2_angle = State(
        "rad",
        rate="mtp2_rate_law",
        min=-1.5,
        max=1.5,
        nominal=0.5,
        display="deg",
        output=True,
        doc="angle of the second metatarsal-phalangeal joint",
    )
    mtp2_rate = State(
        "rad/s",
        rate="mtp2_acceleration",
        nominal=0.1,
        display="deg/s",
        output=True,
        doc="angular velocity of the second metatarsal-phalangeal joint",
    )
    leg_height = State(
        "m",
        rate="leg_height_rate",
        start=0.25,
        nominal=0.1,
        display="mm",
        output=True,
        doc="height of the ankle above the ground",
    )
    leg_advance = State(
        "m",
        rate="leg_advance_rate",
        nominal=0.1,
        display="mm",
        output=True,
        doc="how far the ankle has gone forward",
    )
    leg_velocity_x = _velocity("along x (down)", "leg_acceleration_x")
    leg_velocity_y = _velocity("along y (forward)", "leg_acceleration_y")
    actuator_work = _work("work that the actuators have done", "actuator_power")
    ground_work = _work("work that the ground has done on the foot", "ground_power")
    load_work = _work("work that toe force and force on the leg have done", "load_power")
    joint_loss = _work("energy lost in the damping of the joints", "joint_loss_power")

    # --- positions and velocities
    # ----------------------------------------------------------------------------------------------

    @shared
    def links(self) -> list[Any]:
        """Lengths of the four links."""
        return [self.scale * length for length in (self.l1, self.l2, self.l3, self.l4)]

    @shared
    def directions(self) -> list[tuple[Any, Any]]:
        """Unit vectors along the four links, x and y."""
        first, second, third = self.link_angles()
        return [
            (cos(a), sin(a)) for a in (first, second, third, second + self.beta_p + self.mtp2_angle)
        ]

    def joint_rates(self) -> tuple[Any, Any, Any, Any]:
        """Angular velocities of the four joints."""
        return self.ankle_rate, self.tm_rate, self.mtp_rate, self.mtp2_rate

    def link_rates(self) -> tuple[Any, Any, Any, Any]:
        """Angular velocities of the four links, each the sum over the joints before it."""
        ankle, tm, mtp, mtp2 = self.joint_rates()
        second = ankle + tm
        return ankle, second, second + mtp, second + mtp2

    def leg_velocity(self) -> tuple[Any, Any]:
        """Velocity of the leg along x and y; zero for a fixed leg."""
        return (
            where(self.leg_held, 0.0, self.leg_velocity_x),
            where(self.leg_held, 0.0, self.leg_velocity_y),
        )

    def touching_points(self) -> list[list[tuple[Any, Any]]]:
        """Distances of heel, ball, first toe and other toes from the joints that turn them.

        The heel is the attachment of po; the ball is the common hinge of both toes.
        """
        links = zip(self.links(), self.directions(), strict=True)
        first, second, third, fourth = [(length * x, length * y) for length, (x, y) in links]
        angle = self.ankle_angle - self.beta_po
        heel = self.scale * self.r_po * cos(angle), self.scale * self.r_po * sin(angle)
        ball = [_sum(first, second), second]
        return [
            [heel],
            ball,
            [*(_sum(distance, third) for distance in ball), third],
            [*(_sum(distance, fourth) for distance in ball), fourth],
        ]

    # --- the ground
    # ----------------------------------------------------------------------------------------------

    @shared
    def contacts(self) -> list[Contact]:
        """Contacts of heel, ball, first toe and other toes."""
        leg = self.leg_velocity()
        rates = self.joint_rates()
        contacts = []
        for joints, distances in zip(_TURNED_BY, self.touching_points(), strict=True):
            turns = [(joint, x, y) for joint, (x, y) in zip(joints, distances, strict=True)]
            down = leg[0] - sum(rates[joint] * y for joint, _, y in turns)
            forward = leg[1] + sum(rates[joint] * x for joint, x, _ in turns)
            pressure = self.ground_pressure(distances[0][0] - self.leg_height, down)
            force = -pressure, self.ground_drag(pressure, forward)
            contacts.append(Contact(turns, (down, forward), force))
        return contacts

    def ground_reactions(self) -> list[tuple[Any, Any]]:
        """Forces of the ground on heel, ball, first toe and other toes."""
        return [contact.force for contact in self.contacts()]

    # --- inertia
    # ----------------------------------------------------------------------------------------------

    @shared
    def moments_of_mass(self) -> tuple[Any, Any, Any, Any]:
        """First moments of mass s of the links, each with the links that it carries."""
        first, second, third, fourth = self.links()
        toes = self.m3 + self.m4
        return (
            first * (0.5 * self.m1 + self.m2 + toes),
            second * (0.5 * self.m2 + toes),
            third * (0.5 * self.m3),
            fourth * (0.5 * self.m4),
        )

    @shared
    def moments_of_inertia(self) -> list[list[Any]]:
        """Constants A of the kinetic energy, those of uniform rods in a chain."""
        first, second, third, fourth = self.links()
        toes = self.m3 + self.m4
        a12 = first * second * (0.5 * self.m2 + toes)
        a13 = 0.5 * first * third * self.m3
        a14 = 0.5 * first * fourth * self.m4
        a23 = 0.5 * second * third * self.m3
        a24 = 0.5 * second * fourth * self.m4
        return [
            [first * first * (self.m1 / 3.0 + self.m2 + toes), a12, a13, a14],
            [a12, second * second * (self.m2 / 3.0 + toes), a23, a24],
            [a13, a23, third * third * self.m3 / 3.0, 0.0],
            [a14, a24, 0.0, fourth * fourth * self.m4 / 3.0],
        ]

    def joint_inertias(self) -> tuple[Any, Any, Any, Any]:
        """Constant inertias of the joints, in addition to those of the links."""
        return self.ankle_inertia, self.tm_inertia, self.mtp_inertia, self.mtp2_inertia

    def whole_mass(self) -> Any:
        """Mass of leg and foot."""
        return self.leg_mass + self.m1 + self.m2 + self.m3 + self.m4

    def mobility(self) -> Any:
        """Acceleration of the leg per force: one over the whole mass, 0 for a fixed leg."""
        return where(self.leg_held, 0.0, 1.0 / self.whole_mass())

    # --- equations of motion
    # ----------------------------------------------------------------------------------------------

    def mtp2_friction(self) -> Any:
        """Friction torque of the second metatarsal-phalangeal joint."""
        return self.mtp2_damping * self.mtp2_rate

    def mtp2_torque(self) -> Any:
        """Restoring torque of the second metatarsal-phalangeal joint."""
        return self.mtp2_stiffness * self.mtp2_angle

    def joint_frictions(self) -> tuple[Any, Any, Any, Any]:
        """Friction torques of the four joints."""
        return self.ankle_friction(), self.tm_friction(), self.mtp_friction(), self.mtp2_friction()

    def beyond_stops(self) -> tuple[Any, Any, Any, Any]:
        """Angle of each joint beyond its stop; the second toe joint has the stops of the first."""
        return (
            outside(self.ankle_angle, self.ankle_lower, self.ankle_upper),
            outside(self.tm_angle, self.tm_lower, self.tm_upper),
            outside(self.mtp_angle, self.mtp_lower, self.mtp_upper),
            outside(self.mtp2_angle, self.mtp_lower, self.mtp_upper),
        )

    def ground_torques(self) -> list[Any]:
        """Torques on the four joints by the forces of the ground."""
        torques: list[Any] = [0.0] * 4
        for contact in self.contacts():
            x, y = contact.force
            for joint, down, forward in contact.turns:
                torques[joint] = torques[joint] + down * y - forward * x
        return torques

    def driving_torques(self) -> list[Any]:
        """Torques on the joints except gravity and inertia: tensions, loads, ground, arch, friction
        and stops.
        """
        pulls = (*self.joint_torques(), 0.0)
        springs = (0.0, self.arch_torque(), 0.0, self.mtp2_torque())
        stop = self.stop_frequency * self.stop_frequency
        return [
            pull + ground - friction - spring - inertia * stop * beyond
            for pull, ground, friction, spring, inertia, beyond in zip(
                pulls,
                self.ground_torques(),
                self.joint_frictions(),
                springs,
                self.joint_inertias(),
                self.beyond_stops(),
                strict=True,
            )
        ]

    def outer_force(self) -> tuple[Any, Any]:
        """External force on leg and foot: loads, ground and weight."""
        reactions = self.ground_reactions()
        x = self.toe_force_x + self.leg_force_x + sum(force[0] for force in reactions)
        y = self.toe_force_y + self.leg_force_y + sum(force[1] for force in reactions)
        return x + self.whole_mass() * self.gravity, y

    @shared
    def accelerating_force(self) -> tuple[Any, Any]:
        """External force plus the centrifugal forces of the links."""
        x, y = self.outer_force()
        turning = zip(self.moments_of_mass(), self.directions(), self.link_rates(), strict=True)
        for moment, (down, forward), rate in turning:
            x = x + moment * down * rate * rate
            y = y + moment * forward * rate * rate
        return x, y

    def coupled_inertias(self) -> list[list[Any]]:
        """Inertia matrix of the links after elimination of the acceleration of the leg."""
        moments = self.moments_of_mass()
        inertias = self.moments_of_inertia()
        directions = self.directions()
        mobility = self.mobility()

        def coupled(i: int, k: int) -> Any:
            inertia = inertias[i][k] - mobility * moments[i] * moments[k]
            return inertia * _dot(directions[i], directions[k])

        return [[coupled(i, k) for k in _LINKS] for i in _LINKS]

    def link_torques(self) -> list[Any]:
        """Torques on the links by gravity, centrifugal inertia and the acceleration of the leg."""
        moments = self.moments_of_mass()
        inertias = self.moments_of_inertia()
        directions = self.directions()
        rates = self.link_rates()
        mobility = self.mobility()
        x, y = self.accelerating_force()
        torques = []
        for i, (down, forward) in enumerate(directions):
            of_leg = mobility * moments[i] * (forward * x - down * y)
            of_weight = moments[i] * self.gravity * forward
            centrifugal = sum(
                inertias[i][k] * _cross(directions[k], directions[i]) * rates[k] * rates[k]
                for k in _LINKS
            )
            torques.append(of_leg - of_weight - centrifugal)
        return torques

    @shared
    def accelerations(self) -> list[Any]:
        """Angular accelerations of the joints (Lagrange), that of the leg being eliminated."""
        coupled = self.coupled_inertias()
        inertias = [[_block_sum(coupled, rows, columns) for columns in _BEYOND] for rows in _BEYOND]
        for joint, inertia in enumerate(self.joint_inertias()):
            inertias[joint][joint] = inertias[joint][joint] + inertia
        of_links = self.link_torques()
        torques = [
            driving + sum(of_links[i] for i in beyond)
            for driving, beyond in zip(self.driving_torques(), _BEYOND, strict=True)
        ]
        return solve(inertias, torques)

    def leg_acceleration(self, axis: int) -> Any:
        """Acceleration of the leg along x (0) or y (1), by the force that does not accelerate the
        links.
        """
        ankle, tm, mtp, mtp2 = self.accelerations()
        of_links = ankle, ankle + tm, ankle + tm + mtp, ankle + tm + mtp2
        across = [(-forward, down)[axis] for down, forward in self.directions()]
        terms = zip(self.moments_of_mass(), across, of_links, strict=True)
        inertial = sum(moment * normal * acceleration for moment, normal, acceleration in terms)
        return self.mobility() * (self.accelerating_force()[axis] - inertial)

    def leg_acceleration_x(self) -> Any:
        """Acceleration of the leg along x."""
        return self.leg_acceleration(0)

    def leg_acceleration_y(self) -> Any:
        """Acceleration of the leg along y."""
        return self.leg_acceleration(1)

    def leg_height_rate(self) -> Any:
        """Rate of the leg's height."""
        return -self.leg_velocity()[0]

    def leg_advance_rate(self) -> Any:
        """Rate of the leg's advance."""
        return self.leg_velocity()[1]

    def mtp2_rate_law(self) -> Any:
        """Rate of the second metatarsal-phalangeal joint's angle."""
        return self.mtp2_rate

    def ankle_acceleration(self) -> Any:
        """Angular acceleration of the ankle."""
        return self.accelerations()[0]

    def tm_acceleration(self) -> Any:
        """Angular acceleration of the tarsal-metatarsal joint."""
        return self.accelerations()[1]

    def mtp_acceleration(self) -> Any:
        """Angular acceleration of the metatarsal-phalangeal joint."""
        return self.accelerations()[2]

    def mtp2_acceleration(self) -> Any:
        """Angular acceleration of the second metatarsal-phalangeal joint."""
        return self.accelerations()[3]

    # --- energy
    # ----------------------------------------------------------------------------------------------

    def actuator_power(self) -> Any:
        """Power of the actuators: tension times the rate at which each shortens."""
        pulls = self.an_tension, self.po_tension, self.do_tension, self.pl_tension
        return -sum(pull * rate for pull, rate in zip(pulls, self.length_rates(), strict=True))

    def ground_power(self) -> Any:
        """Power of the ground on the touching points."""
        return sum(_dot(contact.force, contact.velocity) for contact in self.contacts())

    def load_power(self) -> Any:
        """Power of the toe force and of the force on the leg."""
        x, y = self.leg_velocity()
        down, forward = x + self.toe_velocity(0), y + self.toe_velocity(1)
        on_toe = self.toe_force_x * down + self.toe_force_y * forward
        return on_toe + self.leg_force_x * x + self.leg_force_y * y

    def joint_loss_power(self) -> Any:
        """Power lost in the damping of the joints."""
        return sum(
            torque * rate
            for torque, rate in zip(self.joint_frictions(), self.joint_rates(), strict=True)
        )

    @Output("J", nominal=1e-3)
    def kinetic_energy(self) -> Any:
        """Kinetic energy of leg and foot."""
        leg = self.leg_velocity()
        rates = self.link_rates()
        directions = self.directions()
        moments = self.moments_of_mass()
        inertias = self.moments_of_inertia()
        of_leg = 0.5 * self.whole_mass() * _dot(leg, leg)
        of_both = sum(moments[i] * _cross(directions[i], leg) * rates[i] for i in _LINKS)
        of_links = 0.5 * sum(
            inertias[i][k] * _dot(directions[i], directions[k]) * rates[i] * rates[k]
            for i in _LINKS
            for k in _LINKS
        )
        turning = zip(self.joint_inertias(), self.joint_rates(), strict=True)
        of_joints = 0.5 * sum(inertia * rate * rate for inertia, rate in turning)
        return of_leg + of_both + of_links + of_joints

    @Output("J", nominal=1e-3)
    def potential_energy(self) -> Any:
        """Potential energy of weight, arch, second toe joint and stops; not of the ground."""
        pairs = zip(self.moments_of_mass(), self.directions(), strict=True)
        below_ankle = sum(moment * x for moment, (x, _) in pairs)
        weight = self.gravity * (self.whole_mass() * self.leg_height - below_ankle)
        springs = self.arch_torque() * self.tm_angle + self.mtp2_torque() * self.mtp2_angle
        stop = self.stop_frequency * self.stop_frequency
        stops = sum(
            inertia * stop * beyond * beyond
            for inertia, beyond in zip(self.joint_inertias(), self.beyond_stops(), strict=True)
        )
        return weight + 0.5 * springs + 0.5 * stops

    @Output("N")
    def ground_force_x(self) -> Any:
        """Force of the ground on the foot along x; it pushes up, so it is negative."""
        return sum(force[0] for force in self.ground_reactions())

    @Output("N")
    def ground_force_y(self) -> Any:
        """Force of the ground on the foot along y (forward)."""
        return sum(force[1] for force in self.ground_reactions())

    @Output("N")
    def heel_pressure(self) -> Any:
        """Force of the ground on the heel, up."""
        return -self.ground_reactions()[0][0]

    @Output("N")
    def ball_pressure(self) -> Any:
        """Force of the ground on the ball, where the toes are hinged, up."""
        return -self.ground_reactions()[1][0]

    @Output("N")
    def toe_pressure(self) -> Any:
        """Force of the ground on the first toe, up."""
        return -self.ground_reactions()[2][0]

    @Output("N")
    def toes_pressure(self) -> Any:
        """Force of the ground on the other toes, up."""
        return -self.ground_reactions()[3][0]


def _sum(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    return a[0] + b[0], a[1] + b[1]


def _dot(a: tuple[Any, Any], b: tuple[Any, Any]) -> Any:
    return a[0] * b[0] + a[1] * b[1]


def _cross(a: tuple[Any, Any], b: tuple[Any, Any]) -> Any:
    return a[0] * b[1] - a[1] * b[0]


def _block_sum(matrix: list[list[Any]], rows: Sequence[int], columns: Sequence[int]) -> Any:
    """Return the sum of the elements of a matrix in some rows and columns."""
    return sum(matrix[i][k] for i in rows for k in columns)
