"""A fit and a comparison as they are printed, drawn and written as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fmus.kit import units
from fmus.kit.units import shown, shown_difference, unit_of_differences
from orchestration.identify.metrics import number
from orchestration.reporting import pictures
from orchestration.reporting.console import plain_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from orchestration.identify.comparison import Comparison, GoodnessOfFit
    from orchestration.identify.grey_box import Fit

_MUCH_LARGER = 25.0


def overview(comparison: Comparison) -> Group:
    """Return what ``ppy compare`` prints, without warnings: every output of every run, then fitted parameters.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    Group
    """
    model, record = comparison.model, comparison.record
    table = plain_table(
        None, "output", "run", "fit", "RMS error", "residual", right=("fit", "RMS error")
    )
    for output in comparison.before:
        for label, run in _runs(comparison).items():
            g = run[output]
            residual = g.whiteness.summary() if g.whiteness else "too short to judge"
            percent = (
                f"{g.fit_percent:.2f} %" if math.isfinite(g.fit_percent) else "undefined"
            )  # it was constant
            table.add_row(
                output, label, percent, shown_difference(g.rms, model.outputs[output]), residual
            )
    parts: list[RenderableType] = [
        Text(f"{record.source.name} against {model.title}: {record.time.size} samples"),
        table,
    ]
    if comparison.fit is not None:
        parts += [Text(), parameters(comparison.fit), *coupled(comparison.fit)]
    return Group(*parts)


def _runs(comparison: Comparison) -> dict[str, dict[str, GoodnessOfFit]]:
    if comparison.after is None:
        return {"simulated": comparison.before}
    return {"before": comparison.before, "fitted": comparison.after}


def parameters(fit: Fit) -> Table:
    """Return fitted parameters with intervals, in the units in which people read them.

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    Table
    """
    columns = (
        "fitted",
        "95 % interval",
        *(["95 % by profile"] if fit.profiles else []),
        "started from",
    )
    table = plain_table(None, "parameter", *columns, right=columns)
    for name, e in fit.estimates.items():
        value, nominal, low, high = (
            shown(x, fit.declared[name]) for x in (e.value, e.nominal, *e.interval)
        )
        profiled = (
            [fit.profiles[name].written if name in fit.profiles else ""] if fit.profiles else []
        )
        table.add_row(name, value, f"{low} … {high}", *profiled, nominal)
    return table


def coupled(fit: Fit) -> list[Text]:
    """Return a line on pairs of parameters that are known together better than each; none where there are none."""
    pairs = [f"{a} and {b} ({r:+.2f})" for (a, b), r in fit.coupled.items()]
    return (
        [Text(f"known together better than each, by their correlation: {', '.join(pairs)}")]
        if pairs
        else []
    )


def figures(comparison: Comparison) -> dict[str, Any]:
    """Gather the figures, ready for JSON: numbers in the units that stand beside them, no NaN (null instead).

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
                "fit_percent": number(g.fit_percent),
                "rms": number(g.rms),
                "unit": comparison.model.outputs[name].unit,
                "white": g.whiteness.is_white if g.whiteness else None,
                "ljung_box_p": number(g.whiteness.p_value) if g.whiteness else None,
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


def draw(comparison: Comparison, path: Path | None = None) -> Figure:
    """Draw, for every measured output, record and simulation above the residual.

    Parameters
    ----------
    comparison : Comparison
    path : Path, optional
        Picture to write.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    title = f"{comparison.record.source.name} against {comparison.model.name}"
    figure, axes = pictures.panels(2 * len(comparison.before), title)
    for k, output in enumerate(comparison.before):
        _draw_output(comparison, output, axes[2 * k], axes[2 * k + 1])
    pictures.logarithmic(axes, comparison.record.time)
    if path is not None:
        pictures.save(figure, path)
    return figure


def _draw_output(comparison: Comparison, output: str, over: Axes, below: Axes) -> None:
    time, signal = comparison.record.time, comparison.model.outputs[output]
    difference = unit_of_differences(signal)
    runs = [(label, run[output]) for label, run in _runs(comparison).items()]
    measured = units.convert(runs[0][1].measured, signal.unit, signal.display)
    over.plot(time, measured, color=pictures.MEASURED, lw=2.5, label="measured")
    # the residual of the fit would vanish beside a much larger one before it
    hidden = runs[0][1].rms > _MUCH_LARGER * runs[-1][1].rms
    for (label, g), colour in zip(runs, (pictures.MODEL, pictures.FITTED), strict=False):
        values = units.convert(g.simulated, signal.unit, signal.display)
        over.plot(time, values, color=colour, label=f"{label}: {g.fit_percent:.1f} % fit")
        if not hidden or g is runs[-1][1]:
            below.plot(time, units.convert(g.residual, signal.unit, difference), color=colour)
    over.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, borderaxespad=0.1
    )
    pictures.label(over, output, signal.display)
    pictures.label(below, "residual (fitted)" if hidden else "residual", difference)
