"""Fits and comparisons as text, pictures and JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fmus.kit import units
from fmus.kit.units import Described, format_difference, format_value, unit_of_differences
from orchestration.identify.metrics import finite_or_none
from orchestration.reporting import pictures, plain_table

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orchestration.identify.comparison import Comparison, GoodnessOfFit
    from orchestration.identify.grey_box import Fit
    from orchestration.identify.uncertainty import Estimate

_MUCH_LARGER = 25.0  # ratio of residuals from which on the larger one is not drawn


def overview(comparison: Comparison) -> Group:
    """Return the text of ``ppy compare``, without warnings.

    It has every output of every run, then fitted parameters.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    Group
    """
    model = comparison.model
    record = comparison.record
    table = plain_table(
        None, "output", "run", "fit", "RMS error", "residual", right=("fit", "RMS error")
    )
    for output in comparison.before:
        for label, run in _runs(comparison).items():
            g = run[output]
            error = format_difference(g.rms, model.outputs[output])
            residual = g.whiteness.summary() if g.whiteness else "too short to judge"
            table.add_row(output, label, _percent(g), error, residual)
    parts: list[RenderableType] = [
        Text(f"{record.source.name} against {model.title}: {record.time.size} samples"),
        table,
    ]
    if comparison.fit is not None:
        parts += [Text(), parameters(comparison.fit), *coupled(comparison.fit)]
    return Group(*parts)


def _percent(g: GoodnessOfFit) -> str:
    """Write the fit; it is undefined where the measured output was constant."""
    return f"{g.fit_percent:.2f} %" if math.isfinite(g.fit_percent) else "undefined"


def _runs(comparison: Comparison) -> dict[str, dict[str, GoodnessOfFit]]:
    """Return the assessed simulations by label."""
    if comparison.after is None:
        return {"simulated": comparison.before}
    return {"before": comparison.before, "fitted": comparison.after}


def parameters(fit: Fit) -> Table:
    """Return a table of fitted parameters with intervals, in their display units.

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    Table
    """
    profiled = ["95 % by profile"] if fit.profiles else []
    columns = ("fitted", "95 % interval", *profiled, "started from")
    table = plain_table(None, "parameter", *columns, right=columns)
    for name, e in fit.estimates.items():
        declared = fit.declared[name]
        low, high = (format_value(end, declared) for end in e.interval)
        cells = [format_value(e.value, declared), f"{low} … {high}"]
        if fit.profiles:
            cells.append(fit.profiles[name].written if name in fit.profiles else "")
        table.add_row(name, *cells, format_value(e.nominal, declared))
    return table


def coupled(fit: Fit) -> list[Text]:
    """Return a line on strongly correlated parameters, if there are any."""
    pairs = [f"{a} and {b} ({r:+.2f})" for (a, b), r in fit.coupled.items()]
    if not pairs:
        return []
    return [Text(f"known together better than each, by their correlation: {', '.join(pairs)}")]


def frame(comparison: Comparison) -> pandas.DataFrame:
    """Return a row for every output and run: fit, RMS error with its unit, whiteness."""
    import pandas

    rows = {
        (output, label): {
            "fit_percent": run[output].fit_percent,
            "rms": run[output].rms,
            "unit": comparison.model.outputs[output].unit,
            "white": test.is_white if (test := run[output].whiteness) else None,
        }
        for output in comparison.before
        for label, run in _runs(comparison).items()
    }
    made = pandas.DataFrame.from_dict(rows, orient="index")
    return made.rename_axis(["output", "run"])


def figures(comparison: Comparison) -> dict[str, Any]:
    """Return the figures, ready for JSON: numbers with their units, None for NaN.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    dict
    """

    def outputs(run: Mapping[str, GoodnessOfFit]) -> dict[str, Any]:
        return {
            name: {
                "fit_percent": finite_or_none(g.fit_percent),
                "rms": finite_or_none(g.rms),
                "unit": comparison.model.outputs[name].unit,
                "white": g.whiteness.is_white if g.whiteness else None,
                "ljung_box_p": finite_or_none(g.whiteness.p_value) if g.whiteness else None,
            }
            for name, g in run.items()
        }

    record = comparison.record
    result: dict[str, Any] = {
        "record": {
            "file": record.source.name,
            "samples": int(record.time.size),
            "seconds": float(record.time[-1] - record.time[0]),
            "notes": [repair.message for repair in record.repairs],
        },
        "model": comparison.model.name,
        "set": comparison.parameters,
        "outputs": outputs(comparison.before),
    }
    if comparison.fit is not None and comparison.after is not None:
        result["fitted"] = {"outputs": outputs(comparison.after), **comparison.fit.to_dict()}
    return result


def draw_comparison(comparison: Comparison) -> Figure:
    """Draw, for every measured output, record and simulation above the residual."""
    title = f"{comparison.record.source.name} against {comparison.model.name}"
    figure, axes = pictures.panels(2 * len(comparison.before), title)
    for k, output in enumerate(comparison.before):
        _draw_output(comparison, output, axes[2 * k], axes[2 * k + 1])
    pictures.logarithmic(axes, comparison.record.time)
    return figure


def draw_fit(fit: Fit) -> Figure:
    """Draw every fitted parameter with its 95 % interval, and where it started from."""
    title = "fitted parameters with 95 % intervals"
    figure, axes = pictures.panels(len(fit.estimates), title, "", 0.75, shared=False)
    for axis, (name, estimate) in zip(axes, fit.estimates.items(), strict=True):
        _draw_estimate(axis, name, estimate, fit.declared[name])
    axes[0].legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1
    )
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
    axis.set_yticks([0.0], [name.replace("_", " ")])
    axis.set_xlabel("" if unit == "1" else f"[{unit}]")


def _draw_output(comparison: Comparison, output: str, over: Axes, below: Axes) -> None:
    """Draw one output above its residual."""
    time = comparison.record.time
    signal = comparison.model.outputs[output]
    difference = unit_of_differences(signal)
    before = comparison.before[output]
    after = before if comparison.after is None else comparison.after[output]
    measured = units.convert(before.measured, signal.unit, signal.display)
    over.plot(time, measured, color=pictures.MEASURED, lw=2.5, label="measured")
    # the residual of the fit would vanish beside a much larger one before it
    hidden = before.rms > _MUCH_LARGER * after.rms
    colours = (pictures.MODEL, pictures.FITTED)
    for (label, run), colour in zip(_runs(comparison).items(), colours, strict=False):
        g = run[output]
        values = units.convert(g.simulated, signal.unit, signal.display)
        over.plot(time, values, color=colour, label=f"{label}: {g.fit_percent:.1f} % fit")
        if not hidden or g is after:
            below.plot(time, units.convert(g.residual, signal.unit, difference), color=colour)
    over.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1
    )
    pictures.label(over, output, signal.display)
    pictures.label(below, "residual (fitted)" if hidden else "residual", difference)
