"""Menu of stimuli for each input of an experiment: shapes between the limits of a rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fmus.kit import UserError
from fmus.kit.arrays import Array, Signals
from fmus.kit.declare import InputDeclaration
from orchestration.experiment import waveforms

Limits = Mapping[str, tuple[float, float]]
# of the shortest stays: for responses at once, and for creep
_STAYS_PER_DURATION = (600.0, 120.0, 25.0)
_SHAPES: dict[str, Callable[..., Array]] = {
    "constant": lambda time, value: np.full(time.size, value),
    "multilevel": waveforms.multilevel,
    "ramps": lambda time, times, levels: waveforms.ramps(time, times, levels),
    "steps": lambda time, times, levels, initial: waveforms.steps(time, times, levels, initial),
}


@dataclass(frozen=True)
class Stimulus:
    """Stimulus of one input, as in the table of an experiment.

    Attributes
    ----------
    kind : str
    keys : dict
        SI.
    """

    kind: str
    keys: dict[str, Any]

    def values(self, time: Array) -> Array:
        """Return the signal over time (n,), SI."""
        return _SHAPES[self.kind](time, **self.keys)


def operating_values(inputs: Sequence[InputDeclaration], recorded: Signals) -> dict[str, float]:
    """Return the value about which each input was recorded: the median, which is a sample.

    Parameters
    ----------
    inputs : sequence of InputDeclaration
        One that was not recorded has its start value.
    recorded : Mapping of str to ndarray, shape (n,)
        Inputs that were recorded, by name, SI.

    Returns
    -------
    dict of str to float
        SI.
    """
    return {
        v.name: float(np.nanpercentile(recorded.get(v.name, v.start), 50.0, method="lower"))
        for v in inputs
    }


def limits_of_inputs(
    inputs: Sequence[InputDeclaration], recorded: Signals, limits: Limits
) -> dict[str, tuple[float, float]]:
    """Return the limits of every input: those given or declared, else of the record.

    One that kept its value while others moved may be none that can be set, such as a temperature of
    the surroundings: without given limits it stays there. So does one that is no real number.

    Parameters
    ----------
    inputs : sequence of InputDeclaration
    recorded : Mapping of str to ndarray, shape (n,)
        Inputs that were recorded, by name, SI.
    limits : Mapping of str to tuple of float
        Those that are given, by input, SI.

    Returns
    -------
    dict of str to tuple of float
        Lowest and highest value by input, SI.

    Raises
    ------
    UserError
        If a limit is of no input, or leaves nothing.
    """
    declared = {v.name: v for v in inputs}
    for name in limits:
        if name not in declared:
            raise UserError(
                f"limits of {name}: there is no such input; there are {', '.join(declared)}"
            )
    operating = operating_values(inputs, recorded)
    moving = [name for name in declared if name in recorded and np.ptp(recorded[name]) > 0.0]
    return {
        name: _limits_of(variable, recorded.get(name, operating[name]), limits.get(name))
        if name in limits or (variable.type == "real" and (name in moving or not moving))
        else (operating[name], operating[name])
        for name, variable in declared.items()
    }


def _limits_of(
    variable: InputDeclaration, values: Array | float, given: tuple[float, float] | None
) -> tuple[float, float]:
    """Return the limits of an input that may move, within those that it declares."""
    if given is not None and given[0] == given[1]:
        return given
    name = variable.name
    given_low, given_high = given or (variable.min, variable.max)
    low = max(given_low, variable.min)
    high = min(given_high, variable.max)
    if not np.isfinite(low):
        low = float(np.min(values))
    if not np.isfinite(high):
        high = float(np.max(values))
    if low > high:
        raise UserError(f"limits of {name}: {low:g} to {high:g} {variable.unit} leaves nothing")
    return low, high


def menus(
    operating: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
    *,
    duration: float,
    step: float,
    shortest: float,
) -> dict[str, list[Stimulus]]:
    """Return the shapes that every input may take, the broadest excitation first.

    Parameters
    ----------
    operating : Mapping of str to float
        Values at rest, SI.
    limits : Mapping of str to tuple of float
        SI.
    duration, step, shortest : float
        Of the experiment, of its samples, and the shortest stay at a level, s.
    """
    menu = {}
    for seed, (name, (low, high)) in enumerate(limits.items(), start=1):
        resting = float(np.clip(operating[name], low, high))
        menu[name] = shapes_between(
            low, high, resting, duration=duration, step=step, shortest=shortest, seed=seed
        )
    return menu


def shapes_between(
    low: float,
    high: float,
    resting: float,
    *,
    duration: float,
    step: float,
    shortest: float,
    seed: int,
) -> list[Stimulus]:
    """Return shapes between two limits, the broadest excitation first.

    Parameters
    ----------
    low, high, resting : float
        Limits and the value at rest, SI.
    duration, step, shortest : float
        Of the experiment, of its samples, and the shortest stay at a level, s.
    seed : int
        Of random levels.

    Returns
    -------
    list of Stimulus
    """
    if low == high:
        return [Stimulus("constant", {"value": low})]

    def grid(shares: Array) -> list[float]:
        return [round(float(round(share * duration / step) * step), 9) for share in shares]

    stays = [round(max(shortest, duration / number), 6) for number in _STAYS_PER_DURATION]
    ramp_times = grid(np.linspace(0.0, 1.0, 9))
    ramp_levels = [(resting, high, resting, low)[k % 4] for k in range(len(ramp_times))]
    pulse_times = grid(np.linspace(0.02, 0.98, 17)[:-1])
    pulse_levels = []
    for k in range(len(pulse_times)):
        pause = k // 4 % 2 == 1
        pulse_levels.append(resting if pause else (low, high)[k % 2])
    middle = 0.5 * (low + high)
    return [
        *_multilevel_shapes(low, high, resting, stays, seed),
        Stimulus("ramps", {"times": ramp_times, "levels": ramp_levels}),
        Stimulus("steps", {"times": pulse_times, "levels": pulse_levels, "initial": resting}),
        *(
            Stimulus("constant", {"value": value})
            for value in dict.fromkeys((resting, middle, high))
        ),
    ]


def _multilevel_shapes(
    low: float, high: float, resting: float, stays: Sequence[float], seed: int
) -> list[Stimulus]:
    """Return random levels over all of the range, about a bias, and about the value at rest.

    Parameters
    ----------
    low, high, resting : float
        Limits and the value at rest, SI.
    stays : sequence of float
        Three shortest stays at a level, s, in rising order.
    seed : int
    """

    def levels(first: float, last: float, count: int = 5) -> list[float]:
        rounded = [float(f"{x:.4g}") for x in np.linspace(first, last, count)]
        return [float(np.clip(x, low, high)) for x in rounded]

    fast, medium, slow = [[stay, 4.0 * stay] for stay in stays]
    middle = 0.5 * (low + high)
    quarter = 0.25 * (high - low)
    everywhere = levels(low, high)
    biased = levels(middle, high, 4)
    small = levels(*np.clip([resting - quarter, resting + quarter], low, high))
    shapes = [
        (everywhere, medium),
        (everywhere, fast),
        (everywhere, slow),
        (biased, medium),
        (biased, slow),
        (small, medium),
    ]
    return [
        Stimulus("multilevel", {"levels": list(values), "dwell": dwell, "seed": seed})
        for values, dwell in shapes
    ]
