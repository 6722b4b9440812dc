"""What a curve looks like: shapes that engineers know by a name, held against it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fmus.kit.curves import SHAPES
from orchestration.discrepancy.laws.evidence import Basis, Curve

Array = NDArray[np.float64]
_WIDTHS = np.geomspace(0.01, 3.0, 12)  # of a bend, in sizes of the signal
_ABRUPT = 0.05  # of the size of the signal, up to which a bend is a step
# one formula, which is called after its width
_STEPS: dict[str, Callable[[float], bool]] = {
    "sign": lambda w: w <= _ABRUPT,
    "saturating": lambda w: w > _ABRUPT,
}
_SEEN = 1e-10  # of the largest, below which the curve was expected to have nothing
_FAR = 0.8  # of its farthest, from which on a signal never comes near nothing
_CONSTANT = 10.0  # of the distance, by which a constant beside a shape must bring it nearer
_ONE = 1e-6  # relative singular value, below which two columns are one
_KNOWN = 1e-12  # of the largest variance, below which none is but for rounding


@dataclass(frozen=True)
class Likeness:
    """How near a shape comes to a curve.

    Attributes
    ----------
    shape : str
    amount, width, beside : float
        Of the shape where it comes nearest, SI; the width is 0 where there is none, as is the constant beside it.
    distance : float
        Squared, in units of what is known of the curve.
    """

    shape: str
    amount: float
    width: float
    beside: float
    distance: float


def zero_of(basis: Basis) -> float:
    """From where a signal is counted: where it never comes near nothing, about the middle of where it has been."""
    low, high = float(basis.knots[0]), float(basis.knots[-1])
    if min(abs(low), abs(high)) <= _FAR * max(abs(low), abs(high)) or low * high <= 0.0:
        return 0.0
    return float(np.round(0.5 * (low + high), 1 - math.floor(math.log10(high - low))))


def called(shape: str, width: float, size: float) -> str:
    """Name of a shape of some width, over a signal of some size: a saturation that is abrupt is a step."""
    if shape not in _STEPS:
        return shape
    relative = width / size
    return next(name for name, fits in _STEPS.items() if fits(relative))


def likenesses(
    basis: Basis, curve: Curve, scale: float, names: Sequence[str] = (), zero: float = 0.0
) -> list[Likeness]:
    """Shapes, the nearest first: where each comes nearest to a curve, its own parts of the model left out.

    Parameters
    ----------
    basis : Basis
    curve : Curve
    scale : float
        Nominal value of the signal.
    names : sequence of str
        All of `SHAPES` unless given.
    zero : float
        From where the signal is counted.
    """
    x = basis.knots - zero
    size = float(np.abs(x).max())
    strength, axes = np.linalg.eigh(curve.prior)
    seen = strength > max(_SEEN * strength.max(), 0.0)
    if not seen.any():  # all of it is the model's own
        return []
    into = (axes[:, seen] / np.sqrt(strength[seen])).T  # from values to coordinates of unit size
    spread, turned = np.linalg.eigh(into @ curve.covariance @ into.T)
    into = (
        turned / np.sqrt(np.maximum(spread, _KNOWN * spread.max()))
    ).T @ into  # in units of what is not known
    wanted = into @ curve.values
    constant = into @ np.ones(len(x))
    found = []
    for name in names or SHAPES:
        shape = SHAPES[name]
        widths = (
            [w * size for w in _WIDTHS if name not in _STEPS or _STEPS[name](w)]
            if shape.width
            else [0.0]
        )
        tried = []
        for width in widths:
            column = into @ np.array(
                [float(shape.form(float(one), width or 1.0, scale)) for one in x]
            )
            for columns in (column[:, None], np.column_stack([column, constant])):
                amounts, left = _nearest(columns, wanted)
                if amounts is not None:
                    price = 2.0 * np.log(2.0) * bool(shape.width) + _CONSTANT * (len(amounts) - 1)
                    beside = float(amounts[1] / amounts[0]) if len(amounts) > 1 else 0.0
                    tried.append(
                        Likeness(name, float(amounts[0]), float(width), beside, left + price)
                    )
        if tried:
            found.append(min(tried, key=lambda one: one.distance))
    return sorted(found, key=lambda one: one.distance)


def _nearest(columns: Array, wanted: Array) -> tuple[Array | None, float]:
    """Amounts of columns (m, c) that come nearest, and how far these are; None where they are one or no numbers."""
    if not np.isfinite(columns).all() or not columns.any(axis=0).all():
        return None, np.inf
    sizes = np.linalg.norm(columns, axis=0)
    amounts, _, rank, _ = np.linalg.lstsq(columns / sizes, wanted, rcond=_ONE)
    if rank < columns.shape[1] or not amounts[0]:
        return None, np.inf
    left = wanted - columns / sizes @ amounts
    return amounts / sizes, float(left @ left)
