"""Judging of answers about laws: pure functions of the answers and of the truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fmus.kit.arrays import Array
from studies.hidden_laws import Answer, Kind, counted, is_right, proportional
from studies.judging.study import Row
from studies.plants import Plant

if TYPE_CHECKING:
    from orchestration.discrepancy.laws import Correction, Entry

LEAST = 4.0  # noise widths that must be left of what is hidden
GROUP = 3  # members of a group of which it is of use to be told
SAID = ("first", "in the group", "large group", "further down", "another", "none", "refused")
GOOD = SAID[:2]
NEAR_TRUTH = 1.02  # of the error of the truth on what was held out
_POINTS = 41  # at which a band is held against the truth
_ENDS = (0.01, 0.99)  # quantiles of the signal, between which it is
_STILL = 1e-9  # of its size, within which a signal stands still
_FEWEST = 4  # points, below which a line goes through all of them


def answer(entry: Entry) -> Answer:
    """Return what an entry of a map answers."""
    return Answer(entry.law, entry.kind, entry.signal.name, entry.signal.memory)


def excluded(row: Row) -> bool:
    """Return whether what is hidden leaves too little, or depends on what stands still."""
    return bool(row["widths"] < LEAST or row.get("still"))


def stands_still(signal: Array | None) -> bool:
    """Return whether a term of a signal is constant in a record; None stands for the time."""
    return signal is not None and float(np.ptp(signal)) <= _STILL * float(np.abs(signal).max())


def named(row: Row) -> str:
    """Return how the hidden term was answered, one of `SAID`."""
    if row.get("refused"):
        return "refused"
    if not row["said"]:
        return "none"
    if row["said"][0]["right"]:
        return "first"
    if any(one["right"] for one in row["alike"]):
        return "in the group" if 1 + len(row["alike"]) <= GROUP else "large group"
    return "further down" if any(one["right"] for one in row["said"]) else "another"


def confirmed(row: Row) -> bool:
    """Return whether unseen data confirmed the first answer."""
    return bool(row.get("said") and row["said"][0]["confirmed"])


def wrongly_confirmed(row: Row) -> bool:
    """Return whether unseen data confirmed a wrong answer, with no right one beside it."""
    return confirmed(row) and named(row) in ("further down", "another")


def as_good(row: Row) -> bool:
    """Return whether a wrong answer predicts unseen data as well as the truth."""
    return (
        bool(row.get("said")) and named(row) not in GOOD and row.get("ratio", np.inf) <= NEAR_TRUTH
    )


def rank(
    entries: Sequence[Answer], right: Iterable[Answer], series: Mapping[str, Array], step: float
) -> int | None:
    """Return the place of the first right answer among several, from 1; None if none is right."""
    known = frozenset(right)
    return next(
        (k for k, said in enumerate(entries, start=1) if is_right(said, known, series, step)), None
    )


def other_way(
    said: Answer, right: Iterable[Answer], series: Mapping[str, Array], step: float
) -> bool:
    """Return whether law and signal are right, but sum and product are confused."""
    known = frozenset(right)
    turned = replace(said, kind="add" if said.kind == "multiply" else "multiply")
    return is_right(turned, known, series, step) and not is_right(said, known, series, step)


def naive_is_right(name: str, right: Iterable[Answer], series: Mapping[str, Array]) -> bool:
    """Return whether some right answer is a curve of a signal as it is, whatever its law."""
    signals = {a.signal for a in right if not a.memory}
    mine = series.get(name)
    return name in signals or (
        mine is not None and any(proportional(mine, series.get(s)) for s in signals)
    )


def covered(
    band: Callable[[Array], tuple[Array, Array, Array]],
    truth: Callable[[float], float],
    visited: Array,
) -> float | None:
    """Return the share of the visited range in which a band holds the true curve.

    Straight parts do not count.

    Parameters
    ----------
    band : callable
        Curve, lower and upper end, (v,) each, at values (v,) of the signal, SI.
    truth : callable
        True curve, in the unit of the band.
    visited : ndarray, shape (n,)
        Values of the signal.

    Returns
    -------
    float or None
        None where the signal takes too few values to tell a curve from a line.
    """
    low, high = np.quantile(visited, _ENDS)
    several = np.unique(visited[(visited >= low) & (visited <= high)])
    at = several if len(several) <= _POINTS else np.linspace(low, high, _POINTS)
    if len(at) < _FEWEST:
        return None
    curve, least, most = band(at)
    true = np.array([truth(float(one)) for one in at])
    width = most - least
    line = np.polyfit(
        at, curve - true, 1, w=1.0 / np.maximum(width, 1e-9 * max(float(width.max()), 1e-300))
    )
    aligned = true + np.polyval(line, at)
    return float(np.mean((aligned >= least) & (aligned <= most)))


def true_curve(
    said: Answer,
    kind: Kind,
    curve: Callable[[float], float] | None,
    series: Mapping[str, Array],
    step: float,
    *,
    plant: Plant,
    truth: Mapping[str, float],
    fitted: Mapping[str, float],
) -> tuple[Callable[[float], float], Array] | None:
    """Return the curve that a right answer should have, and the visited range of its signal.

    It is a function of its signal in the unit of its law.

    A law to which something is added does so in its own unit and sign; of one that is multiplied
    the model's own parameter may be another, which scales it.

    Returns
    -------
    tuple of callable and ndarray, shape (n,), or None
        None where it is no curve of one signal, or is told in another way.
    """
    wanted = Answer(kind.place.law, kind.place.kind, kind.place.signal, kind.memory)
    mine = counted(said, series, step)
    its = counted(wanted, series, step)
    if curve is None or said.kind != wanted.kind or mine is None or its is None:
        return None
    slope, offset = np.polyfit(mine, its, 1) if not np.array_equal(mine, its) else (1.0, 0.0)
    if not np.array_equal(mine, its) and not proportional(mine, its):
        return None
    along: Callable[[float], float] = lambda x: curve(float(slope * x + offset))  # noqa: E731
    if said.kind == "add":
        factor = plant.equals(wanted.law, truth).get(said.law)
        return None if factor is None else ((lambda x: factor * along(x)), mine)
    name, power = kind.coefficient
    if said.law != wanted.law or name not in fitted:
        return None
    ratio = (truth[name] / fitted[name]) ** power
    return (lambda x: ratio * (1.0 + along(x)) - 1.0), mine


def band_covers(
    best: Correction,
    kind: Kind,
    curve: Callable[[float], float] | None,
    series: Mapping[str, Array],
    step: float,
    *,
    plant: Plant,
    truth: Mapping[str, float],
) -> float | None:
    """Return the share of the visited range in which a right answer's band holds the truth.

    None where none can be determined.
    """
    expected = true_curve(
        answer(best.entry),
        kind,
        curve,
        series,
        step,
        plant=plant,
        truth=truth,
        fitted=best.fitted.values,
    )
    if expected is None:
        return None
    return covered(best.band_at, *expected)


def closed_form(shapes: Sequence[str], kind: Kind, said: Answer, from_zero: bool) -> bool | None:
    """Return whether the closed form is among the first two reported; None where there is none.

    Parameters
    ----------
    shapes : sequence of str
        The nearest first.
    kind : Kind
    said : Answer
        Right.
    from_zero : bool
        Whether what is counted starts at zero with the record: otherwise the form is another.
    """
    if not kind.closed or said.kind != kind.place.kind or not from_zero:
        return None
    return bool(kind.closed & {*shapes[:2]})
