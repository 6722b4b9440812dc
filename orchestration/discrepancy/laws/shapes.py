"""What a curve looks like: shapes that engineers know by a name, held against it."""

from __future__ import annotations

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
_STEPS: dict[str, Callable[[float], bool]] = {"sign": lambda w: w <= _ABRUPT, "saturating": lambda w: w > _ABRUPT}
_SEEN = 1e-10  # of the largest, below which the curve was expected to have nothing
_KNOWN = 1e-12  # of the largest variance, below which none is but for rounding


@dataclass(frozen=True)
class Likeness:
    """How near a shape comes to a curve.

    Attributes
    ----------
    shape : str
    amount, width : float
        Of the shape where it comes nearest, SI; the width is 0 where there is none.
    distance : float
        Squared, in units of what is known of the curve.
    """

    shape: str
    amount: float
    width: float
    distance: float


def called(shape: str, width: float, basis: Basis) -> str:
    """Name of a shape of some width: a saturation that is abrupt is a step."""
    if shape not in _STEPS:
        return shape
    relative = width / float(np.abs(basis.knots).max())
    return next(name for name, fits in _STEPS.items() if fits(relative))


def likenesses(basis: Basis, curve: Curve, scale: float, names: Sequence[str] = ()) -> list[Likeness]:
    """Shapes, the nearest first: where each comes nearest to a curve, its own parts of the model left out.

    Parameters
    ----------
    basis : Basis
    curve : Curve
    scale : float
        Nominal value of the signal.
    names : sequence of str
        All of `SHAPES` unless given.
    """
    size = float(np.abs(basis.knots).max())
    strength, axes = np.linalg.eigh(curve.prior)
    seen = strength > max(_SEEN * strength.max(), 0.0)
    if not seen.any():  # all of it is the model's own
        return []
    into = (axes[:, seen] / np.sqrt(strength[seen])).T  # from values to coordinates of unit size
    spread, turned = np.linalg.eigh(into @ curve.covariance @ into.T)
    into = (turned / np.sqrt(np.maximum(spread, _KNOWN * spread.max()))).T @ into  # in units of what is not known
    wanted = into @ curve.values
    found = []
    for name in names or SHAPES:
        shape = SHAPES[name]
        widths = [w * size for w in _WIDTHS if name not in _STEPS or _STEPS[name](w)] if shape.width else [0.0]
        best: Likeness | None = None
        for width in widths:
            values = np.array([float(shape.form(float(x), width or 1.0, scale)) for x in basis.knots])
            column = into @ values
            power = float(column @ column)
            if not power > 0.0 or not np.isfinite(power):
                continue
            amount = float(column @ wanted) / power
            left = wanted - amount * column
            one = Likeness(name, amount, float(width), float(left @ left) + 2.0 * np.log(2.0) * bool(shape.width))
            best = one if best is None or one.distance < best.distance else best
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda one: one.distance)
