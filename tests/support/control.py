"""Records of plants under control, integrated by SciPy, with noise and disturbances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fmus.kit import Component
from orchestration.records import Record
from tests.support.control_models import Cart, Tank, Upright

Rates = Callable[[np.ndarray, float], list[float]]


@dataclass(frozen=True)
class Hidden:
    """Errors of a model that a record may hide.

    Attributes
    ----------
    dry, cubic : float
        Dry friction, and a cubic stiffness.
    offset : float
        Of the input.
    """

    dry: float = 0.0
    cubic: float = 0.0
    offset: float = 0.0


@dataclass(frozen=True)
class Plant:
    """A plant with its controller.

    Attributes
    ----------
    cls : type of Component
        Model of it.
    rates : callable
        Of specimen factors and what is hidden, the rates of states and input.
    shown : int
        State that is measured.
    step : float
        s.
    hold, size : int, float
        Samples for which a reference stays, and its standard deviation.
    proportional, derivative : float
        Gains of the controller.
    push : float
        Standard deviation of a disturbance of the input, one for each step.
    hidden : mapping of str to Hidden
        What may be hidden in it, by name.
    """

    cls: type[Component]
    rates: Callable[[np.ndarray, Hidden], Rates]
    shown: int
    step: float
    hold: int
    size: float
    proportional: float
    derivative: float
    push: float
    hidden: dict[str, Hidden]


def _upright(factors: np.ndarray, hidden: Hidden) -> Rates:
    inertia, weight, damping = factors * (0.5, 5.0, 0.4)

    def rates(state: np.ndarray, torque: float) -> list[float]:
        angle, velocity = state
        moments = torque + hidden.offset + weight * np.sin(angle) - damping * velocity
        moments -= hidden.dry * np.tanh(velocity / 0.05) + hidden.cubic * angle**3
        return [velocity, moments / inertia]

    return rates


def _cart(factors: np.ndarray, hidden: Hidden) -> Rates:
    mass = 2.0 * factors[0]

    def rates(state: np.ndarray, force: float) -> list[float]:
        place, velocity = state
        rest = force + hidden.offset - hidden.cubic * place**3
        return [velocity, (rest - hidden.dry * np.tanh(velocity / 0.03)) / mass]

    return rates


def _tank(factors: np.ndarray, hidden: Hidden) -> Rates:
    area, lag = factors[:2] * (0.5, 2.0)

    def rates(state: np.ndarray, command: float) -> list[float]:
        flow, level = state
        into = flow + hidden.offset - hidden.cubic * level**3
        return [(command - flow) / lag, into / area]

    return rates


PLANTS = {
    "upright": Plant(
        Upright,
        _upright,
        shown=0,
        step=0.02,
        hold=40,
        size=0.2,
        proportional=25.0,
        derivative=4.0,
        push=0.05,
        hidden={
            "dry": Hidden(dry=0.35),
            "cubic": Hidden(cubic=40.0),
            "offset": Hidden(offset=0.4),
        },
    ),
    "cart": Plant(
        Cart,
        _cart,
        shown=0,
        step=0.02,
        hold=60,
        size=0.5,
        proportional=12.0,
        derivative=7.0,
        push=0.1,
        hidden={"dry": Hidden(dry=1.0), "cubic": Hidden(cubic=6.0), "offset": Hidden(offset=0.6)},
    ),
    "tank": Plant(
        Tank,
        _tank,
        shown=1,
        step=0.5,
        hold=60,
        size=0.3,
        proportional=0.05,
        derivative=0.05,
        push=5e-4,
        hidden={"cubic": Hidden(cubic=0.15), "offset": Hidden(offset=0.004)},
    ),
}
_NOISE = 2e-3  # of the measurement
_CLEAN = Hidden()


def control_record(name: str, hidden: str = "", seed: int = 1, samples: int = 1200) -> Record:
    """Return a record of a plant whose controller acts on what is measured.

    Parameters
    ----------
    name : str
        Of `PLANTS`.
    hidden : str
        By its name; nothing by default.
    seed : int
        Of the specimen, the reference, the noise and the disturbance.
    samples : int
    """
    plant = PLANTS[name]
    random = np.random.default_rng([seed, *name.encode()])
    errors = plant.hidden[hidden] if hidden else _CLEAN
    rates = plant.rates(np.exp(random.uniform(-0.2, 0.2, 3)), errors)
    steps = random.normal(0.0, plant.size, samples // plant.hold + 1)
    reference = np.repeat(steps, plant.hold)[:samples]
    inputs, measured = np.zeros((2, samples))
    state, speed, last = np.zeros(2), 0.0, None
    for k in range(samples):
        measured[k] = state[plant.shown] + _NOISE * random.standard_normal()
        change = 0.0 if last is None else (measured[k] - last) / plant.step
        speed, last = 0.5 * (speed + change), measured[k]
        error = reference[k] - measured[k]
        inputs[k] = plant.proportional * error - plant.derivative * speed
        acting = inputs[k] + plant.push * random.standard_normal()
        run = solve_ivp(
            lambda _, s, u=acting: rates(s, u), (0.0, plant.step), state, rtol=1e-8, atol=1e-10
        )
        state = run.y[:, -1]
    (column,) = plant.cls.layout.inputs
    (output,) = plant.cls.layout.outputs
    signals = {column.name: inputs, output.name: measured}
    units = {column.name: column.unit, output.name: output.unit}
    return Record(plant.step * np.arange(samples), signals, units, Path(f"{name}_{seed}.csv"))
