"""Reference results of the analyser, the sampled loop solved by matrix exponential.

Run ``python -m studies.references.voice_coil_dma`` after changing a default value; its output is in
the component's folder ``reference``. A sample at a communication point is taken just after it,
with the new inputs.
"""

import numpy as np
from scipy.linalg import expm

from studies.references.files import Reference

R = 3.0
L = 1e-3
K = 3.9
M = 0.03
B = 6.0
CORNER = 2 * np.pi * 100.0
B0 = 0.66
B1 = -0.06
LOW = 0.0
HIGH = 10.0
SPRING = 500.0  # N/m; held over a communication step, a stiffer one would not be stable
STEP = 0.01
STOP = 3.0
# states: current, position, velocity, filtered force, filtered position; inputs: voltage, tension
A = np.array(
    [
        [-R / L, 0, -K / L, 0, 0],
        [0, 0, 1, 0, 0],
        [K / M, 0, -B / M, 0, 0],
        [0, 0, 0, -CORNER, 0],
        [0, CORNER, 0, 0, -CORNER],
    ]
)
U = np.array([[1 / L, 0], [0, 0], [0, -1 / M], [0, CORNER], [0, 0]])


def stimulus(index: int, position: float) -> tuple[float, float]:
    """Return steps of the wanted force and a soft spring for the actuator.

    One step is beyond what the coil can give.

    The tension is that of the spring at the communication point, rounded to what the file holds.
    """
    return (1.0, 2.0, 0.5, 30.0, 0.0)[min(index // 60, 4)], round(max(SPRING * position, 0.0), 9)


def main() -> None:
    """Write the files."""
    state = np.zeros(5)
    command = 0.0
    previous = 0.0
    sample = 0
    propagators: dict[float, np.ndarray] = {}

    def flow(duration: float, tension: float) -> np.ndarray:
        key = round(duration, 12)
        if key not in propagators:
            propagators[key] = expm(np.block([[A, U], [np.zeros((2, 7))]]) * key)[:5]
        return np.asarray(propagators[key] @ np.concatenate([state, [command, tension]]))

    sensors = ("force_measured", "position_measured")
    signals = ("position", "velocity", "coil_current", "coil_voltage", *sensors)
    reference = Reference("voice_coil_dma", ("force_reference", "tension"), signals, STEP)
    count = round(STOP / STEP)
    for k in range(count + 1):
        now = stimulus(k, state[1])
        row = [state[1], state[2], state[0], command, state[3], state[4]]
        reference.add(k * STEP, now, lambda _, row=row: row)
        # sample instants are thirtieths and communication points hundredths of a second: counted in
        # 1/300 s
        at = 3 * k
        while at < 3 * (k + 1) and k < count:
            if at == 10 * sample:
                error = now[0] - state[3]
                command = min(max(command + B0 * error + B1 * previous, LOW), HIGH)
                previous = error
                sample = sample + 1
            until = min(3 * (k + 1), 10 * sample)
            state = flow((until - at) / 300, now[1])
            at = until
    reference.write("voice_coil_dma", STOP, "matrix exponential")


if __name__ == "__main__":
    main()
