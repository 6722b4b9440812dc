"""A profile followed from an estimate until it crosses a level: steps, and the root in the last of them.

It is the square root of the deviance that is followed, because it is a straight line for a linear model (Bates and
Watts: Nonlinear Regression Analysis and Its Applications, 1988, section 6.1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from fmus.kit.errors import UserError

Array = NDArray[np.float64]
Refit = Callable[[Array], tuple[Array, float]]
_RISE = 0.25  # of the square root from 0 to the level, that a step is meant to bring
_LONGER, _SHORTER = 2.0, 0.25  # by which a step may differ from the one before
_MOST = 40  # fits on a side, those that failed and those of a crossing among them
_PRECISE = 1e-4  # of the last step, to which a crossing is found
_LEAST = 1e-2  # of the first step: a shorter one is not tried where the model fails


@dataclass
class Side:
    """One side of a profile.

    Attributes
    ----------
    points : list of ndarray, shape (p,)
        Where the others were fitted, in the order in which it was done; the estimate is the first.
    deviance : list of float
        There, above that of the estimate, over the level that is looked for.
    crossing : float or None
        Coordinate at which it is one; None if it was not reached.
    failed : bool
        Whether the model could not be simulated farther on.
    between : tuple of float or None
        Coordinates between which the crossing was interpolated, where a fit between them failed.
    fits : int
        That were begun, those that failed among them.
    """

    points: list[Array]
    deviance: list[float]
    crossing: float | None = None
    failed: bool = False
    between: tuple[float, float] | None = None
    fits: int = 0


def trace(refit: Refit, q: Array, i: int, tangent: Array, step: float, end: float) -> Side:
    """Follow the deviance along one coordinate until it is above one, or to an end.

    Every fit begins where the line through the two before it leads. Steps adapt to how fast the deviance rises, and
    become shorter where the model fails.

    Parameters
    ----------
    refit : callable
        Where a fit ends that begins at a point and holds coordinate i there, (p,), and the deviance, as in `Side`. A
        UserError, or a deviance that is not finite, says that there is none.
    q : ndarray, shape (p,)
        The estimate.
    i : int
        The coordinate.
    tangent : ndarray, shape (p,)
        How the others follow it from the estimate; one for itself.
    step : float
        The first one; its sign tells the side.
    end : float
        Coordinate that is not passed.

    Returns
    -------
    Side
    """
    side, least = Side([q], [0.0]), _LEAST * abs(step)
    near, low, high = q, min(q[i], end), max(q[i], end)
    while side.fits < _MOST:
        x = float(np.clip(near[i] + step, low, high))
        try:
            far = _fitted(refit, side, near + (x - near[i]) * tangent, i, x)
        except UserError:
            step *= _SHORTER
            if abs(step) < least:
                side.failed = True
                break
            continue
        if side.deviance[-1] >= 1.0:
            _cross(refit, side, near, far, i)
        if side.crossing is not None or x == end:
            break
        rise = _root(side.deviance[-1]) - _root(side.deviance[-2])
        step *= float(np.clip(_RISE / max(rise, _RISE / _LONGER), _SHORTER, _LONGER))
        near, tangent = far, (far - near) / (far[i] - near[i])
    return side


def _fitted(refit: Refit, side: Side, start: Array, i: int, x: float) -> Array:
    start[i] = x
    side.fits += 1
    point, deviance = refit(start)
    if not np.isfinite(deviance):
        raise UserError(f"the deviance is {deviance:g}")
    side.points.append(point)
    side.deviance.append(deviance)
    return point


def _cross(refit: Refit, side: Side, near: Array, far: Array, i: int) -> None:
    """Find the coordinate at which the deviance is one, between the last two points.

    Where no fit can be made that the search asks for, or no more are to be made, a straight line leads from the nearest
    point below to the nearest above.
    """
    known = {
        float(near[i]): _root(side.deviance[-2]) - 1.0,
        float(far[i]): _root(side.deviance[-1]) - 1.0,
    }

    def above(x: float) -> float:
        if x not in known:
            if side.fits >= _MOST:
                raise UserError("no more fits are made")
            _fitted(refit, side, near + (x - near[i]) / (far[i] - near[i]) * (far - near), i, x)
            known[x] = _root(side.deviance[-1]) - 1.0
        return known[x]

    try:
        side.crossing = float(brentq(above, near[i], far[i], xtol=_PRECISE * abs(far[i] - near[i])))
    except UserError:
        # what is tried lies between the nearest two, so that these are the last of either kind
        inner, outer = (
            [x for x in known if (known[x] < 0.0) == below][-1] for below in (True, False)
        )
        side.crossing = inner - known[inner] * (outer - inner) / (known[outer] - known[inner])
        side.between = inner, outer


def _root(deviance: float) -> float:
    return float(np.sqrt(max(deviance, 0.0)))
