"""Reference results of the feet, from points and vectors in the plane.

``foot``: the links are multiplied by rotation matrices, actuators are distances between points,
their moment arms cross products, matrices are inverted by NumPy. ``foot_dynamic``: integrated by
scipy's DOP853 to 1e-12. ``foot_free``: Newton's and Euler's equations of four rods,
projected on leg and joints (Kane), where the component has those of Lagrange.
``foot_displacement_driven``: the same under springs and dashpots in series.

Run ``python -m studies.references.foot`` after changing a default value; its output is in the
component's folder ``reference``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from studies.references.files import Reference

Slope = Callable[[np.ndarray, np.ndarray], np.ndarray]

STEP = 0.01
STOP = 1.0
LINKS = (0.0508, 0.0625, 0.0236)
BETA = np.radians([49.0, 30.9, 10.1])
STIFFNESS = 9100.0
DAMPING = 1.7e6
ARCH = 100.0
REFERENCE = np.array([0.0975, 0.0932, 0.1133, 0.1392])
INERTIA = np.array([1e-3, 5e-4, 2e-5])
FRICTION = np.array([0.02, 0.2, 1e-3])
LOWER = np.array([-0.7, -0.26, -0.15])
UPPER = np.array([0.7, 0.26, 1.05])
STOP_FREQUENCY = 200.0
ACTUATORS = ("an", "po", "do", "pl")
LOADS = ("an_tension", "po_tension", "do_tension", "pl_tension", "toe_force_x", "toe_force_y")
POSTURE = ("ankle_angle", "tm_angle", "mtp_angle", "ankle_rate", "tm_rate", "mtp_rate")
OUTPUTS = (
    "an_length",
    "po_length",
    "do_length",
    "pl_length",
    "an_length_change",
    "po_length_change",
    "do_length_change",
    "pl_length_change",
    "an_length_rate",
    "po_length_rate",
    "do_length_rate",
    "pl_length_rate",
    "toe_x",
    "toe_y",
    "toe_velocity_x",
    "toe_velocity_y",
    "ankle_torque",
    "tm_torque",
    "mtp_torque",
    "toe_compliance_xx",
    "toe_compliance_xy",
    "toe_compliance_yy",
    "toe_damping_xx",
    "toe_damping_xy",
    "toe_damping_yy",
)


def rotation(angle: float) -> np.ndarray:
    """Turn from x (down) towards y (forward)."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def cross(a: np.ndarray, b: np.ndarray) -> float:
    """Third component of the cross product."""
    return float(a[0] * b[1] - a[1] * b[0])


def pulled(attachment: np.ndarray, origin: np.ndarray, turn: float) -> tuple[float, float]:
    """Return the length from the origin to the turned attachment, and its derivative by the turn.

    The attachment is turned about (0, 0).
    """
    now = rotation(turn) @ attachment
    line = now - origin
    length = float(np.linalg.norm(line))
    return length, cross(now, line / length)


def actuators(ankle: float, mtp: float) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of an, po, do, pl and the 4 by 3 matrix of their derivatives by the joint angles.

    The leg points along -x. The heel is behind it, so that r_po is at 57.7 deg behind x and r_an at
    50.7 deg before. For ``do`` any origin will do that is 113.3 mm away, at 15.1 deg from the
    radius, on the side of dorsiflexion.
    """
    heel = 0.0417 * np.array([np.cos(np.radians(57.7)), -np.sin(np.radians(57.7))])
    calf = heel + 0.0932 * np.array([-np.cos(np.radians(12.9)), np.sin(np.radians(12.9))])
    instep = 0.018 * np.array([np.cos(np.radians(50.7)), np.sin(np.radians(50.7))])
    shin = instep + 0.0975 * np.array([-np.cos(np.radians(6.1)), -np.sin(np.radians(6.1))])
    toe = np.array([0.0231, 0.0])
    origin = toe - 0.1133 * rotation(np.radians(-15.1)) @ np.array([1.0, 0.0])
    pairs = [pulled(instep, shin, ankle), pulled(heel, calf, ankle), pulled(toe, origin, mtp)]
    lengths = np.array([*(length for length, _ in pairs), 0.1392 + 0.0163 * mtp])
    arms = np.zeros((4, 3))
    arms[[0, 1, 2, 3], [0, 0, 2, 2]] = [*(arm for _, arm in pairs), 0.0163]
    return lengths, arms


def toe(posture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position of the toe and its 2 by 3 Jacobian: each joint turns what lies beyond it."""
    turned = np.eye(2)
    points = [np.zeros(2)]
    for beta, angle, link in zip(BETA, posture, LINKS, strict=True):
        turned = turned @ rotation(beta + angle)
        points.append(points[-1] + turned @ np.array([link, 0.0]))
    quarter = rotation(np.pi / 2)
    return points[3], np.column_stack([quarter @ (points[3] - points[i]) for i in range(3)])


