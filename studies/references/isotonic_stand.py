"""Reference result of the stand: weights put on and off, an actuator that moves, two zeroings.

Run ``python -m studies.references.isotonic_stand`` after changing a default value; its output is in
the component's folder ``reference``. ``NAME_in.csv`` and ``NAME_ref.csv`` have the form of the FMI
cross-check: a repeated time marks a jump. A sample at a communication point is taken just after it,
with the new inputs.
"""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from studies.references.files import write_options, write_rows

FOLDER = Path(__file__).parents[2] / "fmus" / "isotonic_stand" / "reference"

GRAVITY = 9.80665
PLACING = 0.05
SENSITIVITY = 196.85
CORNER = 2 * np.pi * 200.0
SAMPLE = 10  # communication points between two samples
STEP = 0.01
STOP = 3.0
NAME = "isotonic_stand"


def stimulus(index: int) -> tuple[float, float, int]:
    """Return the mass of the weights in kg, the displacement in m and whether it is set to zero."""
    time = index * STEP
    mass = (0.0, 0.2, 0.2, 0.35, 0.35, 0.0)[index // 50 % 6]
    displacement = 1e-3 * mass + 2e-4 * np.sin(3.0 * time)
    return mass, round(displacement, 12), int(80 <= index < 95 or index == 200)


def solve() -> tuple[list[list[float]], list[list[float]]]:
    """Rows of inputs and of outputs; the outputs just before and just after a jump both appear."""
    state = np.zeros(2)
    read = 0.0
    zero = 0.0
    held = None
    inputs = []
    outputs = []
    count = round(STOP / STEP)
    for k in range(count + 1):
        now = stimulus(k)
        row = [k * STEP, state[0], state[1], read - zero]
        if held != now:
            if held is not None:
                inputs.append([k * STEP, *held])
                outputs.append(row)
            inputs.append([k * STEP, *now])
        outputs.append(row)
        held = now
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
    inputs.append([STOP, *stimulus(count)])
    return inputs, outputs


def main() -> None:
    """Write the files."""
    inputs, outputs = solve()
    write_rows(FOLDER / f"{NAME}_in.csv", ("mass", "displacement", "zero"), inputs)
    signals = ("tension", "sensor_voltage", "displacement_measured")
    write_rows(FOLDER / f"{NAME}_ref.csv", signals, outputs)
    write_options(FOLDER / f"{NAME}_ref.opt", STOP, STEP, "Radau")


if __name__ == "__main__":
    main()
