"""Signals that a term may be a function of: those of a model along a course, and their memories."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg.lapack import dtbtrs

from fmus.kit.arrays import Array, Indices
from orchestration.diagnosis.runs import step_of
from orchestration.diagnosis.terms import Memory

_ALIKE = 0.9995  # correlation from which on two signals are one
_NO_MEMORY = 0.999  # correlation from which on a memory is another signal
_FADES = 0.99  # the same for what has faded, of which more signals are nearly a rate
_TIMES = 8  # time constants that are tried, in equal ratios
_WAYS = (0.2, 0.6)  # of play and of a Dahl element, in standard deviations of the signal


@dataclass(frozen=True, eq=False)
class Seen:
    """A signal as a term sees it.

    Attributes
    ----------
    signal : str
    memory : Memory
    constants : tuple of float
        Of the memory: seconds, or a way in scales of the signal.
    values : ndarray, shape (n,)
        Over all records, one after the other.
    scale, middle : float
        Root mean square about the middle, which is zero where the signal comes near zero.
    """

    signal: str
    memory: Memory
    constants: tuple[float, ...]
    values: Array
    scale: float
    middle: float

    @cached_property
    def scaled(self) -> Array:
        """The values, in scales."""
        return (self.values - self.middle) / self.scale

    @property
    def one_sided(self) -> bool:
        """True if it is never clearly negative, so that odd and even shapes are the same."""
        return bool(self.scaled.min() > -0.05)


def scale_of_signal(values: Array) -> tuple[float, float]:
    """Return scale and middle of a signal."""
    largest = np.abs(values).max()
    near_zero = values.min() <= 0.05 * largest and values.max() >= -0.05 * largest
    middle = 0.0 if near_zero or abs(values.mean()) < 2.0 * values.std() else values.mean()
    return float(np.sqrt(np.mean((values - middle) ** 2))), float(middle)


def distinct(signals: Sequence[tuple[str, Array]]) -> list[tuple[str, Array]]:
    """Leave out signals that stand still, and those that are one with an earlier one."""
    return [same[0] for same in alike_signals(signals)]


def alike_signals(signals: Sequence[tuple[str, Array]]) -> list[list[tuple[str, Array]]]:
    """Join signals that are one with an earlier one, and leave out those that stand still.

    Parameters
    ----------
    signals : sequence of (str, ndarray)
        By name, the plainest first.
    """
    classes: list[list[tuple[str, Array]]] = []
    for name, values in signals:
        if np.std(values) < 1e-9 * (np.abs(values).max() + 1e-300):
            continue
        for same in classes:
            if abs(np.corrcoef(values, same[0][1])[0, 1]) > _ALIKE:
                same.append((name, values))
                break
        else:
            classes.append([(name, values)])
    return classes


def seen(
    signals: Sequence[tuple[str, Array]],
    times: Sequence[Array],
    kinds: Sequence[Memory],
    shares: Sequence[float] = (),
) -> list[Seen]:
    """Return signals by themselves and through memories, without those that repeat another.

    Parameters
    ----------
    signals : sequence of (str, ndarray)
        Distinct ones, over all records one after the other.
    times : sequence of ndarray
        Of each record, s.
    kinds : sequence of Memory
        That are tried.
    shares : sequence of float
        Ways of backlash that are tried, in standard deviations of the signal.
    """
    most = max(_TIMES, len(shares))
    known = _Known(len(signals) * (1 + len(kinds) * most), sum(len(time) for time in times))
    result = []
    for name, values in signals:
        known.takes(values, np.inf)
        result.append(_seen(name, Memory.NONE, (), values))
    for kind in kinds:
        limit = _NO_MEMORY if kind is not Memory.FADING else _FADES
        for name, values in signals:
            if name == "time":
                continue
            kept = values**2 if kind is Memory.HEAT else values
            for constant in _constants(kind, times, shares):
                remembered = _remembered(kind, values, times, constant)
                usual = constant if kind is Memory.BACKLASH else 1.0
                if remembered.std() < 1e-3 * usual * kept.std():
                    continue
                if not known.takes(remembered, limit):
                    continue
                own = (constant,)[: kind.constants]
                result.append(_seen(name, kind, own, remembered, values))
    return result


class _Known:
    """Standardised signals (n,), at most so many, of which none repeats another."""

    def __init__(self, most: int, samples: int) -> None:
        self._rows = np.empty((most, samples))
        self._count = 0

    def takes(self, values: Array, limit: float) -> bool:
        """Keep a signal that correlates with none by more than a limit; return whether it did."""
        z = (values - values.mean()) / (values.std() + 1e-300)
        if np.abs(self._rows[: self._count] @ z).max(initial=0.0) > limit * len(z):
            return False
        self._rows[self._count] = z
        self._count += 1
        return True


def _constants(kind: Memory, times: Sequence[Array], shares: Sequence[float]) -> list[float]:
    """Return the constants of a memory that are tried: s, or standard deviations of a signal."""
    if kind in (Memory.PLAY, Memory.DAHL):
        return list(_WAYS)
    if kind is Memory.BACKLASH:
        return list(shares)
    length = max(float(t[-1] - t[0]) for t in times)
    if kind.counts:
        return [length]
    step = min(step_of(t) for t in times)
    return np.geomspace(max(3.0 * step, length / 1000.0), length / 4.0, _TIMES).tolist()


def remembered_by(
    kind: Memory, values: Array, times: Sequence[Array], constants: Array
) -> Array | None:
    """Return what a memory with its time constants (s) keeps of a signal (n,).

    None of a memory that is no linear one of the signal, its square or its modulus.
    """
    if kind not in _OF_RECORDS:
        return None
    return _remembered(kind, values, times, float(constants[0]) if kind.constants else 0.0)


def are_alike(remembered: Array, values: Array) -> bool:
    """Return whether what a fitted memory keeps is a signal, up to a factor."""
    return abs(float(np.corrcoef(remembered, values)[0, 1])) > _FADES


def _seen(
    name: str, kind: Memory, constants: tuple[float, ...], values: Array, base: Array | None = None
) -> Seen:
    if kind is Memory.DAHL:
        scale, middle = 1.0, 0.0
    else:
        scale, middle = scale_of_signal(values)
    if kind.is_sampled:  # ways are in scales of the term
        assert base is not None
        constants = (constants[0] * float(base.std()) / scale,)
    return Seen(name, kind, constants, values, scale, middle)


def _remembered(kind: Memory, values: Array, times: Sequence[Array], constant: float) -> Array:
    """Return a memory of a signal, which begins in equilibrium in every record."""
    begins = np.cumsum([0, *(len(t) for t in times)])
    if kind in _OF_RECORDS:
        return _OF_RECORDS[kind](values, np.concatenate(times), constant, begins[:-1])
    parts = [values[first:last] for first, last in pairwise(begins)]
    return np.concatenate([_OF_RECORD[kind](part, constant) for part in parts])


def lagged(
    values: Array, time: Array, constant: float, begins: Sequence[int] | Indices = (0,)
) -> Array:
    """Return a signal, linear between samples, behind a first-order lag of a time constant (s).

    It begins in equilibrium at each of some samples, with which records begin.
    """
    first = np.asarray(begins)
    steps = np.diff(time) / constant
    steps[first[1:] - 1] = np.inf  # nothing of a record is left in the next
    decay = np.exp(-steps)
    mean = -np.expm1(-steps) / steps
    driven = np.append(values[0], (1.0 - mean) * values[1:] + (mean - decay) * values[:-1])
    # each value less the decayed one before it is driven by the signal: a matrix of two diagonals
    diagonals = np.vstack([np.ones(len(time)), np.append(-decay, 0.0)])
    result, _ = dtbtrs(diagonals, driven[:, np.newaxis], uplo="L", diag="U")
    return np.asarray(result[:, 0])


def _faded(values: Array, time: Array, constant: float, begins: Indices) -> Array:
    return values - lagged(values, time, constant, begins)


def _play(values: Array, share: float) -> Array:
    way = share * values.std()
    followed = values.copy()
    z = values[0]
    for k, v in enumerate(values.tolist()):
        z = min(max(z, v - way), v + way)
        followed[k] = z
    return followed


def _backlash(values: Array, share: float) -> Array:
    return values - _play(values, share)


def _dahl(values: Array, share: float) -> Array:
    way = share * values.std() + 1e-300
    moves = np.diff(values, prepend=values[0])
    decays = np.exp(-np.abs(moves) / way)
    bristle = np.zeros_like(values)
    z = 0.0
    for k, (decay, side) in enumerate(zip(decays.tolist(), np.sign(moves).tolist(), strict=True)):
        z = decay * z + side * way * (1.0 - decay)
        bristle[k] = z
    return bristle


def _heat(values: Array, time: Array, constant: float, begins: Indices) -> Array:
    first = np.repeat(begins, np.diff(begins, append=len(time)))
    rest = values[first] ** 2 * np.exp(-(time - time[first]) / constant)
    return lagged(values**2, time, constant, begins) - rest


def _integral(values: Array, time: Array, constant: float, begins: Indices) -> Array:
    first = np.repeat(begins, np.diff(begins, append=len(time)))
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
    total = np.append(0.0, np.cumsum(steps))
    return np.asarray(total - total[first])


def _throughput(values: Array, time: Array, constant: float, begins: Indices) -> Array:
    return _integral(np.abs(values), time, constant, begins)


_OF_RECORDS: dict[Memory, Callable[[Array, Array, float, Indices], Array]] = {
    Memory.LAG: lagged,
    Memory.FADING: _faded,
    Memory.HEAT: _heat,
    Memory.INTEGRAL: _integral,
    Memory.THROUGHPUT: _throughput,
}
_OF_RECORD: dict[Memory, Callable[[Array, float], Array]] = {
    Memory.PLAY: _play,
    Memory.DAHL: _dahl,
    Memory.BACKLASH: _backlash,
}
