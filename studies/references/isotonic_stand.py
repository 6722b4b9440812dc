"""Reference result of the stand: weights put on and off, an actuator that moves, two zeroings.

Run ``python -m studies.references.isotonic_stand`` after changing a default value; its output is in
the component's folder ``reference``. A sample at a communication point is taken just after it,
with the new inputs.
"""

import numpy as np
from scipy.integrate import solve_ivp

from studies.references.files import Reference

GRAVITY = 9.80665
PLACING = 0.05
SENSITIVITY = 196.85
CORNER = 2 * np.pi * 200.0
SAMPLE = 10  # communication points between two samples
STEP = 0.01
STOP = 3.0


def stimulus(index: int) -> tuple[float, float, int]:
    """Return the mass of the weights in kg, the displacement in m and whether it is set to zero."""
    time = index * STEP
    mass = (0.0, 0.2, 0.2, 0.35, 0.35, 0.0)[index // 50 % 6]
    displacement = 1e-3 * mass + 2e-4 * np.sin(3.0 * time)
    return mass, round(displacement, 12), int(80 <= index < 95 or index == 200)


def main() -> None:
    """Write the files."""
    signals = ("tension", "sensor_voltage", "displacement_measured")
    reference = Reference("isotonic_stand", ("mass", "displacement", "zero"), signals, STEP)
    state = np.zeros(2)
    read = 0.0
    zero = 0.0
    count = round(STOP / STEP)
    for k in range(count + 1):
        now = stimulus(k)
        row = [state[0], state[1], read - zero]
        reference.add(k * STEP, now, lambda _, row=row: row)
        if k == count:
            break
        if k % SAMPLE == 0:
            read = state[1] / SENSITIVITY
            zero = read if now[2] else zero

        def rates(_: float, y: np.ndarray, now: tuple[float, float, int] = now) -> list[float]:
            return [
                (now[0] * GRAVITY - y[0]) / PLACING,
                CORNER * (SENSITIVITY * now[1] - y[1]),
            ]

        state = solve_ivp(rates, (0.0, STEP), state, "Radau", rtol=1e-11, atol=1e-14).y[:, -1]
    reference.write("isotonic_stand", STOP, "Radau")


if __name__ == "__main__":
    main()
