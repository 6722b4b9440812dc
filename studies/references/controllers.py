"""Reference results of the controllers, from the laws of their README on plain numbers.

Run ``python -m studies.references.controllers`` after changing a default value; its output is in
the components' folder ``reference``. Communication points are sample instants; the sample at
one is taken just after it, with the new inputs.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from studies.references.files import Reference

Row = list[float]
# Outputs before the first sample, then after each, from the inputs of its instant.
Law = Callable[[Callable[[int], Row], int], Iterator[Row]]


class Case(NamedTuple):
    """A controller and what it is fed.

    Attributes
    ----------
    law : callable
    inputs, outputs : str
        Names, with commas between them.
    stimulus : callable
        Inputs at a sample.
    period : float
        Sample period in s.
    count : int
        Samples.
    """

    law: Law
    inputs: str
    outputs: str
    stimulus: Callable[[int], Row]
    period: float
    count: int


def clip(value: float, low: float, high: float) -> float:
    """Limit a value."""
    return min(max(value, low), high)


def stairs(index: int, levels: Row, length: int = 40) -> float:
    """Return the level that is held at a sample."""
    return levels[index // length % len(levels)]


def pid(inputs: Callable[[int], Row], count: int) -> Iterator[Row]:
    """PI in its incremental form with limits of 10 V, without derivative."""
    h, gain, integral, tracking = 0.01, 0.3, 0.5, 0.5
    command = before = 0.0
    yield [0.0, 0.0]
    for k in range(count):
        error = inputs(k)[0] - inputs(k)[1]
        excess = command - clip(command, -10.0, 10.0)
        command -= h / tracking * excess
        command += gain * (error - before) + gain * h / integral * error
        before = error
        limited = clip(command, -10.0, 10.0)
        yield [limited, float(command != limited)]


def most(side: float, voltage: float, current: float) -> float:
    """Largest current towards a side that the limits allow, and its smallest towards the other."""
    films = side * (voltage * (1.0 + 0.43 / 2.35) - 0.43 * current)
    room = 1.0 - 0.5 * 0.02 * 1.3 - side * voltage
    by_voltage = side * current + room / (0.5 if room > 0 else 0.25)
    by_charge = films / 2.35 + (2.5 - 1.5 * 2.70 * films) / 0.5 * (0.43 + 2.35) / 2.35
    return side * clip(min(by_voltage, by_charge), -1.3, 1.3)


def displacement(inputs: Callable[[int], Row], count: int) -> Iterator[Row]:
    """PI of the displacement between the currents that voltage and charge allow."""
    gain = 3.5e4
    ratio = 0.02 / 7.5  # sample period per integral time
    wanted = command = before = 0.0
    yield [0.0, 0.0, 0.0]
    for k in range(count):
        reference, measured, voltage, current = inputs(k)
        error = reference - measured
        wanted += ratio * (command - wanted) + gain * (error - before + ratio * error)
        before = error
        command = max(min(wanted, most(1.0, voltage, current)), most(-1.0, voltage, current))
        charge = 2.70 * (voltage * (1.0 + 0.43 / 2.35) - 0.43 * current)
        yield [command, float(command != wanted), charge]


class Films(NamedTuple):
    """The actuator as it is sampled, and what follows from it.

    Attributes
    ----------
    poles, driven : ndarray, shape (3,)
        Of charge, Kelvin and Maxwell elongation: what is left after a sample, what an input adds.
    seen : ndarray, shape (2, 3)
        Displacement and voltage of the states.
    kalman : ndarray, shape (3, 2)
    charge_gain, integral_gain : float
    """

    poles: np.ndarray
    driven: np.ndarray
    seen: np.ndarray
    kalman: np.ndarray
    charge_gain: float
    integral_gain: float


def films() -> Films:
    """Return the nominal actuator, sampled at 50 Hz, with its gains."""
    h = 0.02
    rates = np.array([1.0 / (2.70 * 2.78), 1.0e4 / 2.0e6])
    poles = np.append(np.exp(-h * rates), 1.0)
    held = np.append((1.0 - poles[:2]) / rates, h)
    driven = held * np.array([2.35 / 2.78, 1.0 / 2.0e6, 1.0 / 1.7e6])
    seen = np.array([[6.8e-5, 1.0, 1.0], [2.35 / (2.70 * 2.78), 0.0, 0.0]])
    noise = np.diag([1e-3, 1e-8, 1e-8]) ** 2
    measured = np.diag([3e-6, 1e-3]) ** 2
    spread = solve_discrete_are(np.diag(poles), seen.T, noise, measured)
    kalman = spread @ seen.T @ np.linalg.inv(seen @ spread @ seen.T + measured)
    first, second = np.exp(-h / 0.5), np.exp(-h / 1.5)
    charge_gain = (poles[0] + 1.0 - first - second) / driven[0]
    rest = poles[0] - driven[0] * charge_gain - first * second
    integral_gain = -rest / (driven[0] * h * 6.8e-5)
    return Films(poles, driven, seen, kalman, charge_gain, integral_gain)


def observed(model: Films, state: np.ndarray, row: Row) -> np.ndarray:
    """Return the states after a sample, by the Kalman filter."""
    _, displacement, voltage, current, force = row
    predicted = model.poles * state + model.driven * np.array([current, force, force])
    through = np.array([force / 6300.0, 0.43 * 2.35 / 2.78 * current])
    innovations = np.array([displacement, voltage]) - model.seen @ predicted - through
    return np.asarray(predicted + model.kalman @ innovations)


def state_feedback(inputs: Callable[[int], Row], count: int) -> Iterator[Row]:
    """Kalman filter of charge and creep, and their feedback with an integral."""
    model = films()
    reference_gain = model.integral_gain * 0.02 / (1.0 - np.exp(-0.02 / 1.5))
    state = np.zeros(3)
    integral = 0.0
    yield [0.0, 0.0, 0.0, 0.0]
    for k in range(count):
        row = inputs(k)
        state = observed(model, state, row)
        elongation = row[0] - state[1] - state[2] - row[4] / 6300.0
        wanted = reference_gain * elongation - model.charge_gain * state[0] + integral
        reach = (np.array([-2.5, 2.5]) - model.poles[0] * state[0]) / model.driven[0]
        command = clip(clip(wanted, reach[0], reach[1]), -1.3, 1.3)
        integral += model.integral_gain * 0.02 * (row[0] - row[1])
        integral += 0.02 / 1.5 * (command - wanted)
        yield [float(command), *map(float, state)]


def learning(inputs: Callable[[int], Row], count: int) -> Iterator[Row]:
    """Command of a period ago and what its error asks for, smoothed over three samples."""
    commands: Row = []
    lessons: Row = []
    before = 0.0

    def improved(k: int) -> float:
        """Command of a sample with the lesson of the next one; nothing before the start."""
        return (commands[k] if k >= 0 else 0.0) + (lessons[k + 1] if k >= -1 else 0.0)

    yield [0.0]
    for k in range(count):
        reference, displacement, beside = inputs(k)
        ago = k - 40
        smooth = 0.9 * improved(ago) + 0.05 * (improved(ago - 1) + improved(ago + 1))
        commands.append(clip(smooth, -1.3, 1.3))
        error = reference - displacement
        lessons.append(1160.0 * (error + 7.4 * (error - before) / 0.25))
        before = error
        yield [clip(commands[-1] + beside, -1.3, 1.3)]


def ramped(elongation: float, load: float, slope: float, h: float) -> float:
    """Kelvin elongation under a ramp: the ramp late by 200 s, and what was there and fades."""
    late = (load - slope * 200.0) / 1e4
    return late + slope * h / 1e4 + (elongation - late) * float(np.exp(-h / 200.0))


def voltage_ends(charge: float, decay: float, gained: float) -> tuple[float, float]:
    """Least and largest current between which the voltage of a sample stays within 1 V."""
    divider = 2.35 / 2.78
    before, after = divider / 2.70 * charge, divider / 2.70 * decay * charge
    at_once = 0.43 * divider
    later = at_once + divider / 2.70 * gained
    low = max((-1.0 - before) / at_once, (-1.0 - after) / later)
    return low, min((1.0 - before) / at_once, (1.0 - after) / later)


def feedforward(inputs: Callable[[int], Row], count: int) -> Iterator[Row]:
    """Charge that the length needs beside the load, and the current that brings it in time."""
    h = 0.25
    decay = float(np.exp(-h / (2.70 * 2.78)))
    gained = 2.35 * 2.70 * (1.0 - decay)
    charge = kelvin = maxwell = current = 0.0
    yield [0.0, charge, 0.0]
    for k in range(count):
        reference, now, then = inputs(k)
        kelvin = ramped(kelvin, now, (then - now) / h, h)
        maxwell += h * 0.5 * (now + then) / 1.7e6
        wanted = (reference - kelvin - maxwell - then / 6300.0) / 6.8e-5
        needed = (wanted - decay * charge) / gained
        low, high = voltage_ends(charge, decay, gained)
        slow = clip(needed, current - 1.3, current + 1.3)
        current = clip(clip(slow, low, high), -1.3, 1.3)
        charge = decay * charge + gained * current
        yield [current, charge, float(current != needed)]


def impedance(inputs: Callable[[int], Row], count: int) -> Iterator[Row]:
    """Spring, damper and preload, between no force and 3 N."""
    before = rate = 0.0
    yield [0.0, 0.0]
    for k in range(count):
        length, rest = inputs(k)
        rate = (0.05 * rate + length - before) / 0.07
        before = length
        yield [clip(0.5 + 1e3 * (length - rest) + 50.0 * rate, 0.0, 3.0), rate]


def adaptive(inputs: Callable[[int], Row], count: int) -> Iterator[Row]:
    """Follow a model of 1 s with a gain that moves by the normalised MIT rule."""
    decay = float(np.exp(-0.02 / (2.70 * 2.78)))
    per_current = 6.8e-5 * 2.35 * 2.70 * (1.0 - decay)
    pole = float(np.exp(-0.02))
    gain = 1.0
    model = sensitivity = 0.0
    yield [0.0, gain, model]
    for k in range(count):
        reference, displacement = inputs(k)
        nominal = ((pole - decay) * displacement + (1.0 - pole) * reference) / per_current
        command = clip(gain * nominal, -1.3, 1.3)
        if command == gain * nominal:
            size = 1e-12 + sensitivity**2
            gain = clip(gain - 0.02 * (displacement - model) * sensitivity / size, 0.2, 5.0)
        model = pole * model + (1.0 - pole) * reference
        sensitivity = pole * sensitivity + per_current * nominal
        yield [command, gain, model]


CASES = {
    "impedance_controller": Case(
        impedance,
        "length,rest_length",
        "force_reference,length_rate",
        lambda k: [stairs(k, [0.0, 1e-3, 4e-3, -2e-3], 30), stairs(k, [0.0, 5e-4], 50)],
        0.02,
        200,
    ),
    "adaptive_controller": Case(
        adaptive,
        "reference,displacement",
        "command,gain,model_displacement",
        lambda k: [stairs(k, [3e-5, 6e-5, 1e-4, 0.0]), stairs(k, [0.0, 2e-5, 5e-5], 25)],
        0.02,
        320,
    ),
    "feedforward": Case(
        feedforward,
        "next_reference,force,next_force",
        "command,charge,limited",
        lambda k: [
            stairs(k, [1e-5, 4e-5, 3e-4, -2e-4], 20),
            0.05 * (k % 7),
            0.05 * ((k + 1) % 7) if k % 7 < 6 else 0.3,
        ],
        0.25,
        240,
    ),
    "learning_controller": Case(
        learning,
        "reference,displacement,feedback_command",
        "command",
        lambda k: [stairs(k, [1e-5, 4e-5], 20), stairs(k, [0.0, 1e-5], 13), 0.0],
        0.25,
        240,
    ),
    "state_feedback": Case(
        state_feedback,
        "reference,displacement,voltage,current,force",
        "command,charge,kelvin_elongation,maxwell_elongation",
        lambda k: [
            stairs(k, [1e-5, 1e-4, -3e-5]),
            stairs(k, [0.0, 1e-5, 3e-5], 15),
            stairs(k, [0.1, 0.3, 0.2, -0.1], 17),
            stairs(k, [0.4, 1.0, 0.2, -0.7], 23),
            stairs(k, [0.0, 0.2], 31),
        ],
        0.02,
        240,
    ),
    "displacement_controller": Case(
        displacement,
        "reference,displacement,voltage,current",
        "command,limited,charge",
        lambda k: [
            stairs(k, [1e-4, 4e-4, -2e-4]),
            stairs(k, [0.0, 2e-5, 8e-5, 1.2e-4], 15),
            stairs(k, [0.1, 0.6, 0.95, 1.05, -0.4, -0.99], 17),
            stairs(k, [0.4, 1.0, 0.2, -0.7], 23),
        ],
        0.02,
        240,
    ),
    "pid": Case(
        pid,
        "reference,measured",
        "command,saturated",
        lambda k: [stairs(k, [1.0, 60.0, 2.0, -5.0]), stairs(k, [0.0, 0.5, 3.0], 25)],
        0.01,
        320,
    ),
}


def main() -> None:
    """Write the files of all."""
    for name, case in CASES.items():
        reference = Reference(name, case.inputs.split(","), case.outputs.split(","), case.period)
        for k, row in enumerate(case.law(case.stimulus, case.count)):
            reference.add(round(k * case.period, 9), case.stimulus(k), lambda _, row=row: row)
        stop = round(case.count * case.period, 9)
        reference.write("controllers", stop, "sample by sample")


if __name__ == "__main__":
    main()
