"""What an input of an experiment may get: its limits, and a menu of shapes between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmus.kit.errors import UserError
from orchestration.discrepancy.candidates.evidence import FittedCandidate
from orchestration.discrepancy.data.dataset import Dataset
from orchestration.experiment import waveforms

Array = NDArray[np.float64]
Limits = Mapping[str, tuple[float, float]]
_STAYS = (
    600.0,
    120.0,
    25.0,
)  # shortest stays, as shares of the duration: what answers at once, what creeps
_SHAPES: dict[str, Callable[..., Array]] = {
    "constant": lambda time, value: np.full(time.size, value),
    "multilevel": lambda time, levels, dwell, seed: waveforms.multilevel(time, levels, dwell, seed),
    "ramps": lambda time, times, levels: waveforms.ramps(time, times, levels),
    "steps": lambda time, times, levels, initial: waveforms.steps(time, times, levels, initial),
}


@dataclass(frozen=True)
class Stimulus:
    """What one input gets, as the table of an experiment says it.

    Attributes
    ----------
    kind : str
    keys : dict
        SI.
    """

    kind: str
    keys: dict[str, Any]

    def values(self, time: Array) -> Array:
        """Signal over time (n,), SI."""
        return _SHAPES[self.kind](time, **self.keys)


def limits_of_inputs(
    base: FittedCandidate, data: Dataset, limits: Limits
) -> dict[str, tuple[float, float]]:
    """Limits of every real input: given and declared ones, else what the record shows.

    Parameters
    ----------
    base : FittedCandidate
        Its model declares the inputs.
    data : Dataset
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
    declared = {v.name: v for v in base.candidate.cls.layout.inputs}
    for name in limits:
        if name not in declared:
            raise UserError(
                f"limits of {name}: there is no such input; there are {', '.join(declared)}"
            )
    limits_by_input = {}
    for name, v in declared.items():
        if v.type != "real":
            continue
        shown = np.asarray(data.inputs.get(name, v.start), dtype=float)
        given = limits.get(name, (v.min, v.max))
        low, high = max(given[0], v.min), min(given[1], v.max)
        low = low if np.isfinite(low) else float(shown.min())
        high = high if np.isfinite(high) else float(shown.max())
        if low > high:
            raise UserError(f"limits of {name}: {low:g} to {high:g} {v.unit} leaves nothing")
        limits_by_input[name] = (low, high)
    return limits_by_input


def shapes_between(
    low: float, high: float, rest: float, duration: float, step: float, shortest: float, seed: int
) -> list[Stimulus]:
    """Shapes between two limits, the broadest excitation first.

    Parameters
    ----------
    low, high, rest : float
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

    def levels(a: float, b: float, count: int = 5) -> list[float]:
        return [float(np.clip(float(f"{x:.4g}"), low, high)) for x in np.linspace(a, b, count)]

    def grid(*shares: float) -> list[float]:
        return [round(float(round(share * duration / step) * step), 9) for share in shares]

    stays = [round(max(shortest, duration / share), 6) for share in _STAYS]
    fast, medium, slow = ([stay, 4.0 * stay] for stay in stays)
    middle, quarter = 0.5 * (low + high), 0.25 * (high - low)
    ends = np.clip([rest - quarter, rest + quarter], low, high)
    kinds = [
        *({"levels": levels(low, high), "dwell": dwell} for dwell in (medium, fast, slow)),
        *(
            {"levels": levels(middle, high, 4), "dwell": dwell} for dwell in (medium, slow)
        ),  # about a bias
        *({"levels": levels(*ends), "dwell": dwell} for dwell in (medium,)),  # small
    ]
    ramp = grid(*np.linspace(0.0, 1.0, 9))
    pulse = grid(*np.linspace(0.02, 0.98, 17)[:-1])
    active = [
        (low, high)[k % 2] if k // 4 % 2 == 0 else rest for k in range(len(pulse))
    ]  # with pauses
    return [
        *(Stimulus("multilevel", {**kind, "seed": seed}) for kind in kinds),
        Stimulus(
            "ramps",
            {"times": ramp, "levels": [(rest, high, rest, low)[k % 4] for k in range(len(ramp))]},
        ),
        Stimulus("steps", {"times": pulse, "levels": active, "initial": rest}),
        *(Stimulus("constant", {"value": value}) for value in dict.fromkeys((rest, middle, high))),
    ]
