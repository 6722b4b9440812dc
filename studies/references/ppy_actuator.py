"""Reference results of the actuator, exact solutions of eqs. 3.5 by matrix exponential.

Run ``python -m studies.references.ppy_actuator`` after changing a default value; its output is in
the component's folder ``reference``.
"""

import numpy as np
from scipy.linalg import expm

from studies.references.files import Reference

R1 = 0.43
R2 = 2.35
C = 2.70
ALPHA = 6.8e-5
K1 = 6300.0
B1 = 1.7e6
K2 = 1.0e4
B2 = 2.0e6
STEP = 0.1
STOP = 60.0
HEADER = {
    "ppy_actuator": (
        ("current", "force"),
        (
            "voltage",
            "displacement",
            "electrochemical_displacement",
            "mechanical_displacement",
            "charge",
        ),
    ),
    "ppy_actuator_length_driven": (("current", "length_change"), ("tension", "voltage", "charge")),
    "ppy_actuator_voltage_driven": (
        ("voltage", "force"),
        (
            "current",
            "displacement",
            "electrochemical_displacement",
            "mechanical_displacement",
            "charge",
        ),
    ),
}


def stimulus(time: float) -> tuple[float, float]:
    """Return +-0.9 A at 0.2 Hz (fig. 3-4) and a load that steps every 10 s (fig. 3-6).

    The load goes from 0.5 N upwards.
    """
    return (0.9 if time % 5.0 < 2.5 else -0.9), 0.5 + 0.25 * (time // 10.0)


def force_driven() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return matrices of eq. 3.5 for states (Q, x_b2, x_b1), outputs in the order of ``HEADER``."""
    tau = (R1 + R2) * C
    a = np.diag([-1 / tau, -K2 / B2, 0.0])
    b = np.array([[R2 / (R1 + R2), 0.0], [0.0, 1 / B2], [0.0, 1 / B1]])
    voltage = [[R2 / (R1 + R2) / C, 0, 0, R1 * R2 / (R1 + R2), 0]]
    elongation = [[ALPHA, 1, 1, 0, 1 / K1], [ALPHA, 0, 0, 0, 0], [0, 1, 1, 0, 1 / K1]]
    return a, b, np.array([*voltage, *elongation, [1, 0, 0, 0, 0]], dtype=float)


def length_driven() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the same with the length imposed: F = K1 (l - ALPHA Q - x_b2 - x_b1), always taut."""
    a, b, c = force_driven()
    tension = np.array([-K1 * ALPHA, -K1, -K1, 0.0, K1])
    a = a + np.outer(b[:, 1], tension[:3])
    b = np.column_stack([b[:, 0], b[:, 1] * tension[4]])
    return a, b, np.array([tension, c[0], c[4]])


def voltage_driven() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the same with the voltage imposed: i = (V - Q/C) / R1 + V / R2."""
    a, b, c = force_driven()
    a[0, 0] = -1 / (R1 * C)
    b[0, 0] = 1 / R1
    c[0] = [-1 / (R1 * C), 0, 0, 1 / R1 + 1 / R2, 0]
    return a, b, c


def main() -> None:
    """Write the files."""
    # 0.5 mm per newton of the force stimulus keeps the length-driven actuator taut
    cases = {
        "ppy_actuator": (force_driven(), (1.0, 1.0)),
        "ppy_actuator_length_driven": (length_driven(), (1.0, 5e-4)),
        # half a volt per ampere of the current stimulus: 2.4 A at a turn
        "ppy_actuator_voltage_driven": (voltage_driven(), (0.5, 1.0)),
    }
    for name, ((a, b, c), scales) in cases.items():
        reference = Reference(name, *HEADER[name], STEP)
        step = expm(np.block([[a, b], [np.zeros((2, 5))]]) * STEP)
        state = np.zeros(3)
        for k in range(round(STOP / STEP) + 1):
            time = round(k * STEP, 9)
            now = np.array(stimulus(time)) * scales
            reference.add(time, now, lambda u, x=state, c=c: c @ np.concatenate([x, u]))
            state = (step @ np.concatenate([state, now]))[:3]
        reference.write("ppy_actuator", STOP, "matrix exponential")


if __name__ == "__main__":
    main()
