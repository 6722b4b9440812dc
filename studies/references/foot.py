"""Reference results of both feet, from points and vectors in the plane.

``foot``: the links are multiplied by rotation matrices, actuators are distances between points,
their moment arms cross products, matrices are inverted by NumPy. ``foot_dynamic``: integrated by
scipy's DOP853 to 1e-12.

Run ``python -m studies.references.foot`` after changing a default value; its output is in the
component's folder ``reference``. ``NAME_in.csv`` and ``NAME_ref.csv`` have the form of the FMI
cross-check: a repeated time marks a jump.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from studies.references.files import write_options, write_rows

FOLDER = Path(__file__).parents[2] / "fmus" / "foot" / "reference"

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


def move(state: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """State after one step with the loads held."""

    def slope(_: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[3:], acceleration(x[:3], x[3:], loads)])

    return solve_ivp(slope, (0.0, STEP), state, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]


def follow(
    stimulus: Callable[[float], np.ndarray],
    row: Callable[[np.ndarray, np.ndarray], list[float]],
    moving: bool,
) -> tuple[list[list[float]], list[list[float]]]:
    """Rows of inputs and of outputs; just before and just after a jump both appear."""
    state, held = np.zeros(6), stimulus(0.0)
    inputs = [[0.0, *held]]
    results = [[0.0, *row(state, held)]]
    for k in range(1, round(STOP / STEP) + 1):
        time = round(k * STEP, 9)
        state = move(state, held) if moving else state
        now = stimulus(time)
        results.append([time, *row(state, held)])
        if not np.array_equal(held, now):
            inputs += [[time, *held], [time, *now]]
            results.append([time, *row(state, now)])
        held = now
    if inputs[-1][0] < STOP:
        inputs.append([STOP, *held])
    return inputs, results


def main() -> None:
    """Write the files."""
    cases = {
        "foot": (
            (*LOADS, *POSTURE),
            OUTPUTS,
            follow(
                lambda t: np.concatenate([fed(t), *given_posture(t)]),
                lambda _, u: outputs(u[6:9], u[9:], u[:6]),
                moving=False,
            ),
        ),
        "foot_dynamic": (
            LOADS,
            (*POSTURE, *OUTPUTS),
            follow(fed, lambda x, u: [*x, *outputs(x[:3], x[3:], u)], moving=True),
        ),
    }
    for name, (signals, results, tables) in cases.items():
        for suffix, header, rows in zip(("in", "ref"), (signals, results), tables, strict=True):
            write_rows(FOLDER / f"{name}_{suffix}.csv", header, rows)
        solver = "DOP853" if name == "foot_dynamic" else "algebraic"
        write_options(FOLDER / f"{name}_ref.opt", STOP, STEP, solver)


if __name__ == "__main__":
    main()
