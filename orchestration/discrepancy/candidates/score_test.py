"""Score directions: how an effect would move the residual, without any fit (Rao's score test).

At the fitted base model an effect is evaluated at its neutral value, where the simulation gives the
exact derivative by its switch, and, because some do nothing until they are large, at a few other
values, where it gives a difference. Second parameters, such as time constants, are taken on a
small grid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit import Effect, UserError, transport_delay
from fmus.kit.arrays import Array
from orchestration.discrepancy.candidates.candidate import own_parameters
from orchestration.identify.fitting import Problem

GRID = (0.2, 0.45, 1.0, 2.2, 5.0)  # times the default of a second parameter
COARSE = (0.2, 1.0, 5.0)  # of two of them
SWITCHED = (1.0, 4.0, 16.0)  # times the nominal value of a switch, where differences are taken
# Lengths of a delay: it shows a step of an input another sample later, which is no smooth function
# of it.
_DELAYS = 16
_TRUST = 1.0 / 3.0, 3.0  # multiples of a difference that it still represents


@dataclass(frozen=True)
class ScoreDirection:
    """Change of the residual of every output by an effect.

    Attributes
    ----------
    values : dict of str to float
        Its parameters, SI; the switch is where the derivative was taken, or where the difference
        ends.
    gradient : dict of str to ndarray of float32, shape (m,)
        Derivative by the searched coordinate of the switch, or difference; where the output was
        measured.
    least, most : float
        How much of it there may be: bounds of the searched coordinate, or how far a difference can
        be trusted.
    """

    values: dict[str, float]
    gradient: dict[str, NDArray[np.float32]]
    least: float
    most: float


def score_directions(problem: Problem, effect: type[Effect]) -> list[ScoreDirection]:
    """Simulate how an effect would move the residual.

    Parameters
    ----------
    problem : Problem
        Of the model with the effect, its start being the fitted base; searched is what the effect
        brings.
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
    directions: list[ScoreDirection] = []
    failure = None
    for second in _grid(others, problem.declared):
        try:
            directions += _directions_at(problem, effect, switch, second)
        except UserError as error:  # with such a shape it cannot be simulated, with another perhaps
            failure = error
    if failure is not None and not directions:
        raise failure
    return directions


def _directions_at(
    problem: Problem, effect: type[Effect], switch: str, second: dict[str, float]
) -> list[ScoreDirection]:
    """Return the derivative by the switch, and differences, at values of the second parameters."""
    base, slopes = problem.evaluate(problem.position(problem.start | second))
    directions = []
    column = problem.names.index(switch)
    local = {output: slope[:, column].astype(np.float32) for output, slope in slopes.items()}
    if any(derivative.any() for derivative in local.values()):
        neutral = problem.declared[switch].start
        here = problem.scales[column].position(neutral)
        low, high = (float(end[column]) for end in problem.bounds())
        values = second | {switch: neutral}
        directions.append(ScoreDirection(values, local, low - here, high - here))
    for value in _trials(effect, problem.declared[switch], problem.time):
        values = second | {switch: value}
        try:
            moved, _ = problem.evaluate(problem.position(problem.start | values))
        except UserError:  # too much of it for a simulation
            continue
        difference = {output: (moved[output] - base[output]).astype(np.float32) for output in base}
        directions.append(ScoreDirection(values, difference, *_TRUST))
    return directions


def _trials(effect: type[Effect], switch: Any, time: Array) -> list[float]:
    """Return values of a switch at which a difference is taken, within its range."""
    if getattr(effect, "made_by", None) is transport_delay:
        step = float(np.median(np.diff(time)))
        most = switch.max
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
    """Return points of the second parameters, each at some multiples of its default."""
    factors = GRID if len(names) < 2 else COARSE
    choices = []
    for name in names:
        p = declared[name]
        choices.append(sorted({float(np.clip(p.start * f, p.min, p.max)) for f in factors}))
    return [dict(zip(names, point, strict=True)) for point in product(*choices)]


def start_values(
    direction: ScoreDirection, problem: Problem, switch: str, amount: float
) -> dict[str, float]:
    """Return the parameters of the effect from which a fit starts, for an amount of it."""
    if direction.least > 0.0:
        return direction.values
    declared = problem.declared[switch]
    scale = problem.scales[problem.names.index(switch)]
    value = scale.value(scale.position(declared.start) + amount)
    return direction.values | {switch: float(np.clip(value, declared.min, declared.max))}
