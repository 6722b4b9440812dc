"""Score directions: where an effect would move the residual, found without fitting anything (Rao's score test).

At the fitted base model an effect is looked at at its neutral value, where the simulation gives the exact derivative
by its switch, and, because some do nothing until they are large, at a few other values, where it gives a difference.
Second parameters, such as time constants, are looked at on a small grid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Effect
from fmus.kit.errors import UserError
from fmus.kit.sensors import transport_delay
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.identify.problem import Problem

Array = NDArray[np.float64]
GRID = (0.2, 0.45, 1.0, 2.2, 5.0)  # times the default of a second parameter
COARSE = (0.2, 1.0, 5.0)  # of two of them
SWITCHED = (1.0, 4.0, 16.0)  # times the nominal value of a switch, where differences are taken
_DELAYS = 16  # looked at: a delay shows a step of an input another sample later, which is no smooth function of it
_TRUST = 1.0 / 3.0, 3.0  # times the difference that an effect may be for it to tell of it


@dataclass(frozen=True)
class ScoreDirection:
    """What an effect would do to the residual of every output.

    Attributes
    ----------
    values : dict of str to float
        Its parameters, SI; the switch is where the derivative was taken, or where the difference ends.
    gradient : dict of str to ndarray of float32, shape (m,)
        Derivative by the searched coordinate of the switch, or difference; where the output was measured.
    least, most : float
        How much of it there may be: bounds of the searched coordinate, or how far a difference can be trusted.
    """

    values: dict[str, float]
    gradient: dict[str, NDArray[np.float32]]
    least: float
    most: float


def score_directions(problem: Problem, effect: type[Effect]) -> list[ScoreDirection]:
    """Find where an effect would move the residual.

    Parameters
    ----------
    problem : Problem
        Of the model with the effect, its start being the fitted base; searched is what the effect brings.
    effect : type[Effect]

    Returns
    -------
    list of ScoreDirection

    Raises
    ------
    UserError
        If it cannot be simulated, whatever its second parameters.
    """
    switch, *others = own_parameters(effect)
    at, declared = problem.names.index(switch), problem.declared
    neutral = declared[switch].start
    low, high = (float(end[at]) for end in problem.bounds())
    here = problem.scales[at].position(neutral)
    bounds = low - here, high - here
    directions, failed = list[ScoreDirection](), None
    for second in _grid(others, declared):
        try:
            base, slopes = problem.evaluate(problem.position(problem.start | second))
        except UserError as error:  # with such a shape it cannot be simulated, with another perhaps
            failed = error
            continue
        local = {output: slope[:, at].astype(np.float32) for output, slope in slopes.items()}
        if any(column.any() for column in local.values()):
            directions.append(ScoreDirection(second | {switch: neutral}, local, *bounds))
        for value in _trials(effect, declared[switch], problem.time):
            try:
                moved, _ = problem.evaluate(
                    problem.position(problem.start | second | {switch: value})
                )
            except UserError:  # too much of it for a simulation
                continue
            directions.append(
                ScoreDirection(
                    second | {switch: value},
                    {o: (moved[o] - base[o]).astype(np.float32) for o in base},
                    *_TRUST,
                )
            )
    if failed is not None and not directions:
        raise failed
    return directions


def _trials(effect: type[Effect], switch: Any, time: Array) -> list[float]:
    """Values of a switch at which a difference is taken, within its range."""
    if getattr(effect, "made_by", None) is transport_delay:
        step, most = float(np.median(np.diff(time))), switch.max
        samples = np.unique(
            np.round(np.expm1(np.linspace(0.0, np.log1p(most / step - 0.5), _DELAYS)))
        )
        return [float(k + 0.5) * step for k in samples if (k + 0.5) * step <= most] or [most]
    if switch.start > switch.min:  # it goes both ways and is seen at its neutral value
        return []
    return sorted(
        {float(min(switch.start + factor * switch.nominal, switch.max)) for factor in SWITCHED}
    )


def _grid(names: Sequence[str], declared: Mapping[str, Any]) -> list[dict[str, float]]:
    """Points of the second parameters: each at some multiples of its default."""
    factors = GRID if len(names) < 2 else COARSE
    choices = [
        sorted(
            {
                float(np.clip(declared[n].start * factor, declared[n].min, declared[n].max))
                for factor in factors
            }
        )
        for n in names
    ]
    return [dict(zip(names, point, strict=True)) for point in product(*choices)]


def start_values(
    direction: ScoreDirection, problem: Problem, switch: str, amount: float
) -> dict[str, float]:
    """Parameters of the effect where a fit should start, if so much of it is wanted."""
    if direction.least > 0.0:
        return direction.values
    declared, scale = problem.declared[switch], problem.scales[problem.names.index(switch)]
    value = scale.value(scale.position(declared.start) + amount)
    return direction.values | {switch: float(np.clip(value, declared.min, declared.max))}
