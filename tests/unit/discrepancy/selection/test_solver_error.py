"""Claims: a simulation by another solver is no cause, and what is hidden in one is.

The records are those of SciPy's solvers, or of steps that are written out here; the models are the
studies' own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.kit.generic import coulomb_friction
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.discrepancy.diagnosis import Diagnosis, diagnose
from orchestration.discrepancy.note import NoteCode
from studies.plants.models.cell import EFFECTS as OF_CELL
from studies.plants.models.cell import Cell
from studies.plants.models.motor import EFFECTS as OF_MOTOR
from studies.plants.models.motor import Motor
from studies.plants.models.pendulum import EFFECTS as OF_PENDULUM
from studies.plants.models.pendulum import Pendulum
from tests.support.pace import slow_but

COUNT = 900
EFFECTS = {Motor: OF_MOTOR, Pendulum: OF_PENDULUM, Cell: OF_CELL}
Rates = Callable[[np.ndarray], np.ndarray]


def euler(rates: Rates, x: np.ndarray, step: float) -> np.ndarray:
    """Twenty steps of forward Euler."""
    for _ in range(20):
        x = x + step / 20.0 * rates(x)
    return x


def runge_kutta(rates: Rates, x: np.ndarray, step: float) -> np.ndarray:
    """One step of the classical method of fourth order."""
    first = rates(x)
    second = rates(x + 0.5 * step * first)
    third = rates(x + 0.5 * step * second)
    fourth = rates(x + step * third)
    return x + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)


def lsoda(rates: Rates, x: np.ndarray, step: float) -> np.ndarray:
    """SciPy's, with a relative tolerance of 1e-6."""
    solved = solve_ivp(lambda t, y: rates(y), (0.0, step), x, method="LSODA", rtol=1e-6)
    return solved.y[:, -1]


SOLVERS = {"LSODA": lsoda, "Runge-Kutta": runge_kutta, "Euler": euler}


def levels(seed: int, dwell: int, size: float) -> np.ndarray:
    drawn = np.random.default_rng(seed).uniform(-size, size, COUNT // dwell + 1)
    return np.repeat(drawn, dwell)[:COUNT]


def motor(solver, seed: int, friction: float) -> Dataset:
    step, u, speed = 0.02, levels(seed, 60, 12.0), np.zeros((COUNT, 1))
    for k in range(COUNT - 1):

        def rates(x, voltage=u[k]):
            torque = 0.055 * (voltage - 0.055 * x) / 2.2
            return (torque - 1.3e-4 * x - friction * np.tanh(x / 0.5)) / 6e-4

        speed[k + 1] = solver(rates, speed[k], step)
    current = (u - 0.055 * speed[:, 0]) / 2.2
    outputs = {"current": current, "speed": speed[:, 0]}
    return Dataset(step * np.arange(COUNT), {"voltage": u}, outputs)


def pendulum(solver, seed: int, friction: float) -> Dataset:
    step, u, x = 0.1, levels(seed, 50, 3.0), np.zeros((COUNT, 2))
    for k in range(COUNT - 1):

        def rates(x, torque=u[k]):
            drag = 0.36 * x[1] + friction * np.tanh(x[1] / 0.02)
            return np.array([x[1], (torque - 5.4 * np.sin(x[0]) - drag) / 0.55])

        x[k + 1] = solver(rates, x[k], step)
    return Dataset(step * np.arange(COUNT), {"torque": u}, {"position": x[:, 0]})


def cell(solver, seed: int, second: float) -> Dataset:
    """The second of its pairs has a time constant of 200 s."""
    step, u, x = 0.5, levels(seed, 40, 2.0), np.zeros((COUNT, 2))
    for k in range(COUNT - 1):

        def rates(x, current=u[k]):
            return (current - x) / np.array([24.0, 200.0])

        x[k + 1] = solver(rates, x[k], step)
    voltage = 3.28 - 0.033 * u - 0.018 * x[:, 0] - second * x[:, 1]
    return Dataset(step * np.arange(COUNT), {"current": u}, {"voltage": voltage})


PLANTS = {"motor": (motor, Motor), "pendulum": (pendulum, Pendulum), "cell": (cell, Cell)}
HIDDEN = {
    "motor": (0.003, {"coulomb_friction"}),
    "pendulum": (0.1, {"coulomb_friction"}),
    "cell": (0.01, {"second_kelvin", "third_kelvin"}),  # they differ in where a fit starts
}


def diagnosed(plant: str, solver: str, seed: int, hidden: float) -> Diagnosis:
    drawn, model = PLANTS[plant]
    data = drawn(SOLVERS[solver], seed, hidden)
    return diagnose(model, data, [*EFFECTS[model].values()])


@pytest.mark.parametrize("solver", slow_but(SOLVERS, "Euler"))
@pytest.mark.parametrize("plant", PLANTS)
def test_another_solver_is_no_cause(plant, solver):
    diagnosis = diagnosed(plant, solver, 3, 0.0)
    assert diagnosis.causes == []
    assert diagnosis.verdict in ("consistent", "recalibrate")
    assert [note.code for note in diagnosis.notes if note.code is NoteCode.SOLVER_ERROR]


@pytest.mark.slow
@pytest.mark.parametrize("solver", slow_but(SOLVERS, "LSODA"))
@pytest.mark.parametrize("plant", PLANTS)
def test_what_is_hidden_in_a_simulation_is_named_alone(plant, solver):
    hidden, names = HIDDEN[plant]
    diagnosis = diagnosed(plant, solver, 4, hidden)
    assert len(diagnosis.causes) == 1
    assert diagnosis.causes[0] in names
    assert NoteCode.SOMETHING_LEFT not in {note.code for note in diagnosis.notes}


@pytest.mark.parametrize("disturbance", ["noise", "steps"])
def test_what_was_measured_is_not_taken_for_a_simulation(disturbance):
    """With noise of a thousandth of its spread, or steps of a converter of ten bits."""
    data = pendulum(runge_kutta, 5, 0.0)
    position = data.measured["position"]
    if disturbance == "noise":
        shown = position + 1e-3 * np.std(position) * np.random.default_rng(1).standard_normal(COUNT)
    else:
        least = np.ptp(position) / 1024
        shown = np.round(position / least) * least
    measured = Dataset(data.time, data.inputs, {"position": shown})
    diagnosis = diagnose(Pendulum, measured, [coulomb_friction(Pendulum, "friction", "velocity")])
    assert NoteCode.SOLVER_ERROR not in {note.code for note in diagnosis.notes}
