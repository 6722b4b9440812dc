"""Reference result of the degradation estimator, from weighted normal equations.

At every sample the normal matrix and vector of all samples so far, weighted by age, are solved
afresh; there is no covariance matrix and no gain. The record is a circuit under a square wave, its
series resistance jumping late, with coarse voltage readings for noise. Run ``python -m
studies.references.degradation_estimator`` after changing a default value; its output is in the
component's folder ``reference``. ``NAME_in.csv`` and ``NAME_ref.csv`` have the form of the FMI
cross-check: a repeated time marks a jump.
"""

from collections.abc import Iterator

import numpy as np

from studies.references.files import COMPONENTS, write_lines, write_options

FOLDER = COMPONENTS / "degradation_estimator" / "reference"

NAME = "degradation_estimator"
STEP = 0.1
STOP = 150.0
R1 = 0.43  # ohm
LATER = 0.90  # ohm
R2 = 2.35  # ohm
C = 2.70  # F
JUMP = 125.0  # s
WEIGHT = 0.1
AGE = 600.0
COVARIANCE = 1e4
LEAST_SQUARES = 60.0  # s
FOLLOWING = 30.0  # s
SETTLING = 120.0  # s
REVERSALS = 6
FREQUENCY = 0.628
LIMIT = 1.5
VOLTAGE_STEP = 0.05
IMPEDANCE_STEP = 0.05
LOWEST = 0.5
OUTPUTS = ("R1", "R2", "C", "estimate_valid", "impedance", "impedance_change", "voltage_limit")


def record() -> tuple[np.ndarray, np.ndarray]:
    """+-0.9 A at 0.2 Hz (fig. 3-4) and the voltage it causes, read to 5 mV."""
    time = np.arange(round(STOP / STEP)) * STEP
    current = np.where(np.arange(time.size) % 50 < 25, 0.9, -0.9)
    charge = 0.0
    voltage = np.empty_like(time)
    for k, (t, i) in enumerate(zip(time, current, strict=True)):
        r1 = R1 if t < JUMP else LATER
        end = R2 * C * i
        voltage[k] = R2 * (r1 * i + charge / C) / (r1 + R2)
        charge = end + (charge - end) * np.exp(-STEP / ((r1 + R2) * C))
    return current, np.round(voltage / 0.005) * 0.005


def circuit(theta: np.ndarray) -> tuple[float, float, float]:
    """R1, R2 and C by steady state, first instant and decay of the response to a held current."""
    b0, b1, a = theta
    steady = (b0 + b1) / (1 + a)
    first = b0
    tau = STEP / -np.log(-a)
    r1 = 1 / (1 / first - 1 / steady)  # at first R1 and R2 are in parallel
    return r1, steady, tau / (r1 + steady)


def magnitude(r1: float, r2: float, c: float) -> float:
    """R2 in parallel with R1 and C in series."""
    branch = r1 + 1 / (1j * FREQUENCY * c)
    return abs(r2 * branch / (r2 + branch))


def estimates(current: np.ndarray, voltage: np.ndarray) -> Iterator[np.ndarray]:
    """Yield b0, b1 and a at every sample from the second on, from weighted normal equations."""
    forgetting = WEIGHT ** (STEP / AGE)
    matrix = np.eye(3) / COVARIANCE
    vector = np.zeros(3)
    auxiliary = np.zeros(3)
    i_filtered = current[0]
    v_filtered = voltage[0]
    model = 0.0
    for k in range(1, len(current)):
        pole = -auxiliary[2]
        i_now = current[k] + pole * i_filtered
        v_now = voltage[k] + pole * v_filtered
        late = k - 1 >= round(LEAST_SQUARES / STEP)  # samples estimated before
        if late:
            data = np.array([i_now, i_filtered, -v_filtered])
            instrument = np.array([i_now, i_filtered, -model])
        else:
            data = instrument = np.array([current[k], current[k - 1], -voltage[k - 1]])
        matrix = forgetting * matrix + np.outer(instrument, data)
        vector = forgetting * vector + instrument * (v_now if late else voltage[k])
        theta = np.linalg.solve(matrix, vector)
        model = auxiliary[0] * i_now + auxiliary[1] * i_filtered + pole * model
        i_filtered = i_now
        v_filtered = v_now
        share = 1 - np.exp(-STEP / FOLLOWING) if late else 1.0
        auxiliary = auxiliary + share * (theta - auxiliary)
        yield theta


def solve(current: np.ndarray, voltage: np.ndarray) -> list[list[float]]:
    """Return outputs at every communication point; a sample shows at the one after it."""
    reference = 0.0
    steps = 0.0
    rows = [[0.0] * 6 + [LIMIT]] * 2  # nothing is known before there are two samples
    for k, theta in enumerate(estimates(current, voltage), 1):
        b0, b1, a = theta
        sound = -1 < a < 0 < b0 and b1 > a * b0
        estimate = circuit(theta) if sound else tuple(rows[-1][:3])
        valid = sound and k >= round(SETTLING / STEP) and 1 + k // 25 >= REVERSALS
        size = magnitude(*estimate) if estimate[1] else 0.0
        if valid and not reference:
            reference = size  # what follows is compared with it from the next sample on
        elif valid:
            steps = max(steps, float((size / reference - 1) // IMPEDANCE_STEP))
        change = size / reference - 1 if reference else 0.0
        limit = max(LIMIT - steps * VOLTAGE_STEP, LOWEST)
        rows.append([*estimate, float(valid), size, change, limit])
    return rows


def main() -> None:
    """Write the files."""
    current, voltage = record()
    lines = ["time,current,voltage"]
    for k, pair in enumerate(zip(current, voltage, strict=True)):
        for held in (*([(current[k - 1], voltage[k - 1])] if k else []), pair):
            lines.append(f"{k * STEP:.10g},{held[0]:.6g},{held[1]:.6g}")
    lines.append(f"{STOP:.10g},{current[-1]:.6g},{voltage[-1]:.6g}")
    write_lines(FOLDER / f"{NAME}_in.csv", lines)
    lines = [",".join(["time", *OUTPUTS])]
    for k, row in enumerate(solve(current, voltage)):
        jumps = 0 < k < len(current) and current[k] != current[k - 1]
        # no output follows an input at once, so that both rows of a jump are the same
        lines += [",".join(f"{value:.12g}" for value in (k * STEP, *row))] * (2 if jumps else 1)
    write_lines(FOLDER / f"{NAME}_ref.csv", lines)
    write_options(FOLDER / f"{NAME}_ref.opt", STOP, STEP, "weighted normal equations")


if __name__ == "__main__":
    main()
