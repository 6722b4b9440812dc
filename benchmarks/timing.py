"""Fair timing of several things: in turns within one run, so that disturbances hit all of them."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Times:
    """Durations of several things, measured in turns.

    Attributes
    ----------
    seconds : dict of str to ndarray, shape (rounds,)
        By name; element k of all of them belongs to the same round.
    """

    seconds: dict[str, NDArray[np.float64]]

    def best(self, name: str) -> float:
        """Shortest duration in s, the one least disturbed."""
        return float(self.seconds[name].min())

    def median(self, name: str) -> float:
        """Median duration in s."""
        return float(np.median(self.seconds[name]))

    def ratio_of_best(self, name: str, other: str) -> float:
        """Shortest duration over the other's shortest."""
        return self.best(name) / self.best(other)

    def median_ratio(self, name: str, other: str) -> float:
        """Median over the rounds of the ratio within a round."""
        return float(np.median(self.seconds[name] / self.seconds[other]))


def pooled(parts: Sequence[Times]) -> Times:
    """Put the rounds of several measurements of the same things one after another."""
    return Times(
        {name: np.concatenate([part.seconds[name] for part in parts]) for name in parts[0].seconds}
    )


def take_turns(actions: Mapping[str, Callable[[], object]], rounds: int) -> Times:
    """Time actions in interleaved rounds, each after one call that is not counted.

    The order within a round rotates from round to round: no action always follows the same one.
    Garbage collection is off meanwhile.

    Parameters
    ----------
    actions : mapping of name to callable
    rounds : int
        At least 1.

    Returns
    -------
    Times
    """
    names = list(actions)
    seconds = {name: np.empty(rounds) for name in names}
    for name in names:
        actions[name]()
    collecting = gc.isenabled()
    gc.disable()
    try:
        for k in range(rounds):
            turn = k % len(names)
            for name in names[turn:] + names[:turn]:
                begin = time.perf_counter()
                actions[name]()
                seconds[name][k] = time.perf_counter() - begin
    finally:
        if collecting:
            gc.enable()
    return Times(seconds)
