"""Likelihood profiles: an interval for a parameter where the ellipse of a fit does not tell it.

The parameter is held at values around its estimate, the others are fitted anew, and where the deviance has risen to the
95 % quantile of chi-square with one degree of freedom the interval ends (Bates and Watts: Nonlinear Regression Analysis
and Its Applications, 1988, section 6.1; Raue et al., Bioinformatics 25, 2009). It may end on one side only, or not at
all. The noise is held as it was estimated, so that the profile of a linear model is the parabola of its ellipse.

A residual that is coloured, or whose level varies, makes a deviance rise faster than it should: it is then chi-square
times the ratio of the variance that allows for it, the ellipse's, to the one that the likelihood has by itself (Kent,
Biometrika 69, 1982). The deviance is divided by that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fmus.kit.units import Described, shown
from orchestration.identify.metrics import number
from orchestration.identify.uncertainty.tracing import Refit, Side, trace

Array = NDArray[np.float64]
LEVEL = float(chi2.ppf(0.95, 1))
_FIRST = 0.25  # of half the ellipse's interval, that the first step is long; or of a large step, if that is less
_SHORTEST = 1e-9  # first step, in searched coordinates
_FARTHEST = float(np.log(1e6))  # in a logarithm, beyond which an end is taken to be open
_SIZES = 1e3  # likewise, in sizes of a parameter that is not searched in its logarithm
_WIDTHS = 100.0  # or in halves of the ellipse's interval, if that is farther
_BETTER = 0.1  # fall of the deviance below that of the estimate that is told


@dataclass(frozen=True)
class Profile:
    """The deviance over one parameter, all others fitted.

    Attributes
    ----------
    name : str
    estimate : float
        SI, as are all values.
    values, deviance : ndarray, shape (n,)
        Ascending, and minus twice the logarithm of the likelihood above that of the estimate, over what coloured noise
        makes of it.
    interval : tuple of float
        95 %; the end of the parameter's range, or infinite, where it is open.
    open : tuple of bool
        Whether the deviance does not reach the level below, and above.
    ellipse : tuple of float
        The interval that the covariance of the fit gives.
    standard_error : float
        Of the logarithm, or of the value.
    logarithmic : bool
        Whether the parabola of the ellipse is one over the logarithm.
    declared : Described
        Unit in which it is read.
    fits : int
        Begun for it, those that failed among them.
    warnings : tuple of str
    """

    name: str
    estimate: float
    values: Array
    deviance: Array
    interval: tuple[float, float]
    open: tuple[bool, bool]
    ellipse: tuple[float, float]
    standard_error: float
    logarithmic: bool
    declared: Described
    fits: int
    warnings: tuple[str, ...]

    def parabola(self, values: Array) -> Array:
        """Deviance (n,) at values (n,), SI, were the model as linear as the ellipse takes it to be."""
        away = np.log(values / self.estimate) if self.logarithmic else values - self.estimate
        return np.asarray((away / self.standard_error) ** 2)

    def __str__(self) -> str:
        return (
            f"{self.name} = {shown(self.estimate, self.declared)}, 95 % by profile: {self.written}"
        )

    @property
    def written(self) -> str:
        """The interval as it is printed."""
        ends = zip(self.interval, self.open, strict=True)
        return " … ".join("open" if is_open else shown(end, self.declared) for end, is_open in ends)

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON; None for an end beyond all numbers."""
        return {
            "ci95": [number(end) for end in self.interval],
            "open": [*self.open],
            "ci95_of_ellipse": [number(end) for end in self.ellipse],
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
        How the other coordinates follow it from the estimate.
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


def profile(name: str, declared: Described, refit: Refit, q: Array, along: Coordinate) -> Profile:
    """Follow the deviance to both sides of an estimate.

    Parameters
    ----------
    name : str
    declared : Described
    refit : callable
        See `trace`; its deviance is over that at which the interval ends.
    q : ndarray, shape (p,)
        The estimate.
    along : Coordinate

    Returns
    -------
    Profile
        Its interval is the part about the estimate: there may be others, where the deviance has several minima.
    """
    i, half = along.index, float(np.sqrt(LEVEL)) * along.standard_error
    step = max(_FIRST * min(half, 1.0), _SHORTEST)
    wide = _WIDTHS * half if np.isfinite(half) else 0.0
    far = _FARTHEST if along.logarithmic else max(_SIZES, wide)
    ends = max(along.low, q[i] - far), min(along.high, q[i] + far)
    sides = [
        trace(refit, q, i, along.tangent, sign * step, end)
        for sign, end in zip((-1.0, 1.0), ends, strict=True)
    ]
    at = np.array([point[i] for side in sides for point in side.points])
    order, deviance = (
        np.unique(at, return_index=True)[1],
        np.concatenate([side.deviance for side in sides]),
    )
    values = np.array([along.value(x) for x in at])
    low, high = (s.crossing if s.crossing is None else along.value(s.crossing) for s in sides)
    value = along.value(q[i])
    size = 1.0 if along.logarithmic else along.value(q[i] + 1.0) - value
    return Profile(
        name,
        value,
        values[order],
        LEVEL * deviance[order],
        (declared.min if low is None else low, declared.max if high is None else high),
        (low is None, high is None),
        (along.value(q[i] - half), along.value(q[i] + half)),
        size * along.standard_error,
        along.logarithmic,
        declared,
        sum(side.fits for side in sides),
        tuple(_warnings(name, declared, sides, values, deviance, ends, at)),
    )


def _warnings(
    name: str,
    declared: Described,
    sides: list[Side],
    values: Array,
    deviance: Array,
    ends: tuple[float, float],
    at: Array,
) -> list[str]:
    """What is to be known of a profile."""
    found = []

    def at_point(x: float) -> str:
        return shown(float(values[np.flatnonzero(at == x)[0]]), declared)

    for word, side, farthest, end in zip(
        ("below", "above"), sides, (at.min(), at.max()), ends, strict=True
    ):
        to = at_point(farthest)
        if side.between is not None:
            inner, outer = map(at_point, side.between)
            found.append(
                f"the end {word} of {name} is interpolated between {inner} and {outer}: no fit could be made there"
            )
        elif side.crossing is None and side.failed:
            found.append(
                f"the profile of {name} ends {word} at {to}: the model cannot be simulated farther on"
            )
        elif side.crossing is None and farthest != end:
            found.append(f"the profile of {name} ends {word} at {to}, after {side.fits} fits")
        elif side.crossing is None:
            found.append(
                f"this record does not bound {name} {word}: its profile stays below the level as far as {to}"
            )
    if (least := float(LEVEL * deviance.min())) < -_BETTER:
        there = shown(float(values[int(np.argmin(deviance))]), declared)
        found.append(
            f"{name} = {there} is likelier than the estimate (deviance {least:.3g}): fit again from there, with "
            f"--set {name}=VALUE"
        )
    return found
