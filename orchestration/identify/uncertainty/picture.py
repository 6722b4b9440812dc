"""Pictures of likelihood profiles, with the parabola and the interval of the ellipse."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fmus.kit.arrays import Array, Interval
from fmus.kit.units import Described, convert
from orchestration.identify.uncertainty.posterior import Posterior
from orchestration.identify.uncertainty.profile import LEVEL, Profile
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TOP = 2.2  # height of a picture, in levels of the interval
_BEYOND = 0.15  # margin to either side of the widest interval, relative to it
_WIDE = 30.0  # ratio of ends from which on an axis is logarithmic


@draw.register(Profile)
def draw_profile(profile: Profile) -> Figure:
    """Draw the profile and its interval, with parabola and interval of the linearised fit."""
    return draw_profiles([profile])


@draw.register(Posterior)
def draw_posterior(posterior: Posterior) -> Figure:
    """Draw the samples of every pair of parameters, and their histograms on the diagonal."""
    names = [*posterior.samples]
    shown = {name: _displayed(posterior.declared[name], x) for name, x in posterior.samples.items()}
    cells = [[f"{row}\n{column}" for column in names] for row in names]
    figure, axes = pictures.mosaic(cells, "posterior of the parameters, with 95 % intervals")
    for i, row in enumerate(names):
        for j, column in enumerate(names):
            axis = axes[f"{row}\n{column}"]
            if j > i:
                axis.set_axis_off()
                continue
            x = shown[column]
            if i == j:
                axis.hist(x, bins=40, color=pictures.FITTED, alpha=0.6)
                for end in np.quantile(x, (0.025, 0.975)):
                    axis.axvline(end, color="black", lw=0.8, ls=":")
                axis.set_yticks([])
            else:
                axis.plot(x, shown[row], ".", ms=2, color=pictures.FITTED)
            if i == len(names) - 1:
                axis.set_xlabel(_axis_title(column, posterior.declared[column]))
            if j == 0 and i > 0:
                axis.set_ylabel(_axis_title(row, posterior.declared[row]))
    return figure


def _axis_title(name: str, declared: Described) -> str:
    unit = declared.display or declared.unit
    return pictures.with_unit(name.replace("_", " "), unit)


def draw_profiles(profiles: Sequence[Profile]) -> Figure:
    """Draw the deviance over each parameter, with the 95 % level and the interval that it gives.

    The parabola and the interval of the linearised fit (of its confidence ellipse) are drawn for
    comparison.

    Parameters
    ----------
    profiles : sequence of Profile
        One panel each.
    """
    figure, axes = pictures.panels(len(profiles), "likelihood profiles", "", 2.9, shared=False)
    for profile, axis in zip(profiles, axes, strict=True):
        _draw_profile(profile, axis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _draw_profile(profile: Profile, axis: Axes) -> None:
    """Draw one profile."""
    shown = partial(_displayed, profile.declared)
    low, high = _axis_ends(profile)
    wide = profile.logarithmic and high > _WIDE * low
    even = np.geomspace(low, high, 400) if wide else np.linspace(low, high, 400)
    _draw_deviance(profile, axis, even)
    axis.axhline(LEVEL, color="black", lw=0.8, ls=":", label=f"95 % of chi-square, {LEVEL:.2f}")
    estimate = shown(profile.estimate)
    axis.plot(estimate, 0.0, "k^", ms=6, clip_on=False, label="estimate")
    for interval, name, colour, height in (
        (profile.ellipse, "ellipse", pictures.MODEL, 1.12 * LEVEL),
        (profile.interval, "profile", pictures.FITTED, 1.28 * LEVEL),
    ):
        bar = [shown(float(np.clip(end, low, high))) for end in interval]
        label = f"95 % interval of the {name}"
        axis.plot(bar, [height] * 2, color=colour, lw=3, solid_capstyle="butt", label=label)
        for end, x, marker in zip(interval, bar, "<>", strict=True):
            if not low <= end <= high:
                axis.plot(x, height, marker, color=colour, ms=7, clip_on=False)
    if wide:
        axis.set_xscale("log")
    axis.set_xlim(shown(low), shown(high))
    axis.set_ylim(0.0, _TOP * LEVEL)
    axis.set_ylabel("deviance above\nthe estimate's [1]")
    axis.set_xlabel(_axis_title(profile.name, profile.declared))


def _draw_deviance(profile: Profile, axis: Axes, even: Array) -> None:
    """Draw the deviance, and the parabola of the ellipse, at values (n,) of the parameter, SI."""
    shown = partial(_displayed, profile.declared)
    if np.isfinite(profile.standard_error) and profile.standard_error > 0.0:
        axis.plot(
            shown(even),
            profile.parabola(even),
            color=pictures.MODEL,
            ls="--",
            lw=1.2,
            label="parabola of the ellipse",
        )
    values = np.union1d(even, profile.values)
    deviance = _deviance_at(profile, values)
    axis.plot(
        shown(values),
        deviance,
        color=pictures.FITTED,
        lw=1.5,
        label="profile",
    )
    fitted = shown(profile.values)
    axis.plot(fitted, profile.deviance, ".", color=pictures.FITTED)


def _displayed(declared: Described, value: Any) -> Any:
    """Return a value of a parameter, SI, in its display unit."""
    return convert(value, declared.unit, declared.display or declared.unit)


def _deviance_at(profile: Profile, values: Array) -> Array:
    """Return the deviance (n,) at values (n,) of the parameter; NaN outside the range of the fits.

    The square root is interpolated, as it is nearly a straight line.
    """
    from scipy.interpolate import PchipInterpolator

    signed = np.sign(profile.values - profile.estimate) * np.sqrt(np.maximum(profile.deviance, 0.0))
    scale = np.log if profile.logarithmic else np.asarray
    curve = PchipInterpolator(scale(profile.values), signed, extrapolate=False)
    return curve(scale(values)) ** 2


def _axis_ends(profile: Profile) -> Interval:
    """Return ends of the axis that show both intervals; where they are open, the last fits."""
    inside = profile.values[profile.deviance <= LEVEL]
    low = min(_finite_ends(profile, 0, float(inside.min())))
    high = max(_finite_ends(profile, 1, float(inside.max())))
    if profile.logarithmic:
        factor = (high / low) ** _BEYOND
        return low / factor, high * factor
    margin = _BEYOND * (high - low) or abs(profile.estimate) or 1.0
    return low - margin, high + margin


def _finite_ends(profile: Profile, side: int, farthest: float) -> list[float]:
    """Return the ends of both intervals on a side that can be drawn, and the last fit there."""
    ends = [end for end in (profile.ellipse[side], profile.interval[side]) if np.isfinite(end)]
    return [farthest, *(end for end in ends if end > 0.0 or not profile.logarithmic)]
