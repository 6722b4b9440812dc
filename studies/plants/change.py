"""A change hidden at one place of a plant: in a law, in an input or in a sensor's reading.

All of it is written as what comes *more*, so that a plant without it is the clean one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf

Memory = Sequence[float]


@dataclass(frozen=True)
class Change:
    """A function of the signal at a place, which may have states of its own.

    Attributes
    ----------
    place : str
        Law with the signal it is of, input, or output.
    more : callable
        What is added, of the signal and the memory.
    rates : callable, optional
        Derivatives of the memory, of the same.
    rest : tuple of float
        The memory at first.
    finest : float
        s, longest step in which it can be integrated.
    delay : float
        s, by which an output is recorded late, in whole samples.
    """

    place: str
    more: Callable[[float, Memory], float]
    rates: Callable[[float, Memory], list[float]] = lambda x, s: []
    rest: tuple[float, ...] = ()
    finest: float = inf
    delay: float = 0.0


NOTHING = Change("", lambda x, s: 0.0)


def static(place: str, curve: Callable[[float], float], finest: float = inf) -> Change:
    """Return a curve without memory."""
    return Change(place, lambda x, s: curve(x), finest=finest)


def of_time(place: str, course: Callable[[float, float], float]) -> Change:
    """Return a change that depends on the time, s, too, which no law of a model knows."""
    return Change(place, lambda x, s: course(x, s[0]), lambda x, s: [1.0], (0.0,))


def remembered(
    place: str,
    amount: float,
    times: Sequence[float],
    rest: float = 0.0,
    ahead: bool = False,
    own: bool = False,
) -> Change:
    """Return the mean of several lags of first order, in parallel: a spectrum of time constants.

    `ahead` adds what the signal is ahead of them, and `own` takes the signal itself away, so that
    only they are left.
    """
    count = len(times)

    def more(x: float, s: Memory) -> float:
        lagging = sum(s) / count
        return amount * (x - lagging if ahead else lagging - x if own else lagging)

    rates = lambda x, s: [(x - one) / time for one, time in zip(s, times, strict=True)]  # noqa: E731
    return Change(place, more, rates, (rest,) * count, min(times) / 3.0)


def squared(place: str, amount: float, times: Sequence[float]) -> Change:
    """Return the lagged square of a signal, such as heat: mean of several lags of first order."""
    count = len(times)
    rates = lambda x, s: [(x * x - one) / time for one, time in zip(s, times, strict=True)]  # noqa: E731
    return Change(
        place, lambda x, s: amount * sum(s) / count, rates, (0.0,) * count, min(times) / 3.0
    )


def in_a_row(place: str, amount: float, time: float, count: int) -> Change:
    """Return several equal lags in series instead of the signal; the time is that of all."""

    def rates(x: float, s: Memory) -> list[float]:
        return [(before - one) * count / time for before, one in zip([x, *s[:-1]], s, strict=True)]

    return Change(
        place, lambda x, s: amount * (s[-1] - x), rates, (0.0,) * count, time / count / 3.0
    )


def ladder(place: str, amount: float, time: float, count: int = 3) -> Change:
    """Return a ladder of equal resistances and capacities, as diffusion is in pieces.

    It counts what its first node has per `amount`.

    The signal flows into the first node, and the last one has no resistance less to its end.
    """

    def rates(x: float, s: Memory) -> list[float]:
        flows = [x, *(count * (a - b) for a, b in zip(s, [*s[1:], 0.0], strict=True))]
        return [count * (a - b) / time for a, b in pairwise(flows)]

    return Change(place, lambda x, s: amount * s[0], rates, (0.0,) * count, time / count**2 / 4.0)


def play(place: str, gap: Callable[[float], float], time: float) -> Change:
    """Return play: the passed value follows only where the signal is beyond a gap.

    It follows at once, and settles in a time.
    """
    return Change(
        place,
        lambda x, s: s[0] + gap(x - s[0]) - x,
        lambda x, s: [gap(x - s[0]) / time],
        (0.0,),
        time / 3.0,
    )


def late(output: str, delay: float) -> Change:
    """Return a logger that is late."""
    return replace(NOTHING, place=output, delay=delay)
