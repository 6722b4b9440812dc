"""A term hidden in a law: law, signal, added or multiplied, and the answers that name it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from studies.plants import Change

SAME = 1.0 - 1e-4  # correlation, above which two signals run in proportion
COUNTED = ("", "integrated", "throughput")  # memories that have no time constant
LAGS = ("lagged", "leading")


@dataclass(frozen=True)
class Answer:
    """A law over a signal, as a search may name it."""

    law: str
    kind: str
    signal: str
    memory: str = ""


def answers(text: str) -> frozenset[Answer]:
    """Parse answers such as ``friction, gravity + angle, velocity [lagged]; drop x relaxed``."""
    found = set()
    for part in filter(str.strip, text.split(";")):
        match = re.fullmatch(r"\s*([\w, ]+?) ([+x*]) ([\w, ]+?)\s*(?:\[([\w, ]*)\])?\s*", part)
        if match is None:
            raise ValueError(f"no answer: {part!r}")
        laws, signals, memories = (
            [n.strip() for n in (some or "").split(",")] for some in (match[1], match[3], match[4])
        )
        kinds = {"+": ["add"], "x": ["multiply"], "*": ["add", "multiply"]}[match[2]]
        found |= {
            Answer(law, k, signal, m)
            for law in laws
            for k in kinds
            for signal in signals
            for m in memories
        }
    return frozenset(found)


def is_right(
    said: Answer, right: Iterable[Answer], series: Mapping[str, Array], step: float
) -> bool:
    """Return whether an answer is right, or of a signal proportional to that of a right one.

    Parameters
    ----------
    said : Answer
    right : iterable of Answer
    series : Mapping of str to ndarray, shape (n,)
        Signals of the plant in truth, SI.
    step : float
        Between samples, s.
    """
    same_law = [a for a in right if (a.law, a.kind) == (said.law, said.kind)]
    if said in same_law:
        return True
    mine = counted(said, series, step)
    return mine is not None and any(proportional(mine, counted(a, series, step)) for a in same_law)


def counted(answer: Answer, series: Mapping[str, Array], step: float) -> Array | None:
    """Return the argument of an answer's curve, shape (n,), SI.

    None where it has a time constant, or is not known.
    """
    known = {**series, "time": step * np.arange(max((len(y) for y in series.values()), default=0))}
    if answer.memory not in COUNTED or answer.signal not in known:
        return None
    x = known[answer.signal]
    if answer.memory:
        x = step * np.cumsum(np.abs(x) if answer.memory == "throughput" else x)
    return np.asarray(x)


def proportional(one: Array, other: Array | None) -> bool:
    """Return whether two signals run in proportion, except for their means."""
    if other is None or min(np.ptp(one), np.ptp(other)) <= 1e-9 * max(
        np.abs(one).max(), np.abs(other).max()
    ):
        return False
    return abs(float(np.corrcoef(one, other)[0, 1])) > SAME


Curve = Callable[[float], float]


@dataclass(frozen=True)
class Lack:
    """The hidden part of a law, as drawn.

    Attributes
    ----------
    change : Change
    curve : callable or None
        Of the signal as it is remembered, SI, in the unit of the law or, where it is multiplied, of
        unit 1; None where no single curve says it.
    """

    change: Change
    curve: Curve | None = None


def over(place: str, curve: Curve, finest: float = float("inf")) -> Lack:
    """Return a curve of a signal as it is."""
    return Lack(Change(place, lambda x, s: curve(x), finest=finest), curve)


def over_count(place: str, curve: Curve, memory: str) -> Lack:
    """Return a curve of time, or of the integral of a signal or of its modulus from the start."""
    rates: dict[str, Callable[[float], float]] = {
        "time": lambda x: 1.0,
        "integrated": lambda x: x,
        "throughput": lambda x: abs(x),
    }
    rate = rates[memory]
    return Lack(Change(place, lambda x, s: curve(s[0]), lambda x, s: [rate(x)], (0.0,)), curve)


def after_lag(place: str, curve: Curve, times: tuple[float, ...], squared: bool = False) -> Lack:
    """Return a curve of the mean of several lags of a signal, or of its square as heat is."""
    count = len(times)

    def rates(x: float, s: object) -> list[float]:
        now = x * x if squared else x
        return [(now - one) / time for one, time in zip(s, times, strict=True)]  # type: ignore[call-overload]

    change = Change(
        place, lambda x, s: curve(sum(s) / count), rates, (0.0,) * count, min(times) / 3.0
    )
    return Lack(change)
