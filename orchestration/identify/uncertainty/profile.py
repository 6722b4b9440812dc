"""Likelihood profiles: intervals of parameters without linearising the model.

The parameter is held at values around its estimate, the others are fitted anew, and where the
deviance has risen to the 95 % quantile of chi-square with one degree of freedom the interval ends
(Bates and Watts: Nonlinear Regression Analysis and Its Applications, 1988, section 6.1; Raue et
al., Bioinformatics 25, 2009). It may end on one side only, or not at all. The noise is held as it
was estimated, so that the profile of a linear model is the parabola of its ellipse. The square root
of the deviance is followed, because it is a straight line for a linear model.

A residual that is coloured, or whose level varies, makes a deviance rise faster than it should: it
is then chi-square times the ratio of the variance that allows for it, the ellipse's, to the one
that the likelihood has by itself (Kent, Biometrika 69, 1982). The deviance is divided by that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import log, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtri

from fmus.kit import UserError
from fmus.kit.arrays import Array, Interval
from fmus.kit.units import Described, format_value
from orchestration.identify.metrics import finite_or_none
from orchestration.reporting import Displayable, one_line, option

if TYPE_CHECKING:
    import pandas
    from rich.console import RenderableType

# 95 % quantile of chi-squared with one degree of freedom; `scipy.stats` would be slow to load
LEVEL = float(chdtri(1, 1.0 - 0.95))
Refit = Callable[[Array], tuple[Array, float]]
# length of the first step, in halves of the ellipse's interval, or in units of the coordinate if
# that is less
_FIRST = 0.25
_SHORTEST = 1e-9  # first step, in searched coordinates
_FARTHEST = log(1e6)  # in a logarithm, beyond which an end is taken to be open
_SIZES = 1e3  # likewise, in sizes of a parameter that is not searched in its logarithm
_WIDTHS = 100.0  # or in halves of the ellipse's interval, if that is farther
_BETTER = 0.1  # fall of the deviance below that of the estimate that is worth a warning
_RISE = 0.25  # of the square root of the deviance from 0 to the level, that a step aims at
_LONGER = 2.0  # most that a step grows by from the one before
_SHORTER = 0.25  # most that a step shrinks by
_MOST = 40  # fits on a side, those that failed and those of a crossing among them
_PRECISE = 1e-4  # of the last step: precision of a crossing
_LEAST = 1e-2  # of the first step: a shorter one is not tried where the model fails


@dataclass(frozen=True)
class Profile(Displayable):
    """The deviance over one parameter, all others fitted.

    Attributes
    ----------
    name : str
    estimate : float
        SI, as are all values.
    values, deviance : ndarray, shape (n,)
        Ascending values, and the deviance above that of the estimate, divided by the factor of
        coloured noise.
    interval : tuple of float
        95 %; the end of the parameter's range, or infinite, where it is open.
    open : tuple of bool
        True where the deviance does not reach the level, below and above the estimate.
    ellipse : tuple of float
        The interval that the covariance of the fit gives.
    standard_error : float
        Of the logarithm, or of the value.
    logarithmic : bool
        True if the parabola of the ellipse is one over the logarithm.
    declared : Described
        Unit in which it is read.
    fits : int
        Number of fits begun, those that failed among them.
    warnings : tuple of str
    """

    name: str
    estimate: float
    values: Array
    deviance: Array
    interval: Interval
    open: tuple[bool, bool]
    ellipse: Interval
    standard_error: float
    logarithmic: bool
    declared: Described
    fits: int
    warnings: tuple[str, ...]

    def parabola(self, values: Array) -> Array:
        """Return the deviance (n,) of a linear model with the same ellipse at values (n,), SI."""
        away = np.log(values / self.estimate) if self.logarithmic else values - self.estimate
        return (away / self.standard_error) ** 2

    def overview(self) -> Iterator[RenderableType]:
        """Yield the estimate with its interval."""
        estimate = format_value(self.estimate, self.declared)
        yield f"{self.name} = {estimate}, 95 % by profile: {self.written}"

    def __repr__(self) -> str:
        return one_line(f"Profile {self}")

    def to_frame(self) -> pandas.DataFrame:
        """Return the deviance over the values of the parameter, SI.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas

        return pandas.DataFrame({self.name: self.values, "deviance": self.deviance})

    @property
    def written(self) -> str:
        """The interval as it is printed."""
        ends = zip(self.interval, self.open, strict=True)
        return " … ".join(
            "open" if is_open else format_value(end, self.declared) for end, is_open in ends
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, ready for JSON: None for an end that is infinite."""
        return {
            "ci95": [finite_or_none(end) for end in self.interval],
            "open": [*self.open],
            "ci95_of_ellipse": [finite_or_none(end) for end in self.ellipse],
            "unit": self.declared.unit,
            "values": self.values.tolist(),
            "deviance": self.deviance.tolist(),
            "level": LEVEL,
            "fits": self.fits,
            "warnings": [*self.warnings],
        }


@dataclass(frozen=True)
class Coordinate:
    """The coordinate in which a parameter is searched.

    Attributes
    ----------
    index : int
    value : callable
        SI, at a coordinate.
    low, high : float
        Ends of its range in this coordinate; may be infinite.
    logarithmic : bool
    tangent : ndarray, shape (p,)
        Slopes of the other coordinates by it, at the estimate.
    standard_error : float
        In this coordinate; infinite where the record does not determine it.
    """

    index: int
    value: Callable[[float], float]
    low: float
    high: float
    logarithmic: bool
    tangent: Array
    standard_error: float


@dataclass
class Side:
    """One side of a profile.

    Attributes
    ----------
    points : list of ndarray, shape (p,)
        Points of the fits, in the order in which they were made; the estimate is the first.
    deviance : list of float
        At these points, above that of the estimate, divided by the level of the interval.
    crossing : float or None
        Coordinate at which the deviance is one, the end of the interval; None if it stays below.
    failed : bool
        True if the model could not be simulated farther on.
    between : tuple of float or None
        Coordinates between which the crossing was interpolated, where a fit between them failed.
    fits : int
        Number of fits begun, those that failed among them.
    """

    points: list[Array]
    deviance: list[float]
    crossing: float | None = None
    failed: bool = False
    between: Interval | None = None
    fits: int = 0


def profile_likelihood(
    name: str, declared: Described, refit: Refit, q: Array, coordinate: Coordinate
) -> Profile:
    """Return the profile of a parameter's likelihood, followed to both sides of the estimate.

    Parameters
    ----------
    name : str
    declared : Described
    refit : callable
        See `trace`; its deviance is divided by the level at which the interval ends.
    q : ndarray, shape (p,)
        The estimate.
    coordinate : Coordinate

    Returns
    -------
    Profile
        Its interval is the part about the estimate: there may be others, where the deviance has
        several minima.
    """
    half = sqrt(LEVEL) * coordinate.standard_error
    centre = q[coordinate.index]
    step = max(_FIRST * min(half, 1.0), _SHORTEST)
    warnings: list[str] = []
    sides = []
    for word, away, end in zip(
        ("below", "above"), (-step, step), _search_ends(centre, half, coordinate), strict=True
    ):
        side = trace(refit, q, coordinate.index, coordinate.tangent, away, end)
        warnings += _end_warnings(word, name, declared, side, end, coordinate)
        sides.append(side)
    points = np.array([point[coordinate.index] for side in sides for point in side.points])
    deviance = np.concatenate([side.deviance for side in sides])
    values = np.array([coordinate.value(x) for x in points])
    order = np.unique(points, return_index=True)[1]
    below, above = (side.crossing for side in sides)
    estimate = coordinate.value(centre)
    size = 1.0 if coordinate.logarithmic else coordinate.value(centre + 1.0) - estimate
    return Profile(
        name=name,
        estimate=estimate,
        values=values[order],
        deviance=LEVEL * deviance[order],
        interval=(
            declared.min if below is None else coordinate.value(below),
            declared.max if above is None else coordinate.value(above),
        ),
        open=(below is None, above is None),
        ellipse=(coordinate.value(centre - half), coordinate.value(centre + half)),
        standard_error=size * coordinate.standard_error,
        logarithmic=coordinate.logarithmic,
        declared=declared,
        fits=sum(side.fits for side in sides),
        warnings=(*warnings, *_better_warnings(name, declared, values, deviance)),
    )


def _search_ends(centre: float, half: float, coordinate: Coordinate) -> Interval:
    """Return the coordinates beyond which a profile is not followed.

    Parameters
    ----------
    centre : float
        Coordinate of the estimate.
    half : float
        Half of the ellipse's interval.
    coordinate : Coordinate
    """
    widths = _WIDTHS * half if np.isfinite(half) else 0.0
    distance = _FARTHEST if coordinate.logarithmic else max(_SIZES, widths)
    return max(coordinate.low, centre - distance), min(coordinate.high, centre + distance)


def _end_warnings(
    word: str, name: str, declared: Described, side: Side, end: float, coordinate: Coordinate
) -> list[str]:
    """Return a warning if one end of the interval is open or inexact, else an empty list."""

    def shown(x: float) -> str:
        return format_value(float(coordinate.value(x)), declared)

    coordinates = [point[coordinate.index] for point in side.points]
    farthest = min(coordinates) if word == "below" else max(coordinates)
    if side.between is not None:
        inner, outer = map(shown, side.between)
        return [
            f"the end {word} of {name} is interpolated between {inner} and {outer}: no fit could be"
            " made there"
        ]
    if side.crossing is not None:
        return []
    if side.failed:
        return [
            f"the profile of {name} ends {word} at {shown(farthest)}: the model cannot be simulated"
            " farther on"
        ]
    if farthest != end:
        return [f"the profile of {name} ends {word} at {shown(farthest)}, after {side.fits} fits"]
    return [
        f"this record does not bound {name} {word}: its profile stays below the level as far as"
        f" {shown(farthest)}"
    ]


def _better_warnings(name: str, declared: Described, values: Array, deviance: Array) -> list[str]:
    """Return a warning if another value is clearly likelier than the estimate."""
    least = float(LEVEL * deviance.min())
    if least >= -_BETTER:
        return []
    there = format_value(float(values[int(np.argmin(deviance))]), declared)
    return [
        f"{name} = {there} is likelier than the estimate (deviance {least:.3g}): fit again from"
        f" there, with {option('settings', {name: 'VALUE'})}"
    ]


def trace(refit: Refit, q: Array, i: int, tangent: Array, step: float, end: float) -> Side:
    """Follow the deviance along one coordinate until it is above one, or to an end.

    Every fit begins on the line through the ends of the two fits before. Steps adapt to the rise of
    the deviance, and become shorter where the model fails.

    Parameters
    ----------
    refit : callable
        Fits all coordinates except i from a point (p,); returns the end (p,) and the deviance, as
        in `Side`. If the fit fails it raises a UserError, or the deviance is not finite.
    q : ndarray, shape (p,)
        The estimate.
    i : int
        The coordinate.
    tangent : ndarray, shape (p,)
        Slopes of the others by it, at the estimate; one for itself.
    step : float
        The first one; its sign is that of the side.
    end : float
        Coordinate that is not passed.

    Returns
    -------
    Side
    """
    side = Side([q], [0.0])
    shortest = _LEAST * abs(step)
    low = min(q[i], end)
    high = max(q[i], end)
    near = q
    slope = tangent
    while side.fits < _MOST:
        x = float(np.clip(near[i] + step, low, high))
        try:
            far = _refit_at(refit, side, near + (x - near[i]) * slope, i, x)
        except UserError:
            step *= _SHORTER
            if abs(step) < shortest:
                side.failed = True
                break
            continue
        if side.deviance[-1] >= 1.0:
            _find_crossing(refit, side, near, far, i)
        if side.crossing is not None or x == end:
            break
        rise = _square_root(side.deviance[-1]) - _square_root(side.deviance[-2])
        # the next step aims at `_RISE`; the lower limit of the divisor is that of the growth
        step *= float(np.clip(_RISE / max(rise, _RISE / _LONGER), _SHORTER, _LONGER))
        slope = (far - near) / (far[i] - near[i])
        near = far
    return side


def _refit_at(refit: Refit, side: Side, start: Array, i: int, x: float) -> Array:
    """Fit the others from `start` with coordinate i at x, and add the point to a side."""
    start[i] = x
    side.fits += 1
    point, deviance = refit(start)
    if not np.isfinite(deviance):
        raise UserError(f"the deviance is {deviance:g}")
    side.points.append(point)
    side.deviance.append(deviance)
    return point


def _find_crossing(refit: Refit, side: Side, near: Array, far: Array, i: int) -> None:
    """Find the coordinate between the last two points at which the deviance is one.

    Where a fit fails, or no more are to be made, the crossing is interpolated on a straight line
    between the nearest point below and the nearest above.
    """
    # by coordinate: square root of the deviance less one, which is nearly a straight line
    heights = {
        float(near[i]): _square_root(side.deviance[-2]) - 1.0,
        float(far[i]): _square_root(side.deviance[-1]) - 1.0,
    }

    def height(x: float) -> float:
        if x not in heights:
            if side.fits >= _MOST:
                raise UserError("no more fits are made")
            _refit_at(refit, side, near + (x - near[i]) / (far[i] - near[i]) * (far - near), i, x)
            heights[x] = _square_root(side.deviance[-1]) - 1.0
        return heights[x]

    precision = _PRECISE * abs(far[i] - near[i])
    try:
        side.crossing = float(brentq(height, near[i], far[i], xtol=precision))
    except UserError:
        # the root search brackets ever closer, so that the last point of either sign is the nearest
        inner = [x for x in heights if heights[x] < 0.0][-1]
        outer = [x for x in heights if not heights[x] < 0.0][-1]
        rise = heights[outer] - heights[inner]
        side.crossing = inner - heights[inner] * (outer - inner) / rise
        side.between = (inner, outer)


def _square_root(deviance: float) -> float:
    """Return the square root of a deviance, zero for one below zero."""
    return sqrt(max(deviance, 0.0))
