"""A picture of likelihood profiles: what the record says of a parameter, beside what an ellipse makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from fmus.kit.units import convert
from orchestration.identify.uncertainty.profile import LEVEL, Profile
from orchestration.reporting import pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
_TOP = 2.2  # levels that a picture is high
_BEYOND = 0.15  # of what is shown to either side, beyond the widest interval
_WIDE = 30.0  # ratio of ends from which on an axis is logarithmic


def draw(profiles: Sequence[Profile], path: Path | None = None) -> Figure:
    """Draw the deviance over each parameter, with the parabola of its ellipse, the 95 % level and both intervals.

    Parameters
    ----------
    profiles : sequence of Profile
    path : Path, optional
        Picture to write.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    figure, axes = pictures.panels(len(profiles), "likelihood profiles", "", 2.9, shared=False)
    for profile, axis in zip(profiles, axes, strict=True):
        _draw(profile, axis)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    if path is not None:
        pictures.save(figure, path)
    return figure


def _draw(profile: Profile, axis: Axes) -> None:
    unit, shown = profile.declared.unit, profile.declared.display or profile.declared.unit
    low, high = _ends(profile)
    wide = profile.logarithmic and high > _WIDE * low
    values = np.geomspace(low, high, 400) if wide else np.linspace(low, high, 400)

    def in_unit(x: Any) -> Any:
        return convert(x, unit, shown)

    if np.isfinite(profile.standard_error) and profile.standard_error > 0.0:
        axis.plot(
            in_unit(values),
            profile.parabola(values),
            color=pictures.MODEL,
            ls="--",
            lw=1.2,
            label="parabola of the ellipse",
        )
    values = np.union1d(values, profile.values)
    axis.plot(
        in_unit(values), _between(profile, values), color=pictures.FITTED, lw=1.5, label="profile"
    )
    axis.plot(in_unit(profile.values), profile.deviance, ".", color=pictures.FITTED)
    axis.axhline(LEVEL, color="black", lw=0.8, ls=":", label=f"95 % of chi-square, {LEVEL:.2f}")
    axis.plot(in_unit(profile.estimate), 0.0, "k^", ms=6, clip_on=False, label="estimate")
    for interval, name, colour, height in (
        (profile.ellipse, "ellipse", pictures.MODEL, 1.12),
        (profile.interval, "profile", pictures.FITTED, 1.28),
    ):
        bar = [in_unit(float(np.clip(end, low, high))) for end in interval]
        of = f"95 % interval of the {name}"
        axis.plot(bar, [height * LEVEL] * 2, color=colour, lw=3, solid_capstyle="butt", label=of)
        for end, marker in ((interval[0], "<"), (interval[1], ">")):
            if not low <= end <= high:
                axis.plot(
                    in_unit(np.clip(end, low, high)),
                    height * LEVEL,
                    marker,
                    color=colour,
                    ms=7,
                    clip_on=False,
                )
    if wide:
        axis.set_xscale("log")
    axis.set_xlim(in_unit(low), in_unit(high))
    axis.set_ylim(0.0, _TOP * LEVEL)
    axis.set_ylabel("deviance above\nthe estimate's [1]")
    axis.set_xlabel(f"{profile.name.replace('_', ' ')}" + ("" if shown == "1" else f" [{shown}]"))


def _between(profile: Profile, values: Array) -> Array:
    """Deviance (n,) at values (n,) by interpolation of its square root, NaN beyond what was followed."""
    known, wanted = (np.log(v) if profile.logarithmic else v for v in (profile.values, values))
    signed = np.sign(profile.values - profile.estimate) * np.sqrt(np.maximum(profile.deviance, 0.0))
    return np.asarray(PchipInterpolator(known, signed, extrapolate=False)(wanted) ** 2)


def _ends(profile: Profile) -> tuple[float, float]:
    """Values between which a profile is shown: both intervals, and where one is open, as far as it was followed."""
    told = profile.values[profile.deviance <= LEVEL]
    sides = []
    for k, farthest in enumerate((told.min(), told.max())):
        ends = [end for end in (profile.ellipse[k], profile.interval[k]) if np.isfinite(end)]
        inner = [end for end in ends if end > 0.0 or not profile.logarithmic]
        sides.append((min, max)[k]([float(farthest), *inner]))
    low, high = sides
    if profile.logarithmic:
        more = (high / low) ** _BEYOND
        return low / more, high * more
    more = _BEYOND * (high - low) or abs(profile.estimate) or 1.0
    return low - more, high + more
