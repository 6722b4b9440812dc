"""Fair timing of several things: in turns within one run, so that disturbances hit all of them."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .tables import Cell, Table

Duration = Callable[[], float]
UNITS = {"s": 1.0, "ms": 1e3, "µs": 1e6, "ns": 1e9}


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

    def ratio_of_best(self, name: str, other: str) -> float:
        """Shortest duration over the other's shortest."""
        return self.best(name) / self.best(other)

    def median_ratio(self, name: str, other: str) -> float:
        """Median over the rounds of the ratio within a round."""
        return float(np.median(self.seconds[name] / self.seconds[other]))


def timed(
    action: Callable[[], object], count: int = 1, clock: Callable[[], float] = time.perf_counter
) -> Duration:
    """Return a function that performs an action and returns its seconds, divided by a count."""

    def duration() -> float:
        begin = clock()
        action()
        return (clock() - begin) / count

    return duration


def take_turns(durations: Mapping[str, Duration], rounds: int) -> Times:
    """Measure durations in interleaved rounds, each after one call that is not counted.

    The order within a round rotates from round to round: nothing always follows the same thing.
    Garbage collection is off meanwhile.

    Parameters
    ----------
    durations : mapping of str to callable
        Each does something and returns the seconds it took.
    rounds : int
        At least 1.

    Returns
    -------
    Times
    """
    names = list(durations)
    seconds = {name: np.empty(rounds) for name in names}
    for name in names:
        durations[name]()
    collecting = gc.isenabled()
    gc.disable()
    try:
        for k in range(rounds):
            turn = k % len(names)
            for name in names[turn:] + names[:turn]:
                seconds[name][k] = durations[name]()
    finally:
        if collecting:
            gc.enable()
    return Times(seconds)


def comparison(
    times: Times,
    against: Mapping[str, str],
    unit: str = "µs",
    targets: Mapping[str, float] | None = None,
) -> Table:
    """Tabulate durations beside the one that each is held against.

    Parameters
    ----------
    times : Times
    against : mapping of str to str
        The yardstick of a name; of one that is absent, itself.
    unit : {'µs', 'ns', 'ms', 's'}
        Of the shortest durations.
    targets : mapping of str to float, optional
        The largest median ratio that is aimed at, by name.

    Returns
    -------
    Table
    """
    rows: list[list[Cell]] = []
    for name in times.seconds:
        other = against.get(name, name)
        ratio = times.median_ratio(name, other)
        target = verdict(ratio, (targets or {}).get(name))
        best = UNITS[unit] * times.best(name)
        rows.append([name, best, other, times.ratio_of_best(name, other), ratio, target])
    columns = ["", f"best, {unit}", "held against", "ratio of best", "median ratio", "target"]
    return Table(columns, rows)


def verdict(figure: float, target: float | None) -> str:
    """Return a target and whether a figure is at most that; empty without a target."""
    if target is None:
        return ""
    return f"{target:.3g}, {'met' if figure <= target else 'missed'}"


def exponent(times: Times, sizes: Mapping[str, int]) -> float:
    """Exponent of the power law through the shortest times, by least squares in logarithms."""
    logarithms = np.log([[size, times.best(name)] for name, size in sizes.items()])
    return float(np.polyfit(*logarithms.T, 1)[0])


def in_a_process(function: Callable[..., Any], *arguments: object) -> tuple[Any, float]:
    """Call a function in a fresh process.

    Returns
    -------
    result : object
    peak : float
        The largest memory of the process, GB.

    Raises
    ------
    RuntimeError
        If the process ends without a result.
    """
    from tests.support import hosts

    # Stock pythonfmu reads freed memory when a process ends: it leaves without cleaning up.
    finished = hosts.finish_in_subprocess(
        _with_peak, function, arguments, clean_exit=False, timeout=3600.0
    )
    if finished.result is None:
        raise RuntimeError(
            f"the measuring process ended with return code {finished.returncode}\n{finished.output}"
        )
    result: tuple[Any, float] = finished.result
    return result


def _with_peak(function: Callable[..., Any], arguments: tuple[object, ...]) -> tuple[Any, float]:
    import resource  # absent on Windows

    result = function(*arguments)
    return result, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