def torques(posture: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Torques on the joints by tensions and toe force, from virtual work."""
    _, arms = actuators(posture[0], posture[2])
    _, jacobian = toe(posture)
    return np.asarray(jacobian.T @ loads[4:] - arms.T @ loads[:4])


def outputs(posture: np.ndarray, rates: np.ndarray, loads: np.ndarray) -> list[float]:
    """Return outputs in the order of ``OUTPUTS``."""
    lengths, arms = actuators(posture[0], posture[2])
    position, jacobian = toe(posture)
    stiffness = STIFFNESS * arms.T @ arms + np.diag([0.0, ARCH, 0.0])
    compliance = jacobian @ np.linalg.inv(stiffness) @ jacobian.T
    inverse = np.linalg.inv(jacobian[:, [0, 2]])
    damping = inverse.T @ (DAMPING * arms.T @ arms)[np.ix_([0, 2], [0, 2])] @ inverse
    upper = np.triu_indices(2)
    return [
        *lengths,
        *(lengths - REFERENCE),
        *(arms @ rates),
        *position,
        *(jacobian @ rates),
        *torques(posture, loads),
        *compliance[upper],
        *damping[upper],
    ]


def fed(time: float) -> np.ndarray:
    """Tensions and toe force, constant over tenths of a second."""
    k = np.floor(time * 10.0 + 1e-6)
    return np.array(
        [
            2.0 + np.sin(k),
            1.5 - 0.7 * np.cos(2.0 * k),
            1.0 + 0.5 * np.sin(3.0 * k),
            0.4 + 0.2 * np.cos(k),
            -0.3 + 0.3 * np.cos(1.7 * k),
            0.2 * np.sin(2.3 * k),
        ]
    )


def given_posture(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles and rates, constant over tenths of a second, within the joints' ranges."""
    k = np.floor(time * 10.0 + 1e-6)
    angles = [0.6 * np.sin(0.9 * k), 0.2 * np.sin(2.1 * k + 1.0), 0.4 - 0.5 * np.cos(1.3 * k)]
    return np.array(angles), np.array([np.cos(k), -0.5 * np.sin(k), 2.0 * np.cos(1.9 * k)])


def acceleration(angles: np.ndarray, rates: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Angular accelerations of the joints with arch, friction and stops."""
    beyond = np.where(angles > UPPER, angles - UPPER, np.where(angles < LOWER, angles - LOWER, 0.0))
    torque = torques(angles, loads) - FRICTION * rates - np.array([0.0, ARCH, 0.0]) * angles
    return np.asarray(torque / INERTIA - STOP_FREQUENCY**2 * beyond)


def fixed_slope(x: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Return derivatives of the states of the foot under a fixed leg."""
    return np.concatenate([x[3:], acceleration(x[:3], x[3:], loads)])


def move(slope: Slope, state: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """State after one step with the loads held."""
    return solve_ivp(
        lambda _, x: slope(x, loads), (0.0, STEP), state, method="DOP853", rtol=1e-12, atol=1e-14
    ).y[:, -1]


MASSES = np.array([0.06, 0.03, 0.01, 0.01])
RODS = np.array([*LINKS, LINKS[2]])
LEG = 0.2
FREE_STOP = 0.4  # s, half of which it falls
GRAVITY = 9.80665
FREE_INERTIA = np.array([*INERTIA, 2e-5])
FREE_FRICTION = np.array([*FRICTION, 1e-3])
FREE_SPRINGS = np.array([0.0, ARCH, 0.0, 0.5])
FREE_LOWER, FREE_UPPER = np.append(LOWER, LOWER[2]), np.append(UPPER, UPPER[2])
CHAINS = ((0,), (0, 1), (0, 1, 2), (0, 1, 3))  # joints that turn each link, and each touching point
FREE_LOADS = (*LOADS, "leg_force_x", "leg_force_y")
FREE_STATES = (
    *POSTURE,
    "mtp2_angle",
    "mtp2_rate",
    "leg_height",
    "leg_advance",
    "leg_velocity_x",
    "leg_velocity_y",
    "actuator_work",
    "ground_work",
    "load_work",
    "joint_loss",
)
FREE_OUTPUTS = (
    "kinetic_energy",
    "potential_energy",
    "ground_force_x",
    "ground_force_y",
    "heel_pressure",
    "ball_pressure",
    "toe_pressure",
    "toes_pressure",
)


def rods(angles: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """Places of the joints, the middles of the rods and the touching points, from the ankle."""
    joints, middles, ends = [np.zeros(2)], [], []
    turns = np.cumsum([*BETA[:2] + angles[:2]]).tolist()
    turns += [turns[1] + BETA[2] + angles[2], turns[1] + BETA[2] + angles[3]]
    for link, (length, turn) in enumerate(zip(RODS, turns, strict=True)):
        start = joints[min(link, 2)]
        way = length * np.array([np.cos(turn), np.sin(turn)])
        middles.append(start + 0.5 * way)
        ends.append(start + way)
        if link < 2:
            joints.append(start + way)
    heel = rotation(angles[0]) @ (
        0.0417 * np.array([np.cos(np.radians(57.7)), -np.sin(np.radians(57.7))])
    )
    # both toes are hinged at the ball
    return [*joints, joints[2]], middles, [heel, ends[1], ends[2], ends[3]]


def velocities(at: np.ndarray, chain: tuple[int, ...], joints: list[np.ndarray]) -> np.ndarray:
    """2 by 6 matrix from velocities of leg and joints to that of a point."""
    matrix = np.zeros((2, 6))
    matrix[:, :2] = np.eye(2)
    for joint in chain:
        matrix[:, 2 + joint] = rotation(np.pi / 2) @ (at - joints[joint])
    return matrix


def centripetal(
    at: np.ndarray, chain: tuple[int, ...], joints: list[np.ndarray], rates: np.ndarray
) -> np.ndarray:
    """Acceleration of a point while all rates are constant."""
    total, turning = np.zeros(2), 0.0
    for place, joint in enumerate(chain):
        turning += rates[joint]
        end = joints[chain[place + 1]] if place + 1 < len(chain) else at
        total -= turning**2 * (end - joints[joint])
    return total


def pressed(at: np.ndarray, velocity: np.ndarray, height: float) -> np.ndarray:
    """Force of the ground on a point."""
    depth = at[0] - height
    if depth <= 0.0:
        return np.zeros(2)
    push = 2e4 * depth * np.sqrt(depth / 1e-3) * max(1.0 + 1.5 * velocity[0], 0.0)
    return np.array([-push, -0.6 * push * np.tanh(velocity[1] / 0.02)])


def sorted_free(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles and rates of four joints, and velocities of leg and joints, from the states."""
    angles, rates = np.array([*x[:3], x[6]]), np.array([*x[3:6], x[7]])
    return angles, rates, np.array([*x[10:12], *rates])


def inertia_and_force(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return mass matrix, forces of weight, ground and constant rates, and the ground's power."""
    angles, rates, speeds = sorted_free(x)
    joints, middles, points = rods(angles)
    mass = np.diag([LEG, LEG, *FREE_INERTIA])
    force = np.array([LEG * GRAVITY, 0.0, *np.zeros(4)])
    for m, length, middle, chain in zip(MASSES, RODS, middles, CHAINS, strict=True):
        moved = velocities(middle, chain, joints)
        spun = np.array([0.0, 0.0, *(float(j in chain) for j in range(4))])
        mass = mass + m * moved.T @ moved + m * length**2 / 12.0 * np.outer(spun, spun)
        weight = np.array([m * GRAVITY, 0.0])
        force = force + moved.T @ (weight - m * centripetal(middle, chain, joints, rates))
    power = 0.0
    for at, chain in zip(points, CHAINS, strict=True):
        moved = velocities(at, chain, joints)
        push = pressed(at, moved @ speeds, x[8])
        force = force + moved.T @ push
        power += push @ moved @ speeds
    return mass, force, power


def free_slope(x: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """Return derivatives of the states of the free foot."""
    angles, rates, speeds = sorted_free(x)
    mass, force, power = inertia_and_force(x)
    outer = np.array([*(loads[6:] + loads[4:6]), *torques(angles[:3], loads[:6]), 0.0])
    beyond = angles - np.clip(angles, FREE_LOWER, FREE_UPPER)
    own = FREE_FRICTION * rates + FREE_SPRINGS * angles + FREE_INERTIA * STOP_FREQUENCY**2 * beyond
    gained = np.linalg.solve(mass, force + outer - np.array([0.0, 0.0, *own]))
    arms, jacobian = actuators(angles[0], angles[2])[1], toe(angles[:3])[1]
    moved = [*rates[:3], *gained[2:5], rates[3], gained[5], -x[10], x[11], *gained[:2]]
    loaded = loads[4:6] @ (speeds[:2] + jacobian @ rates[:3]) + loads[6:] @ speeds[:2]
    works = [-loads[:4] @ arms @ rates[:3], power, loaded, FREE_FRICTION @ rates**2]
    return np.array([*moved, *works])


def stretched(x: np.ndarray, displacements: np.ndarray) -> np.ndarray:
    """Tensions of springs between the attachments, behind dashpots and displacements."""
    lengths, _ = actuators(x[0], x[2])
    return np.maximum(STIFFNESS * (lengths - REFERENCE - displacements - x[16:]), 0.0)


def driven_slope(x: np.ndarray, fed: np.ndarray) -> np.ndarray:
    """Return derivatives of the states of the foot under four displacements."""
    tensions = stretched(x, fed[:4])
    return np.array([*free_slope(x[:16], np.array([*tensions, *fed[4:]])), *(tensions / DAMPING)])


def driven_outputs(x: np.ndarray, fed: np.ndarray) -> list[float]:
    """Return the tensions, and states and outputs of the free foot."""
    tensions = stretched(x, fed[:4])
    return [*tensions, *free_outputs(x[:16], np.array([*tensions, *fed[4:]]))]


def design_outputs(posture: np.ndarray) -> list[float]:
    """Return forces and stroke of the toe, from levers and arms."""
    _, arms = actuators(posture[0], posture[2])
    _, jacobian = toe(posture)
    gains = [arms[1, 0] / -jacobian[0, 0], arms[3, 2] / max(-jacobian[0, 2], 1e-4)]
    return [*(3.0 * g for g in gains), 3.0 * min(gains), 1.8e-4 * sum(1.0 / g for g in gains)]


def free_outputs(x: np.ndarray, loads: np.ndarray) -> list[float]:
    """Return states, outputs of the other feet and those of the free one."""
    angles, rates, speeds = sorted_free(x)
    joints, middles, points = rods(angles)
    kinetic = 0.5 * LEG * speeds[:2] @ speeds[:2] + 0.5 * FREE_INERTIA @ rates**2
    potential = GRAVITY * LEG * x[8] + 0.5 * FREE_SPRINGS @ angles**2
    for m, length, middle, chain in zip(MASSES, RODS, middles, CHAINS, strict=True):
        velocity = velocities(middle, chain, joints) @ speeds
        spin = sum(rates[joint] for joint in chain)
        kinetic += 0.5 * m * (velocity @ velocity + length**2 / 12.0 * spin**2)
        potential += m * GRAVITY * (x[8] - middle[0])
    beyond = angles - np.clip(angles, FREE_LOWER, FREE_UPPER)
    potential += 0.5 * STOP_FREQUENCY**2 * FREE_INERTIA @ beyond**2
    pushes = [
        pressed(at, velocities(at, chain, joints) @ speeds, x[8])
        for at, chain in zip(points, CHAINS, strict=True)
    ]
    others = outputs(angles[:3], rates[:3], loads[:6])
    pressures = [-float(push[0]) for push in pushes]
    return [*x, *others, kinetic, potential, *np.sum(pushes, axis=0), *pressures]


def fed_free(time: float) -> np.ndarray:
    """Return loads of the free foot: less force and more tension at the toe, a push of the body."""
    loads = fed(time)
    loads[4:] *= 0.2
    k = np.floor(time * 10.0 + 1e-6)
    loads[3] += 0.8 * float(k % 4 < 2)
    return np.array([*loads, 0.4 * np.sin(1.1 * k), 0.3 * np.cos(1.6 * k)])


def fed_displacements(time: float) -> np.ndarray:
    """Return displacements at which some actuators are slack, and the other loads."""
    k = np.floor(time * 10.0 + 1e-6)
    return np.array([*(-1e-4 + 2e-4 * np.sin(k + np.arange(4.0))), *fed_free(time)[4:]])


class Case(NamedTuple):
    """A foot and what it is fed.

    Attributes
    ----------
    inputs, outputs : tuple of str
    stimulus : callable
        Inputs at a time in s.
    row : callable
        Outputs of state and inputs.
    slope : callable
        Derivatives of the state.
    start : ndarray
        The state at first.
    solver : str
    stop : float
        s.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    stimulus: Callable[[float], np.ndarray]
    row: Callable[[np.ndarray, np.ndarray], list[float]]
    slope: Slope | None = None
    start: np.ndarray = np.zeros(0)
    solver: str = "algebraic"
    stop: float = STOP


def given(time: float) -> np.ndarray:
    """Return loads and posture."""
    return np.concatenate([fed(time), *given_posture(time)])


CASES = {
    "foot": Case((*LOADS, *POSTURE), OUTPUTS, given, lambda _, u: outputs(u[6:9], u[9:], u[:6])),
    "foot_design": Case(
        (*LOADS, *POSTURE),
        ("ankle_limited_force", "toe_limited_force", "toe_force", "toe_stroke"),
        given,
        lambda _, u: design_outputs(u[6:9]),
    ),
    "foot_dynamic": Case(
        LOADS,
        (*POSTURE, *OUTPUTS),
        fed,
        lambda x, u: [*x, *outputs(x[:3], x[3:], u)],
        fixed_slope,
        np.zeros(6),
        "DOP853",
    ),
    "foot_free": Case(
        FREE_LOADS,
        (*FREE_STATES, *OUTPUTS, *FREE_OUTPUTS),
        fed_free,
        free_outputs,
        free_slope,
        np.array([*np.zeros(8), 0.25, *np.zeros(7)]),
        "DOP853",
        FREE_STOP,
    ),
    "foot_displacement_driven": Case(
        (*(f"{a}_displacement" for a in ACTUATORS), *FREE_LOADS[4:]),
        (
            *(f"{a}_force" for a in ACTUATORS),
            *FREE_STATES,
            *OUTPUTS,
            *FREE_OUTPUTS,
        ),
        fed_displacements,
        driven_outputs,
        driven_slope,
        np.array([*np.zeros(8), 0.25, *np.zeros(11)]),
        "DOP853",
        FREE_STOP,
    ),
}


def main() -> None:
    """Write the files."""
    for name, case in CASES.items():
        reference = Reference(name, case.inputs, case.outputs, STEP)
        state = case.start
        for k in range(round(case.stop / STEP) + 1):
            time = round(k * STEP, 9)
            now = case.stimulus(time)
            if k and case.slope is not None:
                state = move(case.slope, state, case.stimulus(round((k - 1) * STEP, 9)))
            reference.add(time, now, lambda u, x=state, case=case: case.row(x, np.array(u)))
        reference.write("foot", time, case.solver, ends_held=False)


if __name__ == "__main__":
    main()
