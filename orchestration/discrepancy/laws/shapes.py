"""Named shapes that engineers know, and their distance from a curve."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.kit.arrays import Array
from fmus.kit.curves import SHAPES
from orchestration.discrepancy.laws.evidence import Basis, Curve

_WIDTHS = np.geomspace(0.01, 3.0, 12)  # of a bend, in sizes of the signal
_ABRUPT = 0.05  # of the size of the signal, up to which a bend is a step
# one formula, whose name depends on its width
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
    """A shape where it comes nearest to a curve.

    Attributes
    ----------
    shape : str
    amount, width, beside : float
        Of the shape where it comes nearest, SI; the width is 0 where there is none, as is the
        constant beside it.
    distance : float
        Squared, in units of what is known of the curve.
    """

    shape: str
    amount: float
    width: float
    beside: float
    distance: float


def zero_of(basis: Basis) -> float:
    """Return the origin of a signal: zero or, if its range is far from zero, the range's middle.

    The middle is rounded to a tenth of the range's order of magnitude, so that it can be read.
    """
    low = float(basis.knots[0])
    high = float(basis.knots[-1])
    comes_near_zero = min(abs(low), abs(high)) <= _FAR * max(abs(low), abs(high))
    if comes_near_zero or low * high <= 0.0:
        return 0.0
    digits = 1 - math.floor(math.log10(high - low))
    return float(np.round(0.5 * (low + high), digits))


def shape_name(shape: str, width: float, size: float) -> str:
    """Return the name of a shape of some width: over a large signal a saturation is a step."""
    if shape not in _STEPS:
        return shape
    relative = width / size
    return next(name for name, fits in _STEPS.items() if fits(relative))


def likenesses(
    basis: Basis, curve: Curve, scale: float, names: Sequence[str] = (), zero: float = 0.0
) -> list[Likeness]:
    """Return shapes where each comes nearest to a curve, the nearest first.

    Parts of the curve that the model's own parameters can make do not count.

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
    whitening = _whitening(curve)
    if whitening is None:  # the model's own parameters can make all of the curve
        return []
    x = basis.knots - zero
    wanted = whitening @ curve.values
    constant = whitening @ np.ones(len(x))
    nearest = []
    for name in names or SHAPES:
        tried = []
        for width in _widths(name, float(np.abs(x).max())):
            column = whitening @ _values(name, width, scale, x)
            for columns in (column[:, None], np.column_stack([column, constant])):
                likeness = _likeness(name, width, columns, wanted)
                if likeness is not None:
                    tried.append(likeness)
        if tried:
            nearest.append(min(tried, key=_distance))
    return sorted(nearest, key=_distance)


def _distance(likeness: Likeness) -> float:
    return likeness.distance


def _values(name: str, width: float, scale: float, x: Array) -> Array:
    """Return the values (k,) of a shape at some places, (k,)."""
    form = SHAPES[name].form
    return np.array([float(form(float(place), width or 1.0, scale)) for place in x])


def _whitening(curve: Curve) -> Array | None:
    """Return the matrix that takes values of a curve to units of what is not known of it.

    None where all of the curve is what the model's own parameters can make.
    """
    strength, axes = np.linalg.eigh(curve.prior)
    seen = strength > max(_SEEN * strength.max(), 0.0)
    if not seen.any():
        return None
    into_unit_size = (axes[:, seen] / np.sqrt(strength[seen])).T
    spread, turned = np.linalg.eigh(into_unit_size @ curve.covariance @ into_unit_size.T)
    # of a curve that is known exactly no part is known better than others
    least = _KNOWN * spread.max() or 1.0
    scaled = turned / np.sqrt(np.maximum(spread, least))
    return np.asarray(scaled.T @ into_unit_size)


def _widths(name: str, size: float) -> list[float]:
    """Return the widths of a shape that are tried over a signal of some size; 0 if it has none."""
    if not SHAPES[name].width:
        return [0.0]
    return [w * size for w in _WIDTHS if name not in _STEPS or _STEPS[name](w)]


def _likeness(name: str, width: float, columns: Array, wanted: Array) -> Likeness | None:
    """Fit a shape to a curve, and a constant beside it if there is a second column.

    The distance includes a penalty for a width and for a constant.
    """
    amounts, distance = _nearest(columns, wanted)
    if amounts is None:
        return None
    penalty = 2.0 * np.log(2.0) * bool(SHAPES[name].width) + _CONSTANT * (len(amounts) - 1)
    beside = float(amounts[1] / amounts[0]) if len(amounts) > 1 else 0.0
    return Likeness(name, float(amounts[0]), float(width), beside, distance + penalty)


def _nearest(columns: Array, wanted: Array) -> tuple[Array | None, float]:
    """Return amounts of columns (m, c) that come nearest, if there are any, and their distance."""
    if not np.isfinite(columns).all() or not columns.any(axis=0).all():
        return None, np.inf
    sizes = np.linalg.norm(columns, axis=0)
    amounts, _, rank, _ = np.linalg.lstsq(columns / sizes, wanted, rcond=_ONE)
    if rank < columns.shape[1] or not amounts[0]:
        return None, np.inf
    remaining = wanted - columns / sizes @ amounts
    return amounts / sizes, float(remaining @ remaining)
