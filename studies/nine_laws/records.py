"""Two records of a plant with a hidden law: one to fit and one that is held out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from fmus.kit.arrays import Array
from studies.nine_laws.plants import PLANTS, Numbers, Plant

_SAMPLES = 1000


@dataclass(frozen=True)
class NineLawsCase:
    """A record to draw.

    Attributes
    ----------
    law : str
        Key of `PLANTS`.
    seed : int
    """

    law: str
    seed: int


@dataclass(frozen=True)
class Drawn:
    """Two records, and what is known only to who judges.

    Attributes
    ----------
    plant : Plant
    fitted, held_out : dict of str to ndarray, shape (n,)
        Columns by ``name [unit]``.
    parameters : Mapping of str to float
        True values.
    strength : float
        Of the hidden law.
    noise : float
        Standard deviation over that of each output.
    """

    plant: Plant
    fitted: dict[str, Array]
    held_out: dict[str, Array]
    parameters: Numbers
    strength: float
    noise: float


def cases(each: int, seed: int) -> list[NineLawsCase]:
    """Return the cases of a study."""
    return [NineLawsCase(law, seed + k) for k in range(each) for law in PLANTS]


def draw_law(case: NineLawsCase) -> Drawn:
    """Draw the records of a case."""
    plant = PLANTS[case.law]
    rng = np.random.default_rng([case.seed, list(PLANTS).index(case.law)])
    parameters = {name: value * rng.uniform(0.8, 1.25) for name, value in plant.parameters.items()}
    parameters |= {name: plant.parameters[name] for name in plant.known}
    strength = float(rng.uniform(*plant.strengths))
    noise = float(rng.uniform(0.004, 0.015))
    time = plant.step * np.arange(_SAMPLES)
    records = []
    for _ in range(2):
        inputs = np.column_stack([_stimulus(plant, levels, rng) for levels in plant.ranges])
        exact = run(plant, parameters, strength, time, inputs)
        columns = [y + noise * y.std() * rng.standard_normal(len(time)) for y in exact.T]
        names = [f"{name} [{unit}]" for name, unit in (plant.inputs | plant.outputs).items()]
        records.append({"time [s]": time} | dict(zip(names, [*inputs.T, *columns], strict=True)))
    return Drawn(plant, records[0], records[1], parameters, strength, noise)


def _stimulus(plant: Plant, levels: tuple[float, float], rng: np.random.Generator) -> Array:
    """Draw a course of random levels with ramps between them."""
    low, high = levels
    slow = plant.slow / plant.step
    corners = np.cumsum(slow * rng.uniform(0.3, 1.5, _SAMPLES))
    corners = np.append(0.0, corners[corners < _SAMPLES + 2.0 * slow])
    ends = np.minimum(corners[1:], corners[:-1] + 0.1 * slow + 2.0)
    values = rng.uniform(low, high, len(corners) - 1)
    places = np.column_stack([ends, corners[1:]]).ravel()
    return np.asarray(np.interp(np.arange(_SAMPLES), places, np.repeat(values, 2)))


def run(plant: Plant, parameters: Numbers, strength: float, time: Array, inputs: Array) -> Array:
    """Integrate a plant from rest, with inputs (n, nu) in straight lines; return outputs (n, ny).

    Raises
    ------
    ArithmeticError
        If it cannot be integrated.
    """

    def rates(t: float, x: Array) -> list[float]:
        u = np.array([np.interp(t, time, column) for column in inputs.T])
        return plant.rates(x, u, parameters, strength)

    solved = solve_ivp(
        rates,
        (time[0], time[-1]),
        np.zeros(plant.states),
        t_eval=time,
        max_step=plant.step,
        rtol=1e-6,
        atol=1e-10,
    )
    if not solved.success:
        raise ArithmeticError(f"{plant.law}: {solved.message}")
    return np.column_stack(plant.shown(solved.y, inputs.T, parameters, strength))
