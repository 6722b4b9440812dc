"""Pictures of comparisons and fits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from fmus.kit import units
from fmus.kit.units import Described, unit_of_differences
from orchestration.identify.comparison import Comparison, JointComparison
from orchestration.identify.grey_box import Fit
from orchestration.identify.presentation import runs
from orchestration.identify.uncertainty import Estimate
from orchestration.reporting import draw, pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MUCH_LARGER = 25.0  # ratio of residuals from which on the larger one is not drawn


@draw.register(Comparison)
def draw_comparison(comparison: Comparison) -> Figure:
    """Draw, for every measured output, record and simulation above the residual."""
    title = f"{comparison.record.source.name} against {comparison.model.name}"
    figure, axes = pictures.panels(2 * len(comparison.before), title)
    for k, output in enumerate(comparison.before):
        _draw_output(comparison, output, axes[2 * k], axes[2 * k + 1])
    pictures.logarithmic(axes, comparison.record.time)
    return figure


@draw.register(JointComparison)
def draw_joint(joint: JointComparison) -> Figure:
    """Draw every output of every record above its residual."""
    shown = [(one, output) for one in joint.comparisons.values() for output in one.before]
    figure, axes = pictures.panels(2 * len(shown), "fitted together", shared=False)
    for k, (comparison, output) in enumerate(shown):
        _draw_output(comparison, output, axes[2 * k], axes[2 * k + 1])
        axes[2 * k].set_title(comparison.record.source.name, loc="left", fontsize="small")
    return figure


@draw.register(Fit)
def draw_fit(fit: Fit) -> Figure:
    """Draw every parameter with its 95 % interval, and where it started from."""
    title = "fitted parameters with 95 % intervals"
    figure, axes = pictures.panels(len(fit.estimates), title, "", 0.75, shared=False)
    for axis, (name, estimate) in zip(axes, fit.estimates.items(), strict=True):
        _draw_estimate(axis, name, estimate, fit.declared[name])
    pictures.legend_above(axes[0], 3)
    return figure


def _draw_estimate(axis: Axes, name: str, estimate: Estimate, declared: Described) -> None:
    """Draw one parameter; an interval with an open end goes to the edge of the picture."""
    unit = declared.display or declared.unit
    value, nominal, *ends = (
        units.convert(x, declared.unit, unit)
        for x in (estimate.value, estimate.nominal, *estimate.interval)
    )
    axis.plot(nominal, 0.0, "o", mfc="none", color=pictures.MEASURED, label="started from")
    axis.plot(value, 0.0, "o", color=pictures.FITTED, label="fitted")
    axis.margins(0.1, 0.5)
    edges = axis.get_xlim()
    shown = [x if math.isfinite(x) else edge for x, edge in zip(ends, edges, strict=True)]
    axis.plot(shown, [0.0, 0.0], color=pictures.FITTED, lw=2, label="95 % interval", zorder=1)
    pictures.name_ticks(axis.yaxis, [0.0], [name.replace("_", " ")])
    axis.set_xlabel(pictures.with_unit("", unit, ""))


def _draw_output(comparison: Comparison, output: str, over: Axes, below: Axes) -> None:
    """Draw one output above its residual."""
    time = comparison.record.time
    signal = comparison.model.outputs[output]
    unit = comparison.record.display_unit(output, signal)
    difference = unit_of_differences(signal)
    before = comparison.before[output]
    after = comparison.latest[output]
    measured = units.convert(before.measured, signal.unit, unit)
    over.plot(time, measured, color=pictures.MEASURED, lw=2.5, label="measured")
    # the residual of the fit would not be visible with a much larger one before it
    hidden = before.rms > _MUCH_LARGER * after.rms
    colours = (pictures.MODEL, pictures.FITTED)
    for (label, run), colour in zip(runs(comparison).items(), colours, strict=False):
        goodness = run[output]
        values = units.convert(goodness.simulated, signal.unit, unit)
        over.plot(time, values, color=colour, label=f"{label}: {goodness.fit_percent:.1f} % fit")
        if not hidden or goodness is after:
            residual = units.convert(goodness.residual, signal.unit, difference)
            below.plot(time, residual, color=colour)
    pictures.legend_above(over, 3)
    pictures.label(over, output, unit)
    pictures.label(below, "residual (fitted)" if hidden else "residual", difference)
